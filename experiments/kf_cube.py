"""Kalman filter finite elements on a small block under traction: paper 001 as printed.

KF-FEM: 4 x 4 x 7 mm, 200 nodes, 672 tetrahedra, 3 kN/m2 on top, one node measured with white noise.
The paper measures its own model (same model); what that cannot show stands beside it: truths that
the models do not know, nodes that nobody measured, other filters, other solvers.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from validate.arrays import Floats, Ints
from validate.compare.verdict import Accept
from validate.estimate.filterpy_guest import Guest
from validate.estimate.kf_fem import KfFem
from validate.estimate.load_scale import LoadScale
from validate.estimate.modal_kf import ModalKf
from validate.estimate.reduced_kf import ReducedKf
from validate.fem.system import build as build_system
from validate.parameters import quantity
from validate.recording.mcap.read import read_recording
from validate.recording.types import Recording
from validate.register.follow import follow_signal
from validate.register.registered import Registered
from validate.replay.experiment import Case, Change, Experiment, Progress, Twin
from validate.replay.followed import Truth, truth_of
from validate.replay.ladder import Ladder, PaperSetting, StabilityBody, Turned
from validate.replay.method import Method
from validate.replay.paper_001 import published, tell
from validate.scene.box import box, centroids
from validate.scene.mesh import Mesh
from validate.scene.scene import Load, Material, Probe, Region, Scene, Support
from validate.solve.excitation import StartName
from validate.solve.march import march, output_frames
from validate.solve.modal import Modal
from validate.solve.newmark import Newmark
from validate.solve.types import Run
from validate.twin.tracked import (
    Camera,
    Origin,
    Reading,
    points_of,
    record_tracked,
    require_noise,
)

RECORDING = Path(__file__).parents[1] / "recordings" / "kf_cube.mcap"
NODES = {"node_A": (2, 2, 7), "node_B": (2, 2, 5), "corner": (0, 0, 7)}  # in cells
FIDUCIALS = {"f1": (0, 0, 0), "f2": (4, 0, 0), "f3": (0, 4, 0), "f4": (4, 4, 0)}


@dataclass(frozen=True)
class MaterialCard:
    E: float = quantity(10e3, "Pa", "Young's modulus of the models")
    nu: float = quantity(0.47, "1", "Poisson ratio of the models")
    rho: float = quantity(1068.0, "kg/m3", "density")
    mass_damping: float = quantity(0.0, "1/s", "Rayleigh alpha_0")
    stiffness_damping: float = quantity(0.1, "s", "Rayleigh alpha_1")


@dataclass(frozen=True)
class Body:
    cell: float = quantity(1e-3, "m", "edge of a cell")
    across: int = quantity(4, "1", "cells across")
    high: int = quantity(7, "1", "cells high")


@dataclass(frozen=True)
class Loading:
    traction: float = quantity(3000.0, "Pa", "on the top face, upward")
    spread: Literal["consistent", "nodal"] = quantity("consistent", "1", "nodal: equal forces")
    a0: StartName = quantity("equilibrium", "1", "first acceleration: M^-1 f, or zero")
    off: float = quantity(0.0, "s", "time at which the traction is released; 0: never")


@dataclass(frozen=True)
class Clock:
    dt: float = quantity(0.002, "s", "time step")
    steps: int = quantity(500, "1", "steps")


@dataclass(frozen=True)
class TwinCard:
    """What made the recording; the models do not know it."""

    seed: int = quantity(1, "1", "seed of the noise")
    noise: float = quantity(1e-9, "m2", "variance of the white noise per component (.001 mm2)")
    stiffness: float = quantity(1.0, "1", "its modulus over that of the models")
    nu: float | None = quantity(None, "1", "its Poisson ratio; none: that of the models")
    inside: Literal["nothing", "layer", "inclusion"] = quantity(
        "nothing", "1", "stiff layer at mid-height, or stiff inclusion"
    )
    contrast: float = quantity(5.0, "1", "modulus of layer or inclusion over the rest")
    finer: int = quantity(1, "1", "its steps in one of the models'")
    every: int = quantity(1, "1", "steps between two looks of the tracker")
    missing: float = quantity(0.0, "1", "share of the looks at which a marker is not seen")

    def __post_init__(self) -> None:
        require_noise(self.noise)


@dataclass(frozen=True)
class Parameters:
    material: MaterialCard = MaterialCard()
    body: Body = Body()
    loading: Loading = Loading()
    clock: Clock = Clock()
    twin: TwinCard = TwinCard()
    recording: str = quantity(str(RECORDING), "1", "the recording")


def _mesh(p: Parameters) -> Mesh:
    b = p.body
    cells = (b.across, b.across, b.high)
    return box(tuple(n * b.cell for n in cells), cells)


def _places(p: Parameters, which: dict[str, tuple[int, int, int]]) -> dict[str, tuple[float, ...]]:
    """Points m from places on the 4 x 4 x 7 grid, whatever cells the block has."""
    b = p.body
    unit = (b.across / 4 * b.cell, b.across / 4 * b.cell, b.high / 7 * b.cell)
    return {k: tuple(i * u for i, u in zip(ijk, unit, strict=True)) for k, ijk in which.items()}


def _scene(p: Parameters, E: float, nu: float, regions: tuple[Region, ...] = ()) -> Scene:
    m = p.material
    material = Material(E, nu, "linear", m.rho, m.mass_damping, m.stiffness_damping)
    return Scene(
        _mesh(p),
        material,
        (Support("z0", (0, 1, 2)),),
        loads=(Load("pull", "z1", (0.0, 0.0, 1.0), p.loading.spread),),
        probes=tuple(Probe(name, at) for name, at in _places(p, NODES).items()),
        regions=regions,
    )


def build(recording: Recording, parameters: Parameters, model: None) -> Scene:
    m = parameters.material
    return _scene(parameters, m.E, m.nu)


# --- the twin ------------------------------------------------------------------------------------


def _true_scene(p: Parameters) -> Scene:
    twin, m = p.twin, p.material
    E, nu = twin.stiffness * m.E, m.nu if twin.nu is None else twin.nu
    scene = _scene(p, E, nu)
    if twin.inside == "nothing":
        return scene
    stiff = replace(scene.material, E=twin.contrast * E)
    cells = _stiff_cells(p, scene.mesh)
    return replace(scene, regions=(Region(twin.inside, cells, stiff),))


def _stiff_cells(p: Parameters, mesh: Mesh) -> Ints:
    """The middle two rows of seven, or the upper middle half of the block."""
    share = centroids(mesh) / mesh.nodes.max(axis=0)
    layer = (share[:, 2] > 2.99 / 7) & (share[:, 2] < 5.01 / 7)
    if p.twin.inside == "layer":
        return np.flatnonzero(layer)
    middle = np.abs(share[:, :2] - 0.5).max(axis=1) < 0.2501
    return np.flatnonzero(layer & middle)


def _inputs(p: Parameters) -> tuple[Floats, Floats]:
    """Times (nt,) s of the twin's steps' ends and the traction's total force (nt,) N there."""
    n, dt = p.clock.steps * p.twin.finer, p.clock.dt / p.twin.finer
    t: Floats = dt * np.arange(1, n + 1, dtype=np.float64)
    side = p.body.across * p.body.cell
    on = np.where((p.loading.off > 0) & (t > p.loading.off + dt / 2), 0.0, 1.0)
    return t, p.loading.traction * side**2 * on


def _true_run(p: Parameters, at: Ints) -> tuple[Scene, Run]:
    """The twin's run, at the ends of the models' steps."""
    scene, (t, force), f = _true_scene(p), _inputs(p), p.twin.finer
    stepper = Newmark(p.clock.dt / f, a0=p.loading.a0).prepare(build_system(scene))
    run = march("twin", stepper, t, force[:, None], (at + 1) * f - 1, 0.0)
    traces = {name: replace(trace, y=trace.y[f - 1 :: f]) for name, trace in run.traces.items()}
    return scene, replace(run, t=run.t[f - 1 :: f], at=at, traces=traces)


def record(parameters: Parameters, progress: Progress) -> Recording:
    p = parameters
    progress("simulate")
    scene, run = _true_run(p, np.array([0]))
    progress("measure")
    twin = p.twin
    declared = {
        "element": f"P1 tetrahedra, {len(scene.mesh.nodes)} nodes, {len(scene.mesh.cells)} cells",
        "law": "linear elasticity, Rayleigh damping, average acceleration",
        "E_Pa": repr(scene.material.E),
        "nu": repr(scene.material.nu),
        "inside": twin.inside,
    }
    fiducials = {k: np.array(v) for k, v in _places(p, FIDUCIALS).items()}
    same = twin == replace(TwinCard(), seed=twin.seed, noise=twin.noise)
    return record_tracked(
        Origin("kf_cube", twin.seed, same, declared),
        points_of(run, scene),
        fiducials,
        Camera(float(np.sqrt(twin.noise)), twin.every, twin.missing, still=10_000),
        {"pull": Reading(run.traces["pull.force"].y, "N")},
    )


def truth(parameters: Parameters, seen: Registered) -> Truth:
    """The twin's displacements at the steps, and its fields at 200 of them."""
    scene, run = _true_run(parameters, output_frames(parameters.clock.steps, 200))
    return truth_of(run, scene)


# --- the road ------------------------------------------------------------------------------------


def load(parameters: Parameters, folder: Path) -> tuple[Recording, ...]:
    return (read_recording(Path(parameters.recording)),)


def place(recording: Recording, parameters: Parameters, scene: Scene) -> Registered:
    return follow_signal(recording, scene.mesh, "pull", "N")


def sets(parameters: Parameters, seen: Registered) -> Mapping[str, Any]:
    return {"dt": parameters.clock.dt, "a0": parameters.loading.a0}


MM2 = 1e-6
PRINTED = 1e-3 * MM2  # the paper's .001, read as mm2
A = ("node_A",)
METHODS = {
    "fem": Method("FEM, factorised once", Newmark()),
    "fem_gauss": Method(
        "FEM, Gaussian elimination anew every step", Newmark(solver="gaussian_elimination"), steps=5
    ),
    "fem_dense": Method(
        "FEM, dense solve anew every step", Newmark(solver="dense_solve"), steps=50
    ),
    "fem_sparse": Method("FEM, sparse LU anew every step", Newmark(solver="sparse_lu"), steps=50),
    "fem_inverse": Method("FEM, dense inverse", Newmark(solver="dense_inverse"), steps=200),
    "fem_modal": Method("FEM, all 525 modes", Modal(propagate="average")),
    "kf_dense": Method(
        "KF-FEM as printed, dense every step",
        KfFem(Q=PRINTED, R=PRINTED, P0=PRINTED, gains="every_step"),
        markers=A,
        steps=60,
    ),
    "kf_printed": Method(
        "KF-FEM as printed, gains shared", KfFem(Q=PRINTED, R=PRINTED, P0=PRINTED), markers=A
    ),
    "kf_posterior": Method(
        "KF-FEM, v and a from the posterior",
        KfFem(Q=PRINTED, R=PRINTED, P0=PRINTED, recursion="posterior"),
        markers=A,
    ),
    "kf_modal": Method(
        "KF-FEM in modes, exact every step",
        ModalKf(Q=PRINTED, R=PRINTED, P0=PRINTED),
        markers=A,
        steps=200,
    ),
    "kf_load": Method(
        "KF-FEM, Q along the load",
        KfFem(Q=PRINTED, R=PRINTED, P0=PRINTED, structure="load"),
        markers=A,
    ),
    "load_scale": Method("two states: amplitude and load scale", LoadScale(), markers=A),
    "kf_reduced": Method(
        "20 modes and load bias, steady gain", ReducedKf(gains="steady"), markers=A
    ),
    "filterpy": Method("filterpy's KalmanFilter, 5 modes", Guest(), markers=A),
}


def _twin(**changes: Any) -> Change:
    def change(p: Parameters) -> Parameters:
        return replace(p, twin=replace(p.twin, **changes))

    return change


RIVALS = ("fem", "kf_printed", "kf_load", "load_scale", "kf_reduced")


def _case(name: str, doc: str, **changes: Any) -> Case:
    return Case(name, doc, _twin(**changes), methods=RIVALS)


CASES = (
    _case("stiff_model", "the models are 20 % stiffer than the truth", stiffness=1 / 1.2),
    _case("soft_model", "the models are 20 % softer than the truth", stiffness=1 / 0.8),
    _case("layer", "the truth has a stiff layer (five times) at mid-height", inside="layer"),
    _case("inclusion", "the truth has a stiff inclusion (five times)", inside="inclusion"),
    _case("nu", "the truth has a Poisson ratio of 0.30", nu=0.30),
    _case("sparse", "models are 20 % stiffer, seen every 10th step, a fifth missing",
          stiffness=1 / 1.2, every=10, missing=0.2),
)  # fmt: skip


def block(n: int, material: Material) -> Scene:
    """The block, n cells across its 4 mm."""
    return Scene(
        box((0.004, 0.004, 0.007), (n, n, round(7 * n / 4))),
        material,
        (Support("z0", (0, 1, 2)),),
        loads=(Load("pull", "z1", (0.0, 0.0, 1.0)),),
    )


PRINTED_BODY = Turned(10e3, 0.47, 1068.0, 0.0, 0.1, 4)
LADDER = Ladder(
    body=StabilityBody(
        "paper 001's block (tetrahedra)",
        block,
        PRINTED_BODY,
        (2, 3, 4),
        0.002,
        (PaperSetting("001", "paper 001, section 4", PRINTED_BODY, 0.002),),
    )
)

EXPERIMENT = Experiment(
    name="kf_cube",
    title="Kalman filter finite elements on a block under traction",
    source="paper 001 (KF-FEM), section 3, Table 1",
    parameters=Parameters(),
    methods=METHODS,
    accepted=("fem", "kf_reduced"),
    accept=(
        Accept("node_B", 0.1e-3, "a twelfth of the largest displacement there (ours)"),
        Accept("corner", 0.2e-3, "a tenth of the largest displacement there (ours)"),
    ),
    load=load,
    build=build,
    place=place,
    sets=sets,
    axis="z",
    reference="fem",
    ladder=LADDER,
    cases=CASES,
    exhibits=tell,
    published=published,
    captions={
        "displacement_node_A": "As Figs. 3 and 4 of paper 001: what was measured, FEM and KF-FEM.",
        "displacement_node_B": "As Fig. 5 of paper 001: a node 2 mm below, given to no filter.",
    },
    twin=Twin(
        record,
        truth,
        remake=("twin.", "clock.", "body.", "loading.traction", "loading.off"),
        same_model=True,
        seed=TwinCard().seed,
        notice="The recording is a twin: the same mesh and law as the models, plus white noise.",
    ),
)
