"""Bodies pressed between two plates, or pulled between two grips, from a log of displacement and
force: what a file of one's own declares, and the experiment that follows.

The body is a cylinder or a mesh file. Displacement counts from contact less the toe (where the
fitted line reaches zero force), force from the cell's own offset; the first window of strain fits
the modulus where none is given, the second predicts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np

from validate.compare.result import Kind
from validate.compare.verdict import Accept
from validate.errors import ComparisonError, UsageError
from validate.files import modified
from validate.identify.modulus import MIN_SAMPLES, fit_modulus
from validate.recording.scatter import repeats_share
from validate.recording.types import Recording
from validate.register.registered import Registered
from validate.replay.cards import beside, scaled
from validate.replay.compression_cards import Compression, Pressed, stated_sizes
from validate.replay.cost import INPUTS, affordable, linear_seconds
from validate.replay.experiment import (
    CORNER_ORDER,
    Change,
    Experiment,
    Input,
    MeshLadder,
    Uncertainty,
    vary,
)
from validate.replay.fitted_moduli import modulus_in, toe_in
from validate.replay.method import Method
from validate.replay.pressed import pressed_log
from validate.replay.pressed_modulus import by_model, identify_pressed, model_name
from validate.replay.pressed_outline import (
    OUTLINE_INPUTS,
    with_outline,
    with_surface,
)
from validate.scene.coarser import coarser, size_against
from validate.scene.cylinder import quarter_cylinder, whole_cylinder
from validate.scene.material import LawName, Material
from validate.scene.mesh import Mesh, cell_volumes
from validate.scene.mesh_file import read_mesh
from validate.scene.plates import Contact
from validate.scene.refine import of_element, refined
from validate.scene.scene import Cavity, Drive, Pin, Scene, Support
from validate.solve.fluid import ExactPressure, NoFluid
from validate.solve.newton import StaticNewton
from validate.solve.tabulated import Tabulated

STAGE = Drive("stage", "upper_plate", (0.0, 0.0, -1.0))
PULLED = Drive("stage", "upper_plate", (0.0, 0.0, 1.0))
SYMMETRY = (Support("symmetry_x", (0,)), Support("symmetry_y", (1,)))  # of a quarter
_LOAD_STEPS = 20  # of a table of loads at large strain, to the strain limit


def pressed(
    label: str,
    plates: Contact = "slip",
    law: LawName = "linear",
    order: Literal[1, 2] = 2,
    *,
    fluid: bool = False,
) -> Method:
    """A static model of the body between plates that slip or hold it, in a law; a linear one may
    have fluid of constant volume in `specimen.fluid`. Raises `UsageError` for another with it."""
    linear = law == "linear"
    if fluid and not linear:
        raise UsageError(f"method '{label}': fluid needs the linear law, not {law}")
    slow = Tabulated(StaticNewton("none"))
    settings = ExactPressure() if fluid else NoFluid() if linear else slow
    return Method(label, settings, Pressed(plates, law, order))


def compression(
    name: str,
    title: str,
    source: str,
    parameters: Compression,
    methods: Mapping[str, Method],
    accepted: tuple[str, ...],
    accept: tuple[Accept, ...],
    kind: Kind = "measured",
) -> Experiment:
    """The experiment: `force` is judged in the windows "fit" and "beyond", outlines that
    `parameters` name at images of their own."""
    shown = parameters.outline.topic is not None
    inputs = (
        vary(("material.E", "material.E_bonded"), "relative ranges.E", "modulus",
             "E within its declared uncertainty"),
        Input("diameter", _wider_body if shown else _stiffer_by_area,
              "diameter within its declared range", "assumed"),
        *(OUTLINE_INPUTS if shown else ()),
    )  # fmt: skip
    return Experiment(
        name, title, source, parameters, methods, accepted, accept, beside, _build,
        partial(_place, shown=shown), sets=_sets, stated=stated_sizes,
        identify=partial(
            identify_pressed, build=_build, ladder=_MESHES, accepted=accepted,
            declared=inputs if shown else (),
        ),
        follows=_affordable,
        refine=lambda p, _: {} if p.specimen.mesh is None else {"mesh.budget": "false"},
        frames=2,
        kind=kind,
        uncertainty=Uncertainty(
            mesh=_MESHES,
            inputs=inputs,
            surrogate=accepted[0],
        ),
    )  # fmt: skip


def _affordable(
    experiment: Experiment, recordings: Sequence[Recording], p: Compression
) -> Experiment:
    """The experiment with those halvings of a mesh file that fit into memory and `mesh.budget`;
    where its inputs are dear, they are moved one by one only."""
    if p.specimen.mesh is None:
        return experiment
    assert experiment.uncertainty is not None
    first = experiment.methods[experiment.accepted[0]].scene
    scene = _build(recordings[0], p, first)
    N, declared = scene.mesh.nodes.size, experiment.uncertainty
    finer = [8 * N, 64 * N]
    levels = affordable((_level(None, 1), _level(None, 2)), finer, budget=p.mesh.budget)
    levels = levels or (_level(None, -1),)
    ladder = replace(_MESHES, levels=levels)
    runs = 1 + len(declared.inputs) + declared.draws
    dear = p.mesh.budget and runs * linear_seconds(N) > INPUTS
    return replace(
        experiment,
        uncertainty=replace(declared, mesh=ladder, draws=0 if dear else declared.draws),
        identify=partial(cast("partial[Any]", experiment.identify), ladder=ladder),
    )


# --- the scene ------------------------------------------------------------------------------------


def _build(recording: Recording, p: Compression, model: Pressed) -> Scene:
    mesh, whole = _body(p), p.specimen.mesh is not None or p.outline.topic is not None
    own = modulus_in(p.material.by_method, model_name(model.law, model.plates, model.order))
    own = own or (p.material.E_bonded if model.plates == "bonded" else None)
    scene = Scene(
        mesh,
        Material(
            own or p.material.E or 1.0,
            p.material.nu,
            model.law,
            coefficients=p.material.coefficients.known_to(model.law),
        ),
        (*between(model.plates), *(() if whole else SYMMETRY)),
        pins=_pins(mesh) if whole and model.plates == "slip" else (),
        drives=(STAGE if p.test == "compression" else PULLED,),
        copies=1 if whole else 4,
        cavities=(Cavity("inclusion", p.specimen.fluid),) if p.specimen.fluid else (),
    )
    for _ in range(p.mesh.halvings if p.specimen.mesh else 0):
        scene = refined(scene)
    return of_element(scene, "P2" if model.order == 2 else "MD")


def _body(p: Compression) -> Mesh:
    """The body of the mesh file, or a quarter of the cylinder; all of it where images show it."""
    if p.specimen.mesh is not None:
        return with_surface(_of_file(Path(p.specimen.mesh), p.specimen.mesh_unit, p.mesh.halvings))
    size, grid = p.specimen.size, p.mesh
    if p.outline.topic is not None:
        whole = whole_cylinder(size.diameter, size.height, grid.radial, grid.axial)
        return with_surface(whole)
    return quarter_cylinder(size.diameter, size.height, grid.radial, grid.axial)


def _of_file(path: Path, unit: str | None, halvings: int) -> Mesh:
    """The mesh of a file, or a coarser filling of it."""
    return _coarse(path, unit, modified(path)) if halvings < 0 else read_mesh(path, unit)


@lru_cache(maxsize=2)
def _coarse(path: Path, unit: str | None, changed: int) -> Mesh:
    return coarser(read_mesh(path, unit))


def between(contact: Contact) -> tuple[Support, ...]:
    """The fixed plate below, and what the moving one above holds sideways."""
    if contact == "slip":
        return (Support("lower_plate", (2,)),)
    return (Support("lower_plate", (0, 1, 2)), Support("upper_plate", (0, 1)))


def _pins(mesh: Mesh) -> tuple[Pin, ...]:
    return Support("lower_plate", (2,), rests=True).pins(mesh)


# --- the recording in it --------------------------------------------------------------------------


def _place(recording: Recording, p: Compression, scene: Scene, *, shown: bool) -> Registered:
    if p.outline.topic is not None and not shown:
        raise UsageError(
            "outline.topic: the uncertain inputs of outlines are chosen in the experiment's file; "
            "name the topic there, PressedOutline(topic=...)"
        )
    fit = fit_modulus(recording, p.specimen.size, (p.fit_from, p.fit_to), p.test)
    noise = max(fit.noise, recording.signal("force", "N").sd)
    strains = {"fit": (p.fit_from, p.fit_to), "beyond": (p.fit_to, p.limit)}
    seen = pressed_log(
        recording, fit, p.specimen.size.height, p.limit, strains, noise,
        share=repeats_share(recording), test=p.test,
        toe=toe_in(p.material.by_method, by_model(scene)) if p.material.by_method else None,
    )  # fmt: skip
    for window in seen.selections:
        if window.t is not None and len(window.t) < MIN_SAMPLES:
            raise ComparisonError(
                f"window '{window.label}': {len(window.t)} samples of {recording.name}; "
                f"{MIN_SAMPLES} are needed to check a prediction: widen fit_from, fit_to or limit"
            )
    if p.outline.topic is None:
        return seen
    return with_outline(seen, recording, p.outline, scene.mesh)


def _sets(p: Compression, seen: Registered) -> Mapping[str, Any]:
    """Large strain is solved on a grid of loads to the limit."""
    return {"step": p.limit * p.specimen.size.height / _LOAD_STEPS}


# --- what is uncertain ----------------------------------------------------------------------------


def _level(share: float | None, halvings: int) -> Change:
    """The cylinder with `share` of its cells an edge, or the mesh file with its edges halved."""

    def change(p: Compression) -> Any:
        if p.specimen.mesh is None:
            return scaled(share, "radial", "axial")(p)
        return replace(p, mesh=replace(p.mesh, halvings=p.mesh.halvings + halvings))

    return change


def _cell(p: Compression) -> float:
    """The edge m of a cube as large as a mean cell."""
    if p.specimen.mesh is None:
        cells: int = p.mesh.radial**2 * p.mesh.axial
        return float(p.specimen.size.height / cells ** (1 / 3))
    own = _body(replace(p, mesh=replace(p.mesh, halvings=0)))
    size = float(np.cbrt(cell_volumes(own).mean()))
    return size * size_against(own, _body(p)) if p.mesh.halvings < 0 else size / 2**p.mesh.halvings


# A mesh file has no coarser ones. The corners of bonded plates limit the order.
_MESHES = MeshLadder((_level(0.5, 0), _level(0.75, 1), _level(None, 2)), _cell, CORNER_ORDER)


def _wider_body(p: Compression, z: float) -> Compression:
    """Of a mesh file, whose shape is its own, only the force is changed."""
    size = p.specimen.diameter
    if p.specimen.mesh is not None or size is None:
        return _stiffer_by_area(p, z)
    return replace(p, specimen=replace(p.specimen, diameter=size * (1 + z * p.ranges.diameter)))


def _stiffer_by_area(p: Compression, z: float) -> Compression:
    """A wider specimen is as much stiffer as its area is larger."""
    by = (1 + z * p.ranges.diameter) ** 2
    moduli = {k: getattr(p.material, k) for k in ("E", "E_bonded")}
    stiffer: dict[str, Any] = {k: None if E is None else E * by for k, E in moduli.items()}
    return replace(p, material=replace(p.material, **stiffer))
