"""Any body under what a recording says moved it: a mesh file, block or cylinder, held and moved
where the user says, judged by force, markers and outlines; and the experiment that follows.

Statics at evenly spaced instants. The body is unloaded at the first one: what is compared of
markers and outlines counts from there. An open modulus is identified up to a share of the load,
and only what lies beyond is a prediction.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache, partial
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np

from validate.compare.verdict import Accept
from validate.errors import SceneError, UsageError
from validate.parameters import known
from validate.recording.types import Recording
from validate.replay.calibration import Calibrates, Calibration, Free
from validate.replay.cards import beside, moved
from validate.replay.experiment import Change, Experiment, Input, MeshLadder, Uncertainty
from validate.replay.measured_cards import MeasuredBody, Solid, SolidModel
from validate.replay.measured_seen import LOW, drive_kind, place, prescribed
from validate.replay.method import Method
from validate.scene.box import box
from validate.scene.cylinder import whole_cylinder
from validate.scene.material import LawName, Material
from validate.scene.mesh import Mesh, cell_volumes
from validate.scene.mesh_file import read_mesh
from validate.scene.named_place import axis_of, place_of
from validate.scene.refine import linear, of_element, refined
from validate.scene.scene import Drive, Load, Scene, Support, Weight
from validate.solve.newton import StaticNewton
from validate.solve.quasi_static import QuasiStatic

_MODULI = (10.0, 1e9)  # Pa: between them an open modulus is looked for
_AXES = {"all": (0, 1, 2), "x": (0,), "y": (1,), "z": (2,)}


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
) -> Experiment:
    """The experiment; the last method, the cheapest, is the one that inputs are varied with.

    `folder` is that of the experiment's file, from which a mesh file is found. Raises `UsageError`
    for an open modulus that nothing which is judged can tell.
    """
    body = partial(body_of, folder=folder)
    return Experiment(
        name, title, source, parameters, methods, accepted, accept, beside,
        partial(_build, body=body, folder=folder), partial(place, folder=folder),
        frames=parameters.seen.states + 1,
        calibrations=_calibrations(parameters, methods, accept),
        uncertainty=Uncertainty(
            mesh=MeshLadder((_level(0.5, 1), _level(0.75, 2), _level(None, None)),
                            partial(_cell, body=body))
            if parameters.body.file is None
            else MeshLadder((_level(None, 1), _level(None, 2)), partial(_cell, body=body)),
            inputs=_INPUTS,
            surrogate=list(methods)[-1],
        ),
    )  # fmt: skip


def _calibrations(
    p: MeasuredBody, methods: Mapping[str, Method], accept: tuple[Accept, ...]
) -> tuple[Calibration, ...]:
    """An open modulus is found on the force, or where a force moves the body on its markers; each
    method finds its own."""
    if p.seen.force is None and (p.moved.by == "gravity" or p.seen.markers is None):
        return ()
    quantity = "force" if p.seen.force else "marker"
    free = (Free("material.E", *_MODULI, "assumed"),)
    on = (Calibrates((f"{quantity}@{LOW}",), name=f"the load up to {p.seen.fit_to:g} of it"),)
    return tuple(Calibration(name, free, on) for name in methods)


# --- the scene ------------------------------------------------------------------------------------


def _build(
    recording: Recording, p: MeasuredBody, model: SolidModel, *, body: Any, folder: Path
) -> Scene:
    mesh = body(p.body)
    scene = Scene(
        mesh,
        Material(known(p.material.E, "material.E"), p.material.nu, model.law, p.material.rho,
                 coefficients=p.material.coefficients.known_to(model.law)),
        _supports(p, mesh, recording),
        **_load(p, recording, (mesh, folder)),
    )  # fmt: skip
    if mesh.bricks:
        return replace(scene, dilatation="mixed")
    return of_element(scene, "P2" if model.order == 2 else "MD")


def _supports(p: MeasuredBody, mesh: Mesh, recording: Recording) -> tuple[Support, ...]:
    said = [(getattr(p.held, name), axes) for name, axes in _AXES.items()]
    held = [Support(place_of(text, mesh), axes) for text, axes in said if text]
    if drive_kind(recording, p) == "moves" and p.moved.sideways:
        along = int(np.abs(axis_of(p.moved.along)).argmax())
        across = tuple(c for c in range(3) if c != along)
        held.append(Support(place_of(known_place(p), mesh), across))
    return tuple(held)


def _load(p: MeasuredBody, recording: Recording, at: tuple[Mesh, Path]) -> dict[str, Any]:
    kind, along = drive_kind(recording, p), axis_of(p.moved.along)
    if kind == "weighs":
        return {"loads": (Weight("gravity", along),)}
    where = place_of(known_place(p), at[0])
    if kind == "follows":
        return {"tracked": (prescribed(recording, p, where, at),)}
    if kind == "pulls":
        return {"loads": (Load("load", where, along),)}
    if sorted(np.abs(along)) != [0.0, 0.0, 1.0]:
        raise SceneError(f"moved.along = {p.moved.along}: a place is moved along an axis, as -z")
    return {"drives": (Drive("moved", where, along),)}


def known_place(p: MeasuredBody) -> str:
    """Raises `UsageError` where the place that is moved is not said."""
    if not p.moved.place:
        raise UsageError("moved.place is not set; say where the load acts: --set moved.place=zmax")
    return p.moved.place


def body_of(card: Solid, *, folder: Path) -> Mesh:
    """The body with the facet set "surface" of all of it; of 3-D cells.

    Raises `UsageError` for a card that says none, `SceneError` for a mesh of 2-D cells.
    """
    mesh = _meshed(card, folder)
    if mesh.dimension != 3:
        raise SceneError(f"{card.file}: cells of {mesh.kind}; a body of 3-D cells is needed")
    return replace(mesh, facets={**mesh.facets, "surface": mesh.surface})


@lru_cache(maxsize=8)
def _meshed(card: Solid, folder: Path) -> Mesh:
    if card.file is not None:
        scene = Scene(linear(read_mesh(folder / card.file, card.unit)), Material(1.0, 0.3))
        for _ in range(card.halvings):
            scene = refined(scene)
        return scene.mesh
    if card.block:
        edge = max(card.block) / card.cells
        x, y, z = card.block
        cells = tuple(max(2, round(size / edge)) for size in (x, y, z))
        return box((x, y, z), cells)
    if card.cylinder:
        diameter, height = card.cylinder
        edge = max(diameter, height) / card.cells
        radial, axial = ceil(diameter / 2 / edge), ceil(height / edge)
        return whole_cylinder(diameter, height, max(2, radial), max(2, axial))
    raise UsageError("body: none is given; set body.file, body.block or body.cylinder")


# --- what is uncertain ----------------------------------------------------------------------------


def _level(share: float | None, halvings: int | None) -> Change:
    """A grid with `share` of its cells along every edge (none: its own `finer`), or a mesh file
    with its edges halved so many times more."""

    def change(p: MeasuredBody) -> MeasuredBody:
        body = p.body
        if body.file is not None:
            return replace(p, body=replace(body, halvings=body.halvings + (halvings or 0)))
        by = body.finer if share is None else share
        return replace(p, body=replace(body, cells=ceil(body.cells * by)))

    return change


def _cell(p: MeasuredBody, *, body: Any) -> float:
    """The edge m of a cube as large as a mean cell."""
    return float(np.cbrt(cell_volumes(body(p.body)).mean()))


def _stiffer(p: MeasuredBody, z: float) -> float | None:
    return p.material.E and p.material.E * (1 + z * p.ranges.E)


def _more(p: MeasuredBody, z: float) -> float:
    return p.moved.scale * (1 + z * p.ranges.load)


_INPUTS = (
    Input("modulus", moved("material", E=_stiffer), "E within its declared uncertainty", "assumed"),
    Input("Poisson ratio",
          moved("material", nu=lambda p, z: min(p.material.nu + z * p.ranges.nu, 0.4999)),
          "nu within its declared uncertainty", "assumed"),
    Input("load", moved("moved", scale=_more), "what moves the body, within its range", "assumed"),
)  # fmt: skip
