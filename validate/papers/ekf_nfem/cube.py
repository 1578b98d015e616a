"""The cube of paper 003 under a ramp of force: parameters, scene, twin and registration.

100 mm a side, held below, pushed on its left face; node A is measured there, node B is not.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from validate.parameters import quantity
from validate.recording.types import Recording
from validate.register.fitting import MarkerFit
from validate.register.follow import follow_signal
from validate.register.registered import Registered
from validate.replay.cards import TimeSteps, TrackedTwin
from validate.replay.experiment import Progress
from validate.replay.followed import Truth, truth_of
from validate.scene.box import box
from validate.scene.material import LawName, Material
from validate.scene.mesh import Mesh
from validate.scene.mesh_file import read_mesh
from validate.scene.scene import Load, Probe, Scene, Support
from validate.solve.central import CentralDifference
from validate.solve.march import output_frames
from validate.twin.stepped import SteppedTwin
from validate.twin.tracked import Origin, Reading

SIDE = 0.1  # m
NODES = {"node_A": (0.0, 0.05, 0.05), "node_B": (0.05, 0.05, 0.1)}
FIDUCIALS = {
    "f1": (0.0, 0.0, 0.0),
    "f2": (0.1, 0.0, 0.0),
    "f3": (0.0, 0.1, 0.0),
    "f4": (0.1, 0.1, 0.0),
}


@dataclass(frozen=True)
class LargeStrain:
    E: float = quantity(30e3, "Pa", "Young's modulus of the models")
    nu: float = quantity(0.49, "1", "Poisson ratio of the models")
    rho: float = quantity(1000.0, "kg/m3", "density")
    mass_damping: float = quantity(0.0, "1/s", "C = mass_damping M (eq 18); the paper drops it")
    law: LawName = quantity("svk", "1", "svk as printed, or neo_hooke")

    @property
    def material(self) -> Material:
        return Material(self.E, self.nu, self.law, self.rho, self.mass_damping)


@dataclass(frozen=True)
class CubeMesh:
    file: str = quantity("", "1", "mesh near the printed counts")
    cells: int | None = quantity(None, "1", "instead of the file: boxes of six cells along an edge")

    @property
    def mesh(self) -> Mesh:
        if self.cells is None:
            return read_mesh(Path(self.file))
        return box((SIDE, SIDE, SIDE), (self.cells,) * 3)


@dataclass(frozen=True)
class Ramp:
    force: float = quantity(0.5, "N", "at the end of the ramp")
    reading: Literal["consistent", "nodal", "per_node"] = quantity(
        "consistent", "1", "the printed force as a total (consistent, nodal) or on every node"
    )


@dataclass(frozen=True)
class PushedCube:
    """Parameters. The step is sound; the paper prints 1 ms. 0.15 s are the 150 steps of its tables.

    `recording` is a path.
    """

    material: LargeStrain = LargeStrain()
    mesh: CubeMesh = CubeMesh()
    loading: Ramp = Ramp()
    clock: TimeSteps = TimeSteps(2e-4, 750)
    twin: TrackedTwin = TrackedTwin(seed=2020)
    registration: MarkerFit = MarkerFit()
    recording: str = quantity("", "1", "the recording")


def build(recording: Recording, p: PushedCube, model: None) -> Scene:
    return _scene(p, p.material.material)


def _scene(p: PushedCube, material: Material) -> Scene:
    return Scene(
        p.mesh.mesh,
        material,
        (Support("z0", (0, 1, 2)),),
        loads=(Load("push", "x0", (1.0, 0.0, 0.0), p.loading.reading),),
        probes=tuple(Probe(name, at) for name, at in NODES.items()),
    )


def place(recording: Recording, p: PushedCube, scene: Scene) -> Registered:
    return follow_signal(recording, scene.mesh, "push", "N", p.registration)


def sets(p: PushedCube, seen: Registered) -> Mapping[str, Any]:
    return {"dt": p.clock.dt}


def twin_of(p: PushedCube) -> SteppedTwin:
    return SteppedTwin(
        _scene(p, p.twin.true(p.material.material)),
        CentralDifference,
        lambda t: p.loading.force * t / t[-1],
        p.clock.dt,
        p.clock.steps,
    )


def record(p: PushedCube, progress: Progress) -> Recording:
    made, twin = twin_of(p), p.twin
    mesh = made.scene.mesh
    declared = {
        "element": f"P1 tetrahedra, {len(mesh.nodes)} nodes, {len(mesh.cells)} cells",
        "law": f"{made.scene.material.law}, central difference, lumped mass",
    }
    same = twin.stiffness == 1 and twin.nu is None
    return made.record(
        Origin("ekf_cube", twin.seed, same, declared),
        FIDUCIALS,
        twin.camera,
        lambda run: {"push": Reading(run.traces["push.force"].y, "N")},
        progress,
    )


def truth(p: PushedCube, seen: Registered) -> Truth:
    """The twin's displacements at the steps, and its fields at 200 of them."""
    made = twin_of(p)
    return truth_of(made.run(output_frames(p.clock.steps, 200)), made.scene)
