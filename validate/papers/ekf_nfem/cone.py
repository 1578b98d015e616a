"""The cone of paper 003 on its testing machine: parameters, scenes, truth and registration."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np

from validate.errors import SceneError
from validate.papers.ekf_nfem.cone_mesh import quarter_cone
from validate.papers.ekf_nfem.cone_twin import (
    ConeTwin,
    LoadTable,
    cone_scene,
    load_table,
    marker_places,
    record_cone,
)
from validate.parameters import Ranges, quantity
from validate.recording.types import Recording
from validate.register.fitting import MarkerFit
from validate.register.markers import MarkerObservation, placed_markers
from validate.register.registered import Registered
from validate.register.signals import SignalObservation, driving
from validate.replay.cards import QuarterGrid, quarter_meshes
from validate.replay.experiment import Progress, Uncertainty, vary
from validate.replay.followed import Truth
from validate.scene.material import Material
from validate.scene.mesh import quadratic
from validate.scene.mesh_file import read_mesh
from validate.scene.scene import Dilatation, Drive, Load, Probe, Scene, Support

REACH = ConeTwin().force
SHEAR = {"paper": 22_081.0, "cylinders_slip": 31_200.0, "cylinders_bonded": 18_500.0}  # Pa


_DILATATION: Mapping[str, Dilatation] = {
    "p1": "pointwise", "p1_mean": "nodal_mean", "p2": "pointwise", "p2_mixed": "mixed",
}  # fmt: skip


@dataclass(frozen=True)
class ShearCard:
    card: Literal["paper", "cylinders_slip", "cylinders_bonded"] = quantity(
        "paper", "1", "shear modulus: 22.081 kPa printed, or real cylinders' 31.2 / 18.5 kPa"
    )
    scale: float = quantity(1.0, "1", "modulus over that of the material")
    nu: float = quantity(0.4995, "1", "Poisson ratio of bodies moved by the plate; printed .5")
    nu_explicit: float = quantity(0.49, "1", "Poisson ratio of explicit runs: linear cells lock")
    rho: float = quantity(1060.0, "kg/m3", "density")
    mass_damping: float = quantity(60.0, "1/s", "of explicit runs in scaled time")


@dataclass(frozen=True)
class ConeMesh(QuarterGrid):
    file: str = quantity("", "1", "mesh of the explicit runs")
    load_step: float = quantity(0.4e-3, "m", "grid of loads that the quarter is solved at")


@dataclass(frozen=True)
class ScaledTime:
    scale: float = quantity(30.0, "1", "recorded over simulated time of the explicit runs")
    substeps: int = quantity(60, "1", "explicit steps between two samples")


@dataclass(frozen=True)
class ConeRanges(Ranges):
    modulus: float = quantity(0.02, "1", "relative, of the shear modulus")
    nu: float = quantity(0.0002, "1", "of the Poisson ratio")


@dataclass(frozen=True)
class PressedCone:
    """Parameters; `recording` is a path."""

    material: ShearCard = ShearCard()
    mesh: ConeMesh = ConeMesh(4, 6, finer=1.5)
    clock: ScaledTime = ScaledTime()
    ranges: ConeRanges = ConeRanges()
    twin: ConeTwin = ConeTwin()
    registration: MarkerFit = MarkerFit()
    recording: str = quantity("", "1", "the recording")


@dataclass(frozen=True)
class ConeModel:
    """`plate`: moved by the tracked plate; else pushed by the force, lateral motion held on top."""

    plate: bool = quantity(False, "1", "moved by the plate, not pushed by the force")
    element: Literal["p1", "p1_mean", "p2", "p2_mixed"] = quantity(
        "p1", "1", "p1_mean: nodal mean dilatation; p2_mixed: a pressure in every cell"
    )
    law: Literal["svk", "neo_hooke"] = quantity("svk", "1", "law of the material")


def build(recording: Recording, parameters: PressedCone, model: ConeModel) -> Scene:
    return _quarter(parameters, model) if model.plate else _whole(parameters, model)


def _material(p: PressedCone, model: ConeModel, nu: float, damping: float) -> Material:
    mu = p.material.scale * SHEAR[p.material.card]
    return Material(2 * mu * (1 + nu), nu, model.law, p.material.rho, damping)


def _quarter(p: PressedCone, model: ConeModel) -> Scene:
    """A quarter between bonded plates, the upper one driven down."""
    if p.material.nu == 0.5 and model.element != "p2_mixed":
        raise SceneError(
            f"material.nu = 0.5 with element '{model.element}': it needs nu < 0.5; choose element "
            "p2_mixed (--methods plate_mixed), or nu <= 0.4999"
        )
    s, grid = p.twin, p.mesh
    mesh = quarter_cone(s.bottom, s.top, s.height, grid.radial, grid.axial, grid.grading)
    scene = cone_scene(s)
    inside = {n: at for n, at in marker_places(s).items() if (at >= 0).all()}
    return replace(
        scene,
        body=quadratic(mesh) if model.element in ("p2", "p2_mixed") else mesh,
        material=_material(p, model, p.material.nu, 0.0),
        dilatation=_DILATATION[model.element],
        drives=(Drive("plate", "top", (0.0, 0.0, -1.0)),),
        probes=tuple(Probe(n, tuple(at)) for n, at in inside.items()),
    )


def _whole(p: PressedCone, model: ConeModel) -> Scene:
    """The shipped mesh, bonded below, pushed from above without lateral motion there."""
    return Scene(
        read_mesh(Path(p.mesh.file)),
        _material(p, model, p.material.nu_explicit, p.material.mass_damping),
        (Support("bottom", (0, 1, 2)), Support("top", (0, 1))),
        loads=(Load("press", "top", (0.0, 0.0, -1.0)),),
        probes=tuple(Probe(n, tuple(at)) for n, at in marker_places(p.twin).items()),
    )


def record(parameters: PressedCone, progress: Progress) -> Recording:
    return record_cone(parameters.twin, progress)


def truth(parameters: PressedCone, seen: Registered) -> Truth:
    """The twin's own displacements at the samples after rest."""
    s = parameters.twin
    n = round(s.duration * s.rate)
    _, u = _table(replace(s, force=max(s.force, REACH))).at(s.force * np.arange(1, n + 1) / n)
    return Truth({name: u[:, j] for j, name in enumerate(marker_places(s))})


@cache
def _table(s: ConeTwin) -> LoadTable:
    """One table for both recordings: it is by far the dearest part of a run."""
    places = np.array(list(marker_places(s).values()))
    return load_table(cone_scene(s), places, s.force, s.loads)


def place(recording: Recording, parameters: PressedCone, scene: Scene) -> Registered:
    """The plate's path, or the load cell's ramp, each fitted by least squares; explicit runs in
    scaled time."""
    whole = placed_markers(
        recording, read_mesh(Path(parameters.mesh.file)), how=parameters.registration
    )
    markers = whole.within(scene.mesh)
    cell = driving(recording, "load_cell", "N", after_rest=True)
    if scene.drives:
        return _plate(markers, cell)
    return _pushed(markers, cell, parameters.clock.scale)


def _plate(markers: MarkerObservation, cell: SignalObservation) -> Registered:
    """Compression by a cubic through the plate's marker, from rest; the cell's force validates."""
    j = markers.names.index("node_A")
    down = markers.rest[j, 2] - markers.x[:, j, 2]
    seen = np.isfinite(down)
    powers = markers.t[:, None] ** np.arange(1, 4)
    path = powers @ np.linalg.lstsq(powers[seen], down[seen], rcond=None)[0]
    y = np.interp(cell.t, markers.t, path)[:, None]
    plate = SignalObservation("plate", "drives", cell.t, y, "m", markers.sd, sd_t=markers.sd_t)
    force = replace(cell, role="validates", quantity="force", trace="plate.force")
    return Registered((plate, markers, force))


def _pushed(markers: MarkerObservation, cell: SignalObservation, scale: float) -> Registered:
    """A straight ramp through the load cell's samples, in time divided by `scale`."""
    t = cell.t
    slope = float(t @ cell.y[:, 0] / (t @ t))
    press = replace(cell, t=t / scale, y=(slope * t)[:, None])
    return Registered((press, replace(markers, t=markers.t / scale)), time_scale=scale)


def sets(parameters: PressedCone, seen: Registered) -> Mapping[str, Any]:
    p = parameters
    return {"dt": float(seen.t[0]), "substeps": p.clock.substeps, "step": p.mesh.load_step}


UNCERTAINTY = Uncertainty(
    mesh=quarter_meshes(lambda p: float(p.twin.height)),
    inputs=(
        vary("material.scale", "relative ranges.modulus", "modulus",
              "shear modulus", "assumed; the paper prints none"),
        vary("material.nu", "absolute ranges.nu, below 0.5", "nu",
              "Poisson ratio, below the incompressible limit", "assumed; the paper prints .5"),
    ),
    surrogate="plate_p2",
)  # fmt: skip
