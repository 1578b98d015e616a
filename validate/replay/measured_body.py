"""Any body under what a recording says moved it: a mesh file, block or cylinder, held and moved
where the user says, judged by force, markers and outlines; and the experiment that follows.

Statics at evenly spaced instants, or the motion in time (`moving_body`). In statics the body is
unloaded at the first one: what is compared of markers and outlines counts from there. An open
modulus is identified up to a share of the load, and only what lies beyond is a prediction.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from validate.compare.result import Kind
from validate.compare.verdict import Accept
from validate.errors import SceneError, UsageError
from validate.parameters import known
from validate.recording.types import Recording
from validate.replay.body_mesh import (
    AXES,
    body_of,
    even_axes,
    grid_unknowns,
    gridded,
    mesh_of,
    named_places,
    slides_across,
    unknowns_of,
)
from validate.replay.body_modulus import identify_body, model_name
from validate.replay.cards import beside
from validate.replay.cost import INPUTS, MESHES, affordable, fits, linear_seconds, newton_seconds
from validate.replay.experiment import (
    CORNER_ORDER,
    Change,
    Experiment,
    Identified,
    Input,
    MeshLadder,
    Uncertainty,
    vary,
)
from validate.replay.fitted_moduli import modulus_in
from validate.replay.machine_compliance import doubt, yielding
from validate.replay.measured_cards import MeasuredBody, SeenOf, Solid, SolidModel
from validate.replay.measured_contact import (
    contact_of,
    is_quarter,
    require_touching,
    symmetry,
)
from validate.replay.measured_drive import NOTED, drive_kind, prescribed
from validate.replay.measured_seen import place
from validate.replay.method import Method
from validate.replay.moving_body import doubting, following, in_motion
from validate.scene.coarser import size_against
from validate.scene.material import LawName, Material
from validate.scene.mesh import Mesh, cell_volumes, quadratic
from validate.scene.named_place import axis_of, place_of
from validate.scene.refine import of_element
from validate.scene.scene import Drive, Load, Pin, Pressure, Scene, Support, Weight
from validate.scene.similar_grids import fitting, member
from validate.solve.newton import StaticNewton
from validate.solve.quasi_static import QuasiStatic

_REFINED = 600.0  # s, of the runs that --refine makes of quadratic cells


def solid(label: str, law: LawName = "neo_hooke", order: Any = 1) -> Method:
    """A static model of the body in a law, of linear (nodal mean dilatation) or quadratic cells."""
    settings = QuasiStatic() if law == "linear" else StaticNewton("none")
    return Method(label, settings, SolidModel(law, order))


def measured_body(
    name: str,
    title: str,
    source: str,
    parameters: MeasuredBody,
    methods: Mapping[str, Method],
    accepted: tuple[str, ...],
    accept: tuple[Accept, ...],
    folder: Path,
    kind: Kind = "measured",
) -> Experiment:
    """The experiment; the last method, the cheapest, is the one that inputs are varied with.

    `folder` is that of the experiment's file, from which a mesh file is found.
    """
    bare = Experiment(
        name, title, source, parameters, methods, accepted, accept, beside,
        partial(static_scene, folder=folder), partial(place, folder=folder),
        frames=parameters.seen.states + 1, kind=kind,
        uncertainty=Uncertainty(
            mesh=MeshLadder(_SHARES if parameters.body.file is None else _HALVINGS,
                            partial(_cell, body=partial(body_of, folder=folder)),
                            _order(parameters, methods, accepted)),
            inputs=_inputs_of(parameters),
            surrogate=list(methods)[-1],
        ),
    )  # fmt: skip
    bare = replace(bare, refine=partial(_finer_settings, methods=bare.methods))
    if parameters.motion.how == "dynamic":
        made = in_motion(bare, bare.build, folder)
        return replace(made, follows=partial(_in_motion_as_set, folder=folder))
    return _as_set(bare, (), parameters, folder=folder)


def _as_set(
    experiment: Experiment, recordings: Sequence[Recording], p: MeasuredBody, *, folder: Path
) -> Experiment:
    """The experiment with the inputs that these parameters make uncertain, and charts along the
    axis of the largest motion."""
    assert experiment.uncertainty is not None
    uncertainty = replace(experiment.uncertainty, inputs=_inputs_of(p))
    made = replace(experiment, uncertainty=uncertainty)
    made = following(_affordable(made, p, folder), recordings, p) if recordings else made
    by_statics = partial(_identified, experiment=made, folder=folder)
    return replace(
        made,
        identify=partial(doubting, identify=by_statics, build=made.build),
        follows=partial(_as_set, folder=folder),
    )


def _in_motion_as_set(
    experiment: Experiment, recordings: Sequence[Recording], p: MeasuredBody, *, folder: Path
) -> Experiment:
    order = experiment.methods[experiment.accepted[0]].scene.order
    made = _with_levels(experiment, _levels(p, order, folder)[0])
    return following(made, recordings, p)


def _identified(
    recordings: Sequence[Recording],
    p: MeasuredBody,
    methods: Mapping[str, Method],
    *,
    experiment: Experiment,
    folder: Path,
) -> Identified:
    """The compliance that a rigid block shows, an open modulus, and the doubt of a machine whose
    compliance nobody stated."""
    p = yielding(p, folder)
    found = identify_body(recordings, p, methods, experiment=experiment)
    if drive_kind(recordings[0], p) != "moves" or p.moved.by == NOTED:
        return found
    limits = [a.required for a in experiment.accept if a.quantity == "force" and a.required]
    why = doubt(p, recordings[0], min(limits, default=None))
    if not why:
        return found
    headline = f"{found.headline}; largest warning: " if found.headline else "largest warning: "
    return replace(
        found, doubts=(why, *found.doubts), headline=headline + "the machine's compliance"
    )


# --- the scene ------------------------------------------------------------------------------------


def static_scene(
    recording: Recording, p: MeasuredBody, model: SolidModel, folder: Path, body: Any = None
) -> Scene:
    """The body as it is held and loaded; a mesh file is found from the `folder`."""
    mesh = mesh_of(p, body or partial(body_of, folder=folder))
    E = modulus_in(p.material.by_method, model_name(model)) or p.material.E
    scene = Scene(
        mesh,
        Material(known(E, "material.E"), p.material.nu, model.law, p.material.rho,
                 coefficients=p.material.coefficients.known_to(model.law)),
        _supports(p, mesh, recording),
        _pins(p, mesh),
        copies=4 if is_quarter(p) else 1,
        **_load(p, recording, (mesh, folder)),
    )  # fmt: skip
    if mesh.bricks:
        bricks = quadratic(mesh) if model.order == 2 and p.body.file is None else mesh
        return replace(scene, body=bricks, dilatation="mixed")
    return of_element(scene, "P2" if model.order == 2 else "MD")


def _supports(p: MeasuredBody, mesh: Mesh, recording: Recording) -> tuple[Support, ...]:
    said = [(getattr(p.held, name), axes) for name, axes in AXES.items()]
    held = [Support(place_of(text, mesh), axes) for text, axes in said if text]
    if p.held.slides:
        held.append(Support(place_of(p.held.slides, mesh), (slides_across(p.held.slides, mesh),)))
    held += symmetry(p)
    if drive_kind(recording, p) == "moves" and p.moved.sideways and not p.indenter.there:
        along = int(np.abs(axis_of(p.moved.along)).argmax())
        across = tuple(c for c in range(3) if c != along)
        held.append(Support(place_of(known_place(p), mesh), across))
    return tuple(held)


def _pins(p: MeasuredBody, mesh: Mesh) -> tuple[Pin, ...]:
    if not p.held.slides:
        return ()
    across = slides_across(p.held.slides, mesh)
    return Support(place_of(p.held.slides, mesh), (across,), rests=True).pins(mesh)


def _load(p: MeasuredBody, recording: Recording, at: tuple[Mesh, Path]) -> dict[str, Any]:
    kind, along = drive_kind(recording, p), axis_of(p.moved.along)
    if kind == "weighs":
        return {"loads": (Weight("gravity", along),)}
    if not p.motion.gravity:
        return _without_weight(p, recording, at, kind, along)
    weight = Weight("gravity", axis_of(p.motion.gravity))
    found = _without_weight(p, recording, at, kind, along)
    return found | {"loads": (*found.get("loads", ()), weight)}


def _without_weight(
    p: MeasuredBody, recording: Recording, at: tuple[Mesh, Path], kind: Any, along: Any
) -> dict[str, Any]:
    where = place_of(known_place(p), at[0])
    if p.indenter.there:
        require_touching(p, "m" if kind == "moves" else "N")
        return {"contacts": (contact_of(p, at[0], where),)}
    if kind == "follows":
        return {"tracked": (prescribed(recording, p, where, at),)}
    if kind in ("pulls", "releases"):
        return {"loads": (Load("load", where, along),)}
    if kind == "presses":
        return {"loads": (Pressure("load", where),)}
    if sorted(np.abs(along)) != [0.0, 0.0, 1.0]:
        raise SceneError(f"moved.along = {p.moved.along}: expected an axis, as -z")
    return {"drives": (Drive("moved", where, along),)}


def known_place(p: MeasuredBody) -> str:
    """Raises `UsageError` where the place that is moved is not said."""
    if not p.moved.place:
        raise UsageError(
            "moved.place is not set; name where the load acts, as --set moved.place=zmax"
        )
    return p.moved.place


# --- what is uncertain ----------------------------------------------------------------------------


def _level(share: float | None, halvings: int | None) -> Change:
    """The similar grid with about `share` of the cells along every axis (none: its own `finer`, or
    a coarser one where that does not fit into the memory), or a mesh file with its edges halved so
    many times more."""

    def change(p: MeasuredBody) -> MeasuredBody:
        body = p.body
        if body.file is not None:
            return replace(p, body=replace(body, halvings=body.halvings + (halvings or 0)))
        even = even_axes(p)
        by = body.finer if share is None else share
        cells = member(gridded(p).body.divisions, by, even)
        return replace(p, body=replace(body, divisions=fitting(cells, partial(_fits, body), even)))

    return change


def _fits(body: Solid, cells: tuple[int, ...]) -> bool:
    """Whether the quadratic system of a grid fits into memory and the time of a first answer."""
    N = grid_unknowns(cells, round_=bool(body.cylinder))
    return fits(N, linear_seconds(N), MESHES if body.budget else None)


_SHARES = (_level(0.5, None), _level(0.75, None), _level(None, None))
_HALVINGS = (_level(None, 1), _level(None, 2))
_COARSER = (_level(None, -1),)


def _affordable(experiment: Experiment, p: MeasuredBody, folder: Path) -> Experiment:
    """The experiment with meshes of u_num that fit into memory and into the time of a first answer.

    Where they are too slow at large strain, the linear method of the same element stands in; where
    the surrogate is slow, inputs are moved one by one only.
    """
    order = experiment.methods[experiment.accepted[0]].scene.order
    N, (levels, finest) = unknowns_of(p, order, folder), _levels(p, order, folder)
    experiment = _with_levels(experiment, levels)
    uncertainty = experiment.uncertainty
    assert uncertainty is not None
    if p.body.budget and not p.indenter.there:
        if p.seen.states * newton_seconds(finest) > MESHES:
            uncertainty = replace(uncertainty, stand_in=_linear_of(experiment))
        if (1 + len(uncertainty.inputs) + uncertainty.draws) * linear_seconds(N) > INPUTS:
            uncertainty = replace(uncertainty, draws=0)
    return replace(experiment, uncertainty=uncertainty)


def _with_levels(experiment: Experiment, levels: tuple[Change, ...]) -> Experiment:
    declared = experiment.uncertainty
    assert declared is not None
    assert declared.mesh is not None
    mesh = replace(declared.mesh, levels=levels)
    return replace(experiment, uncertainty=replace(declared, mesh=mesh))


def _levels(p: MeasuredBody, order: int, folder: Path) -> tuple[tuple[Change, ...], float]:
    """The meshes of u_num, and the unknowns of the finest: similar grids; or meshes of the file,
    halved as far as they fit; or, where none does, a coarser one."""
    N = unknowns_of(p, order, folder)
    if p.body.file is None:
        return _SHARES, N * p.body.finer**3
    if p.body.halvings < 0:
        finer = [replace(p, body=replace(p.body, halvings=p.body.halvings + k)) for k in (1, 2)
                 if p.body.halvings + k <= 0]  # fmt: skip
        sizes = [unknowns_of(one, order, folder) for one in finer]
    else:
        sizes = [8 * N, 64 * N]
    found = affordable(_HALVINGS[: len(sizes)], sizes, budget=p.body.budget)
    return (found, sizes[len(found) - 1]) if found else (_COARSER, N)


def _finer_settings(
    p: MeasuredBody, folder: Path, *, methods: Mapping[str, Method]
) -> Mapping[str, str]:
    """What --refine sets: no time limit, 30 load steps, a file's own mesh, with quadratic cells
    as far as they fit into the memory."""
    found = {"body.budget": "false"}
    if p.body.halvings < 0:
        found["body.halvings"] = "0"
        p = replace(p, body=replace(p.body, halvings=0))
    if p.motion.how == "static":
        found["seen.states"] = str(max(p.seen.states, SeenOf().states))
    if p.body.file is None or body_of(p.body, folder=folder, places=named_places(p)).bricks:
        return found
    N = unknowns_of(p, 2, folder)
    if fits(N, SeenOf().states * newton_seconds(N), _REFINED):
        found |= {f"methods.{name}.order": "2" for name, m in methods.items() if m.scene.order == 1}
    return found


def _linear_of(experiment: Experiment) -> dict[str, str]:
    """Of each accepted method at large strain, the linear one of the same element."""
    models = {name: m.scene for name, m in experiment.methods.items()}
    return {
        name: linear
        for name in experiment.accepted if models[name].law != "linear"
        for linear, model in models.items()
        if (model.law, model.order) == ("linear", models[name].order)
    }  # fmt: skip


def _order(p: MeasuredBody, methods: Mapping[str, Method], accepted: tuple[str, ...]) -> float:
    """The formal order: of a static force or displacement that of the corners of a held place; of
    a motion in time that of its cells, since frequencies rule it, of which corners are a small
    part."""
    if p.motion.how == "static":
        return CORNER_ORDER
    return max(3.0 if methods[n].scene.order == 2 else 2.0 for n in accepted if n in methods)


def _cell(p: MeasuredBody, *, body: Any) -> float:
    """The edge m of a cube as large as a mean cell; of a coarser filling by its nodes' distance."""
    mesh = mesh_of(p, body)
    if p.body.file and p.body.halvings < 0:
        own = mesh_of(replace(p, body=replace(p.body, halvings=0)), body)
        return size_against(own, mesh) * float(np.cbrt(cell_volumes(own).mean()))
    return float(np.cbrt(cell_volumes(mesh).mean()))


_INPUTS = (
    vary("material.E", "relative ranges.E", "modulus", "E within its declared uncertainty"),
    vary("material.nu", "absolute ranges.nu, below 0.5", "Poisson ratio",
         "nu within its declared uncertainty"),
    vary("moved.scale", "relative ranges.load", "load", "what moves the body, within its range"),
)  # fmt: skip
_CONTACT = vary("indenter.gap", "absolute ranges.contact", "contact point",
                "where the indenter touches")  # fmt: skip
_MACHINE = vary(
    "machine.compliance", "absolute machine.sd, at least 0", "machine compliance",
    "compliance of the machine within its standard uncertainty", "declared",
)  # fmt: skip


def _inputs_of(p: MeasuredBody) -> tuple[Input, ...]:
    """Those that this body has: an indenter its contact point, a known machine its compliance."""
    own = (_CONTACT,) if p.indenter.there else ()
    known_machine = p.machine.compliance is not None or p.machine.measured is not None
    return (*_INPUTS, *own, *((_MACHINE,) if known_machine else ()))
