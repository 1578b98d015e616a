"""Experiment of a measured body: mesh file, block or cylinder, against force, markers, outlines.

Statics at evenly spaced instants, or the motion in time (`moving_body`). In statics the body is
unloaded at the first one: what is compared of markers and outlines counts from there. An open
modulus is identified up to a share of the load, and only what lies beyond is a prediction.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from validate.compare.result import Kind
from validate.compare.verdict import Accept
from validate.errors import SceneError, UsageError
from validate.pipeline.bodies.body_dynamics import doubting, following, in_motion
from validate.pipeline.bodies.body_registration import place
from validate.pipeline.bodies.choices import SeenOf
from validate.pipeline.bodies.drive import drive_kind, mover, placed_points, pressing
from validate.pipeline.bodies.first_modes import Changes, element_of, is_quadratic, law_of, model_of
from validate.pipeline.bodies.mesh import (
    costs_of,
    even_axes,
    grid_unknowns,
    is_round,
    mesh_of,
    unknowns_of,
)
from validate.pipeline.bodies.modulus import identify_body, model_name
from validate.pipeline.calibration.fitted_moduli import modulus_in
from validate.pipeline.experiment.experiment import (
    CORNER_ORDER,
    Change,
    Experiment,
    Identified,
    Input,
    MeshLadder,
    Uncertainty,
    vary,
)
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import CellSize, Tree, beside, changed_by
from validate.pipeline.plates.scene import doubt, yielding
from validate.pipeline.run.cost import (
    INPUTS,
    MESHES,
    affordable,
    fits,
    linear_seconds,
    newton_seconds,
)
from validate.recording.types import Recording
from validate.scene.geometries.box import fitting, member
from validate.scene.geometries.specification import Geometry, MeshFile
from validate.scene.material import LawName
from validate.scene.scene import Drive, Scene
from validate.solve.static.contact import ContactNewton
from validate.solve.static.newton import StaticNewton
from validate.solve.static.quasi_static import QuasiStatic

_REFINED = 600.0  # s, of the runs that --refine makes of quadratic cells


def solid(label: str, law: LawName = "neo_hooke", scene: Changes | None = None) -> Method:
    """Return a static model of the body in a law, with further changes of the scene by path."""
    settings = QuasiStatic() if law == "linear" else StaticNewton("none")
    return Method(label, settings, {**model_of(law), **(scene or {})})


def touching(label: str, law: LawName = "neo_hooke", scene: Changes | None = None) -> Method:
    """As `solid`, of a body that is pressed by a rigid indenter."""
    return Method(label, ContactNewton(), {**model_of(law), **(scene or {})})


def measured_body(
    name: str,
    title: str,
    source: str,
    parameters: Tree,
    methods: Mapping[str, Method],
    accepted: tuple[str, ...],
    accept: tuple[Accept, ...],
    folder: Path,
    kind: Kind = "measured",
) -> Experiment:
    """Return the experiment; the last method, the cheapest, is the one that inputs are varied with.

    `folder` is that of the experiment's file, from which a mesh file is found.
    """
    settings = parameters.settings
    levels = _HALVINGS if isinstance(parameters.scene.body, MeshFile) else _SHARES
    # The formal order: of a static force or displacement that of the corners of a held place; of a
    # motion in time that of its cells: frequencies rule it, of which corners are a small part.
    order = CORNER_ORDER
    if settings.motion.how != "static":
        order = max(1.0 + _order_of(methods[n], parameters) for n in accepted if n in methods)
    bare = Experiment(
        name, title, source, parameters, methods, accepted, accept, beside,
        partial(static_scene, folder=folder), partial(place, folder=folder),
        frames=settings.seen.states + 1, kind=kind,
        uncertainty=Uncertainty(
            mesh=MeshLadder(levels, CellSize(folder), order),
            inputs=_inputs_of(parameters),
            surrogate=list(methods)[-1],
        ),
    )  # fmt: skip
    bare = replace(bare, refine=partial(_finer_settings, methods=bare.methods))
    if settings.motion.how == "dynamic":
        made = in_motion(bare, bare.build, folder)
        return replace(made, follows=partial(_in_motion_as_set, folder=folder))
    return _as_set(bare, (), parameters, folder=folder)


def _as_set(
    experiment: Experiment, recordings: Sequence[Recording], p: Tree, *, folder: Path
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
    experiment: Experiment, recordings: Sequence[Recording], p: Tree, *, folder: Path
) -> Experiment:
    order = _order_of(experiment.methods[experiment.accepted[0]], p)
    made = _with_levels(experiment, _levels(p, order, folder)[0])
    return following(made, recordings, p)


def _identified(
    recordings: Sequence[Recording],
    p: Tree,
    methods: Mapping[str, Method],
    *,
    experiment: Experiment,
    folder: Path,
) -> Identified:
    """The compliance that a rigid block shows, an open modulus, and the doubt of a machine whose
    compliance nobody stated."""
    moved = mover(p.scene).name
    p = yielding(p, folder, moved)
    found = identify_body(recordings, p, methods, experiment=experiment)
    if drive_kind(recordings[0], p) != "moves" or p.settings.noted:
        return found
    limits = [a.required for a in experiment.accept if a.quantity == "force" and a.required]
    why = doubt(p, recordings[0], moved, min(limits, default=None))
    if not why:
        return found
    headline = f"{found.headline}; largest warning: " if found.headline else "largest warning: "
    return replace(
        found, doubts=(why, *found.doubts), headline=headline + "the machine's compliance"
    )


# --- the scene ------------------------------------------------------------------------------------


def static_scene(recording: Recording, p: Tree, model: Changes, folder: Path) -> Scene:
    """Return the body as it is held and loaded, in the law and element of a method; a mesh file is
    found from the `folder`."""
    E = modulus_in(p.settings.by_method, model_name(model))
    changed = changed_by(p, {**model, **({} if E is None else {"material.E": E})})
    # What a quarter does not show, an indenter without motion, a drive along no axis
    part, seen = mover(changed.scene), changed.settings.seen
    drive_kind(recording, changed)
    if getattr(changed.scene.body, "copies", 1) > 1 and (seen.markers or seen.outline):
        raise UsageError(
            "the body is a quarter, of which only the force can be compared; set "
            "seen.markers=none and seen.outline=none, or declare the whole body"
        )
    if isinstance(part, Drive) and sorted(np.abs(part.direction)) != [0.0, 0.0, 1.0]:
        raise SceneError(f"drive '{part.name}' along {part.direction}: expected an axis, as -z")
    mesh = mesh_of(changed, folder)
    at = (mesh, folder)
    tracked = tuple(placed_points(recording, p, part, at) for part in changed.scene.tracked)
    return replace(changed.scene, tracked=tracked).resolved(mesh)


# --- what is uncertain ----------------------------------------------------------------------------


def _level(share: float | None, halvings: int | None) -> Change:
    """The similar grid with about `share` of the cells along every axis (none: as many times finer
    as `finer` says, or a coarser one where that does not fit into the memory), or a mesh file with
    its edges halved so many times more."""

    def change(p: Tree) -> Tree:
        body, even = p.scene.body, even_axes(p.scene)
        if isinstance(body, MeshFile):
            finer: Geometry = replace(body, halvings=body.halvings + (halvings or 0))
            return p.with_scene(body=finer)
        cells = member(body.cells, p.settings.mesh.finer if share is None else share, even)
        return p.with_scene(body=replace(body, cells=fitting(cells, partial(_fits, p), even)))

    return change


def _fits(p: Tree, cells: tuple[int, ...]) -> bool:
    """Whether the quadratic system of a grid fits into memory and the time of a first answer."""
    N = grid_unknowns(cells, round_=is_round(p.scene.body))
    return fits(N, linear_seconds(N), MESHES if p.settings.mesh.budget else None)


_SHARES = (_level(0.5, None), _level(0.75, None), _level(None, None))
_HALVINGS = (_level(None, 1), _level(None, 2))
_COARSER = (_level(None, -1),)


def _affordable(experiment: Experiment, p: Tree, folder: Path) -> Experiment:
    """The experiment with meshes of u_num that fit into memory and into the time of a first answer.

    Where they are too slow at large strain, the linear method of the same element stands in; where
    the surrogate is slow, inputs are moved one by one only.
    """
    order = _order_of(experiment.methods[experiment.accepted[0]], p)
    N, (levels, finest) = costs_of(p, order, folder), _levels(p, order, folder)
    experiment = _with_levels(experiment, levels)
    uncertainty = experiment.uncertainty
    assert uncertainty is not None
    if p.settings.mesh.budget and pressing(p.scene) is None:
        if p.settings.seen.states * newton_seconds(finest) > MESHES:
            # The linear method of the same element, of each accepted method at large strain
            kinds = {n: (law_of(m, p), element_of(m, p)) for n, m in experiment.methods.items()}
            uncertainty = replace(
                uncertainty,
                stand_in={
                    name: linear
                    for name in experiment.accepted
                    if kinds[name][0] != "linear"
                    for linear, kind in kinds.items()
                    if kind == ("linear", kinds[name][1])
                },
            )
        if (1 + len(uncertainty.inputs) + uncertainty.draws) * linear_seconds(N) > INPUTS:
            uncertainty = replace(uncertainty, draws=0)
    return replace(experiment, uncertainty=uncertainty)


def _with_levels(experiment: Experiment, levels: tuple[Change, ...]) -> Experiment:
    declared = experiment.uncertainty
    assert declared is not None
    assert declared.mesh is not None
    mesh = replace(declared.mesh, levels=levels)
    return replace(experiment, uncertainty=replace(declared, mesh=mesh))


def _levels(p: Tree, order: int, folder: Path) -> tuple[tuple[Change, ...], float]:
    """The meshes of u_num, and the unknowns of the finest: similar grids; or meshes of the file,
    halved as far as they fit; or, where none does, a coarser one."""
    N, body = costs_of(p, order, folder), p.scene.body
    if not isinstance(body, MeshFile):
        return _SHARES, N * p.settings.mesh.finer**3
    if body.halvings < 0:
        finer = [p.with_scene(body=replace(body, halvings=body.halvings + k)) for k in (1, 2)
                 if body.halvings + k <= 0]  # fmt: skip
        sizes = [costs_of(one, order, folder) for one in finer]
    else:
        sizes = [8 * N, 64 * N]
    found = affordable(_HALVINGS[: len(sizes)], sizes, budget=p.settings.mesh.budget)
    return (found, sizes[len(found) - 1]) if found else (_COARSER, N)


def _finer_settings(
    p: Tree, folder: Path, *, methods: Mapping[str, Method]
) -> Mapping[str, str]:  # fmt: skip
    """What --refine sets: no time limit, 30 load steps, a file's own mesh, with quadratic cells
    as far as they fit into the memory."""
    found, body = {"mesh.budget": "false"}, p.scene.body
    if p.settings.motion.how == "static":
        found["seen.states"] = str(max(p.settings.seen.states, SeenOf().states))
    if not isinstance(body, MeshFile):
        return found
    if body.halvings < 0:
        found["body.halvings"] = "0"
        p = p.with_scene(body=replace(body, halvings=0))
    if mesh_of(p, folder).bricks:
        return found
    N = unknowns_of(p, 2, folder)
    if fits(N, SeenOf().states * newton_seconds(N), _REFINED):
        own = [n for n, m in methods.items() if (m.scene or {}).get("body.element") == "linear"]
        found |= {f"methods.{n}.body.element": "quadratic" for n in own}
        found |= {"body.element": "quadratic"} if body.element == "linear" else {}
    return found


def _order_of(method: Method, p: Tree) -> int:
    return 2 if is_quadratic(element_of(method, p)) else 1


_INPUTS = (
    vary("material.E", "relative ranges.E", "modulus", "E within its declared uncertainty"),
    vary("material.nu", "absolute ranges.nu, below 0.5", "Poisson ratio",
         "nu within its declared uncertainty"),
    vary("scale", "relative ranges.load", "load", "what moves the body, within its range"),
)  # fmt: skip
_MACHINE = vary(
    "machine.compliance", "absolute machine.sd, at least 0", "machine compliance",
    "compliance of the machine within its standard uncertainty", "declared",
)  # fmt: skip


def _inputs_of(p: Tree) -> tuple[Input, ...]:
    """Those that this body has: an indenter its contact point, a known machine its compliance."""
    machine, pressed = p.settings.machine, pressing(p.scene) is not None
    touch = vary(f"contacts.{mover(p.scene).name}.shape.gap", "absolute ranges.contact",
                 "contact point", "where the indenter touches")  # fmt: skip
    known = machine.compliance is not None or machine.measured is not None
    return (*_INPUTS, *((touch,) if pressed else ()), *((_MACHINE,) if known else ()))
