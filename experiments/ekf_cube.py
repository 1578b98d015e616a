"""Extended Kalman filter on St. Venant-Kirchhoff elements: the cube of paper 003.

EKF-NFEM: a 100 mm cube, 3760 tetrahedra printed, E 30 kPa, nu .49, a ramp to 0.5 N on its left
face, bottom held, node A measured with white noise. The paper's step of 1 ms is beyond the critical
one on any such mesh: it is shown refused and run; every other method takes a sound step.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from validate.arrays import Floats, Ints
from validate.compare.verdict import Accept
from validate.estimate.node_ekf import NodeEKF
from validate.estimate.reduced_ekf import ReducedEKF
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
from validate.replay.paper_003 import published_cube, tell_cube
from validate.scene.box import box
from validate.scene.mesh import Mesh
from validate.scene.mesh_file import read_mesh
from validate.scene.scene import LawName, Load, Material, Probe, Scene, Support
from validate.solve.central import CentralDifference
from validate.solve.implicit import NewtonDynamics
from validate.solve.march import march, output_frames
from validate.solve.types import Run
from validate.twin.tracked import (
    Camera,
    Origin,
    Reading,
    points_of,
    record_tracked,
    require_noise,
)

HERE = Path(__file__).parent
RECORDING = HERE.parent / "recordings" / "ekf_cube.mcap"
SIDE = 0.1
NODES = {"node_A": (0.0, 0.05, 0.05), "node_B": (0.05, 0.05, 0.1)}
FIDUCIALS = {
    "f1": (0.0, 0.0, 0.0),
    "f2": (0.1, 0.0, 0.0),
    "f3": (0.0, 0.1, 0.0),
    "f4": (0.1, 0.1, 0.0),
}


@dataclass(frozen=True)
class MaterialCard:
    E: float = quantity(30e3, "Pa", "Young's modulus of the models")
    nu: float = quantity(0.49, "1", "Poisson ratio of the models")
    rho: float = quantity(1000.0, "kg/m3", "density")
    mass_damping: float = quantity(0.0, "1/s", "C = mass_damping M (eq 18); the paper drops it")
    law: LawName = quantity("svk", "1", "svk as printed, or neo_hooke")


@dataclass(frozen=True)
class MeshCard:
    file: str = quantity(str(HERE / "meshes" / "cube.npz"), "1", "mesh near the printed counts")
    cells: int | None = quantity(None, "1", "instead of the file: boxes of six cells along an edge")


@dataclass(frozen=True)
class Loading:
    force: float = quantity(0.5, "N", "at the end of the ramp")
    reading: Literal["consistent", "nodal", "per_node"] = quantity(
        "consistent", "1", "the printed force as a total (consistent, nodal) or on every node"
    )


@dataclass(frozen=True)
class Clock:
    dt: float = quantity(2e-4, "s", "time step; the paper prints 1 ms")
    steps: int = quantity(750, "1", "steps: 0.15 s, the 150 steps of the paper's tables")


@dataclass(frozen=True)
class TwinCard:
    """What made the recording; the models do not know it."""

    seed: int = quantity(2020, "1", "seed of the noise")
    noise: float = quantity(1e-9, "m2", "variance of the white noise per component (.001 mm2)")
    stiffness: float = quantity(1.0, "1", "its modulus over that of the models")
    nu: float | None = quantity(None, "1", "its Poisson ratio; none: that of the models")
    every: int = quantity(1, "1", "steps between two looks of the tracker")
    missing: float = quantity(0.0, "1", "share of the looks at which a marker is not seen")

    def __post_init__(self) -> None:
        require_noise(self.noise)


@dataclass(frozen=True)
class Parameters:
    material: MaterialCard = MaterialCard()
    mesh: MeshCard = MeshCard()
    loading: Loading = Loading()
    clock: Clock = Clock()
    twin: TwinCard = TwinCard()
    recording: str = quantity(str(RECORDING), "1", "the recording")


def _mesh(p: Parameters) -> Mesh:
    if p.mesh.cells is None:
        return read_mesh(Path(p.mesh.file))
    return box((SIDE, SIDE, SIDE), (p.mesh.cells,) * 3)


def _scene(p: Parameters, E: float, nu: float) -> Scene:
    m = p.material
    return Scene(
        _mesh(p),
        Material(E, nu, m.law, m.rho, m.mass_damping),
        (Support("z0", (0, 1, 2)),),
        loads=(Load("push", "x0", (1.0, 0.0, 0.0), p.loading.reading),),
        probes=tuple(Probe(name, at) for name, at in NODES.items()),
    )


def build(recording: Recording, parameters: Parameters, model: None) -> Scene:
    return _scene(parameters, parameters.material.E, parameters.material.nu)


# --- the twin ------------------------------------------------------------------------------------


def _true_run(p: Parameters, at: Ints) -> tuple[Scene, Run]:
    m, twin = p.material, p.twin
    scene = _scene(p, twin.stiffness * m.E, m.nu if twin.nu is None else twin.nu)
    scheme = CentralDifference(p.clock.dt)
    t: Floats = p.clock.dt * np.arange(1, p.clock.steps + 1, dtype=np.float64)
    force = p.loading.force * t / t[-1]
    return scene, march("twin", scheme.prepare(build_system(scene)), t, force[:, None], at, 0.0)


def record(parameters: Parameters, progress: Progress) -> Recording:
    p = parameters
    progress("simulate")
    scene, run = _true_run(p, np.array([0]))
    progress("measure")
    declared = {
        "element": f"P1 tetrahedra, {len(scene.mesh.nodes)} nodes, {len(scene.mesh.cells)} cells",
        "law": f"{scene.material.law}, central difference, lumped mass",
        "E_Pa": repr(scene.material.E),
        "nu": repr(scene.material.nu),
    }
    twin = p.twin
    same = twin.stiffness == 1 and twin.nu is None
    return record_tracked(
        Origin("ekf_cube", twin.seed, same, declared),
        points_of(run, scene),
        {k: np.array(v) for k, v in FIDUCIALS.items()},
        Camera(float(np.sqrt(twin.noise)), twin.every, twin.missing, still=10_000),
        {"push": Reading(run.traces["push.force"].y, "N")},
    )


def truth(parameters: Parameters, seen: Registered) -> Truth:
    """The twin's displacements at the steps, and its fields at 200 of them."""
    scene, run = _true_run(parameters, output_frames(parameters.clock.steps, 200))
    return truth_of(run, scene)


# --- the road ------------------------------------------------------------------------------------


def load(parameters: Parameters, folder: Path) -> tuple[Recording, ...]:
    return (read_recording(Path(parameters.recording)),)


def place(recording: Recording, parameters: Parameters, scene: Scene) -> Registered:
    return follow_signal(recording, scene.mesh, "push", "N")


def sets(parameters: Parameters, seen: Registered) -> Mapping[str, Any]:
    return {"dt": parameters.clock.dt}


A = ("node_A",)
# m/s^0.5, set on this twin: the filter's default of 1e-6 lets undamped shapes drift for the whole
# ramp, so that it claims .046 mm at node B, seven times its error there and above the limit.
PROCESS = 2e-7
METHODS = {
    "nfem": Method("NFEM, central difference", CentralDifference()),
    "nfem_printed": Method("NFEM at the printed 1 ms", CentralDifference(), stride=5),
    "nfem_printed_run": Method(
        "NFEM at the printed 1 ms, run all the same",
        CentralDifference(beyond_limit="run"),
        stride=5,
    ),
    "nfem_implicit": Method(
        "NFEM, implicit Newton at 1 ms, 10 steps timed", NewtonDynamics(), steps=10, stride=5
    ),
    "ekf_printed": Method("node-level EKF as printed", NodeEKF(), markers=A),
    "ekf_held": Method(
        "node-level EKF as printed, overflowing variances held", NodeEKF(overflow="hold"), markers=A
    ),
    "ekf_node": Method("node-level EKF, 3 x 3 blocks", NodeEKF(block="node"), markers=A),
    "ekf_companion": Method(
        "node-level EKF of U_t and U_t-dt", NodeEKF(block="companion"), markers=A
    ),
    "reduced_modes": Method(
        "reduced EKF, 20 modes and load bias", ReducedEKF(process=PROCESS), markers=A
    ),
    "reduced_pod": Method(
        "reduced EKF, POD and load bias", ReducedEKF(basis="pod", process=PROCESS), markers=A
    ),
}


def _twin(**changes: Any) -> Change:
    def change(p: Parameters) -> Parameters:
        return replace(p, twin=replace(p.twin, **changes))

    return change


SOUND = ("nfem", "ekf_held", "ekf_companion", "reduced_modes", "reduced_pod")
CASES = (
    Case(
        "stiff_model",
        "the models are 25 % stiffer than the truth",
        _twin(stiffness=0.8),
        methods=SOUND,
    ),
    Case(
        "stiff_model_200Hz",
        "the models are 25 % stiffer than the truth, and A is seen at 200 Hz only",
        _twin(stiffness=0.8, every=25),
        methods=SOUND,
    ),
    Case("nu", "the truth has a Poisson ratio of 0.40", _twin(nu=0.40), methods=SOUND),
)


def coarse_cube(n: int, material: Material) -> Scene:
    return Scene(
        box((SIDE, SIDE, SIDE), (n, n, n)),
        material,
        (Support("z0", (0, 1, 2)),),
        loads=(Load("pull", "x0", (-1.0, 0.0, 0.0)),),
    )


COARSE = Turned(30e3, 0.49, 1000.0, 0.0, 0.0, 4)
CONE = replace(COARSE, E=3 * 22.081e3, nu=0.5, rho=1060.0)
LADDER = Ladder(
    body=StabilityBody(
        "paper 003's cube, coarser (tetrahedra)",
        coarse_cube,
        COARSE,
        (3, 4, 5),
        0.001,
        (
            PaperSetting("003 cube", "paper 003, coarser mesh", COARSE, 0.001),
            PaperSetting("003 cone", "paper 003, the cone's material here", CONE, 1e-4),
        ),
    )
)

EXPERIMENT = Experiment(
    name="ekf_cube",
    title="Extended Kalman filter on a St. Venant-Kirchhoff cube",
    source="paper 003 (EKF-NFEM), section 3.1, Table 1",
    parameters=Parameters(),
    methods=METHODS,
    accepted=("nfem", "reduced_modes"),
    accept=(Accept("node_B", 0.03e-3, "a tenth of the largest displacement there (ours)"),),
    load=load,
    build=build,
    place=place,
    sets=sets,
    axis="x",
    reference="nfem",
    ladder=LADDER,
    cases=CASES,
    exhibits=tell_cube,
    published=published_cube,
    twin=Twin(
        record,
        truth,
        remake=("twin.", "clock.", "loading.force"),
        same_model=True,
        seed=TwinCard().seed,
        notice="The recording is a twin: the same mesh and law as the models, plus white noise.",
    ),
)
