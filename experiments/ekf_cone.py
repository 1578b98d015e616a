"""The Ecoflex cone on its testing machine: paper 003, section 3.4, at 0.15 N and at 15 N.

The recording is a twin of quadratic neo-Hookean elements between bonded plates. Two kinds of
models follow it: bodies moved by the tracked plate, which predict force and bulging, and the
paper's, pushed by the measured force, with and without filters that see the plate's marker.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np

from validate.compare.verdict import Accept
from validate.estimate.node_ekf import NodeEKF
from validate.estimate.reduced_ekf import ReducedEKF
from validate.papers.ekf_nfem.cone_exhibits import tell_cone
from validate.papers.ekf_nfem.cone_mesh import quarter_cone
from validate.papers.ekf_nfem.cone_twin import (
    LoadTable,
    TwinSettings,
    cone_scene,
    load_table,
    marker_places,
    record_cone,
)
from validate.papers.ekf_nfem.figures import CONE_FIGURES
from validate.parameters import quantity, require_ranges
from validate.recording.mcap.read import read_recording
from validate.recording.types import Recording
from validate.register.markers import MarkerObservation, placed_markers
from validate.register.registered import Registered
from validate.register.signals import SignalObservation, driving
from validate.replay.experiment import Case, Experiment, Input, Progress, Twin, Uncertainty
from validate.replay.followed import Truth
from validate.replay.method import Method
from validate.scene.mesh import quadratic
from validate.scene.mesh_file import read_mesh
from validate.scene.scene import Drive, Load, Material, Probe, Scene, Support
from validate.solve.central import CentralDifference
from validate.solve.newton import StaticNewton
from validate.solve.tabulated import Tabulated

HERE = Path(__file__).parent
RECORDING = HERE.parent / "recordings" / "ekf_cone.mcap"
SMALL = HERE.parent / "recordings" / "ekf_cone_small.mcap"
REACH = TwinSettings().force
SHEAR = {"paper": 22_081.0, "cylinders_slip": 31_200.0, "cylinders_bonded": 18_500.0}  # Pa


@dataclass(frozen=True)
class MaterialCard:
    card: Literal["paper", "cylinders_slip", "cylinders_bonded"] = quantity(
        "paper", "1", "shear modulus: 22.081 kPa printed, or real cylinders' 31.2 / 18.5 kPa"
    )
    scale: float = quantity(1.0, "1", "modulus over the card's")
    nu: float = quantity(0.4995, "1", "Poisson ratio of bodies moved by the plate; printed .5")
    nu_explicit: float = quantity(0.49, "1", "Poisson ratio of explicit runs: linear cells lock")
    rho: float = quantity(1060.0, "kg/m3", "density")
    mass_damping: float = quantity(60.0, "1/s", "of explicit runs in scaled time")


@dataclass(frozen=True)
class MeshCard:
    file: str = quantity(str(HERE / "meshes" / "cone.npz"), "1", "mesh of the explicit runs")
    radial: int = quantity(4, "1", "cells from axis to side of the quarter")
    axial: int = quantity(5, "1", "cells along its axis")
    finer_radial: int = quantity(6, "1", "the second mesh, for u_num")
    finer_axial: int = quantity(7, "1", "the second mesh, for u_num")
    grading: float = quantity(2.0, "1", "above 1: smaller cells towards side and plates")
    load_step: float = quantity(0.4e-3, "m", "grid of loads that the quarter is solved at")


@dataclass(frozen=True)
class Clock:
    scale: float = quantity(30.0, "1", "recorded over simulated time of the explicit runs")
    substeps: int = quantity(60, "1", "explicit steps between two samples")


@dataclass(frozen=True)
class Ranges:
    """Standard uncertainties of the inputs, declared before the comparison."""

    modulus: float = quantity(0.02, "1", "relative, of the shear modulus")
    nu: float = quantity(0.0002, "1", "of the Poisson ratio")

    def __post_init__(self) -> None:
        require_ranges(self)


@dataclass(frozen=True)
class Parameters:
    material: MaterialCard = MaterialCard()
    mesh: MeshCard = MeshCard()
    clock: Clock = Clock()
    ranges: Ranges = Ranges()
    twin: TwinSettings = TwinSettings()
    recording: str = quantity(str(RECORDING), "1", "the recording")


@dataclass(frozen=True)
class Model:
    """`plate`: moved by the tracked plate; else pushed by the force, lateral motion held on top."""

    plate: bool = quantity(False, "1", "moved by the plate, not pushed by the force")
    element: Literal["p1", "p1_mean", "p2"] = quantity("p1", "1", "p1_mean: nodal mean dilatation")
    law: Literal["svk", "neo_hooke"] = quantity("svk", "1", "law of the material")


QUASI_STATIC = Tabulated(StaticNewton("none"), 0.4e-3)
A = ("node_A",)
METHODS = {
    "plate_p2": Method("plate moved, P2 neo-Hooke", QUASI_STATIC, Model(True, "p2", "neo_hooke")),
    "plate_mean": Method(
        "plate moved, P1 mean dilatation, neo-Hooke",
        QUASI_STATIC,
        Model(True, "p1_mean", "neo_hooke"),
    ),
    "plate_p1": Method("plate moved, P1 (locks)", QUASI_STATIC, Model(True, "p1", "neo_hooke")),
    "nfem": Method("NFEM, force, explicit", CentralDifference(watch=1), Model()),
    "ekf_held": Method("node-level EKF as printed, held", NodeEKF(overflow="hold"), Model(), A),
    "ekf_companion": Method(
        "node-level EKF of U_t and U_t-dt", NodeEKF(block="companion"), Model(), A
    ),
    "reduced_modes": Method("reduced EKF, 20 modes and load bias", ReducedEKF(), Model(), A),
    "reduced_pod": Method(
        "reduced EKF, POD and load bias", ReducedEKF(basis="pod", shapes=5), Model(), A
    ),
}


def build(recording: Recording, parameters: Parameters, model: Model) -> Scene:
    return _quarter(parameters, model) if model.plate else _whole(parameters, model)


def _material(p: Parameters, model: Model, nu: float, damping: float) -> Material:
    mu = p.material.scale * SHEAR[p.material.card]
    return Material(2 * mu * (1 + nu), nu, model.law, p.material.rho, damping)


def _quarter(p: Parameters, model: Model) -> Scene:
    """A quarter between bonded plates, the upper one driven down."""
    s, grid = p.twin, p.mesh
    mesh = quarter_cone(s.bottom, s.top, s.height, grid.radial, grid.axial, grid.grading)
    scene = cone_scene(s)
    inside = {n: at for n, at in marker_places(s).items() if (at >= 0).all()}
    return replace(
        scene,
        mesh=quadratic(mesh) if model.element == "p2" else mesh,
        material=_material(p, model, p.material.nu, 0.0),
        dilatation="nodal_mean" if model.element == "p1_mean" else "pointwise",
        drives=(Drive("plate", "top", (0.0, 0.0, -1.0)),),
        probes=tuple(Probe(n, tuple(at)) for n, at in inside.items()),
    )


def _whole(p: Parameters, model: Model) -> Scene:
    """The shipped mesh, bonded below, pushed from above without lateral motion there."""
    return Scene(
        read_mesh(Path(p.mesh.file)),
        _material(p, model, p.material.nu_explicit, p.material.mass_damping),
        (Support("bottom", (0, 1, 2)), Support("top", (0, 1))),
        loads=(Load("press", "top", (0.0, 0.0, -1.0)),),
        probes=tuple(Probe(n, tuple(at)) for n, at in marker_places(p.twin).items()),
    )


# --- the twin ------------------------------------------------------------------------------------


def load(parameters: Parameters, folder: Path) -> tuple[Recording, ...]:
    return (read_recording(Path(parameters.recording)),)


def record(parameters: Parameters, progress: Progress) -> Recording:
    return record_cone(parameters.twin, progress)


def truth(parameters: Parameters, seen: Registered) -> Truth:
    """The twin's own displacements at the samples after rest."""
    s = parameters.twin
    n = round(s.duration * s.rate)
    _, u = _table(replace(s, force=max(s.force, REACH))).at(s.force * np.arange(1, n + 1) / n)
    return Truth({name: u[:, j] for j, name in enumerate(marker_places(s))})


@cache
def _table(s: TwinSettings) -> LoadTable:
    """One table for both recordings: it is by far the dearest part of a run."""
    places = np.array(list(marker_places(s).values()))
    return load_table(cone_scene(s), places, s.force, s.loads)


# --- the road ------------------------------------------------------------------------------------


def place(recording: Recording, parameters: Parameters, scene: Scene) -> Registered:
    """The plate's path, or the load cell's ramp, each fitted by least squares; explicit runs in
    scaled time."""
    whole = placed_markers(recording, read_mesh(Path(parameters.mesh.file)))
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
    plate = SignalObservation("plate", "drives", cell.t, y, "m", markers.sd)
    force = replace(cell, role="validates", quantity="force", trace="plate.force")
    return Registered((plate, markers, force))


def _pushed(markers: MarkerObservation, cell: SignalObservation, scale: float) -> Registered:
    """A straight ramp through the load cell's samples, in time divided by `scale`."""
    t = cell.t
    slope = float(t @ cell.y[:, 0] / (t @ t))
    press = replace(cell, t=t / scale, y=(slope * t)[:, None])
    return Registered((press, replace(markers, t=markers.t / scale)), time_scale=scale)


def sets(parameters: Parameters, seen: Registered) -> Mapping[str, Any]:
    p = parameters
    return {
        "dt": float(seen.t[0]), "substeps": p.clock.substeps, "step": p.mesh.load_step,
    }  # fmt: skip


def _finer(p: Parameters) -> Parameters:
    grid = replace(p.mesh, radial=p.mesh.finer_radial, axial=p.mesh.finer_axial)
    return replace(p, mesh=grid)


def _refinement(p: Parameters) -> float:
    """r^p - 1 for quadratic elements, p = 2: corners of bonded plates limit the order."""
    return float((p.mesh.finer_axial / p.mesh.axial) ** 2 - 1)


def _stiffer(p: Parameters) -> Parameters:
    return replace(p, material=replace(p.material, scale=1.02 * p.material.scale))


def _softer_volume(p: Parameters) -> Parameters:
    return replace(p, material=replace(p.material, nu=p.material.nu - 0.0005))


UNCERTAINTY = Uncertainty(
    finer=_finer,
    refinement=_refinement,
    inputs=(
        Input("modulus", _stiffer, lambda p: p.ranges.modulus / 0.02, "shear modulus"),
        Input("nu", _softer_volume, lambda p: p.ranges.nu / 0.0005, "Poisson ratio"),
    ),
    surrogate="plate_p2",
)


def _small(p: Parameters) -> Parameters:
    return replace(p, recording=str(SMALL), twin=replace(p.twin, force=0.15))


EXPERIMENT = Experiment(
    name="ekf_cone",
    title="Ecoflex cone on a testing machine, with and without filters",
    source="paper 003 (EKF-NFEM), section 3.4, Table 3",
    parameters=Parameters(),
    methods=METHODS,
    accepted=("plate_p2",),
    accept=(
        Accept("force", 1.5, "a tenth of the largest force (ours)"),
        Accept("node_B", 0.15e-3, "a tenth of the largest displacement there (ours)"),
        Accept("node_C", 0.15e-3, "a tenth of the largest displacement there (ours)"),
    ),
    load=load,
    build=build,
    place=place,
    sets=sets,
    axis="z",
    reference="nfem",
    cases=(Case("small", "the printed 0.15 N instead of 15 N", _small, shipped=True),),
    uncertainty=UNCERTAINTY,
    exhibits=tell_cone,
    published=CONE_FIGURES,
    twin=Twin(
        record,
        truth,
        seed=TwinSettings().seed,
        notice=(
            "The recording is a twin: it shares its law with the bodies that the plate moves, not "
            "their mesh; explicit runs have another law, element and loading."
        ),
    ),
)
