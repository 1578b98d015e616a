"""The liver of paper 003 under a ramp of force: parameters, scene, twin and registration.

Held at the top of its left end, pulled upward at its right lobe; node A is measured among the
loaded ones, node B is free and not measured.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import RecordingError
from validate.papers.ekf_nfem.cube import LargeStrain, Ramp
from validate.papers.ekf_nfem.liver_body import LiverBody
from validate.parameters import quantity
from validate.recording.readers import read_recording
from validate.recording.types import Recording
from validate.register.fitting import MarkerFit
from validate.register.follow import follow_signal
from validate.register.registered import Registered
from validate.replay.cards import TimeSteps, TrackedTwin
from validate.replay.experiment import Progress
from validate.replay.followed import Truth, truth_of
from validate.replay.remade import stamped
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.refine import refined
from validate.scene.scene import Load, Probe, Scene, Support
from validate.solve.central import CentralDifference
from validate.solve.march import output_frames
from validate.twin.stepped import SteppedTwin
from validate.twin.tracked import Origin, Reading

SHIPPED = "ekf_liver.mcap"  # of the generated body
_FIDUCIALS = 4


@dataclass(frozen=True)
class LiverTwin(TrackedTwin):
    halved: int = quantity(
        0, "1", "number of divisions of its cells into eight; 0 is the mesh of the models"
    )
    finer: int = quantity(1, "1", "its steps in one of the models'")


@dataclass(frozen=True)
class PulledLiver:
    """Parameters. The step is the printed one; 0.15 s are those of the cube, as "the other
    parameters" are. `recording` is a path."""

    material: LargeStrain = LargeStrain()
    body: LiverBody = LiverBody()
    loading: Ramp = Ramp()
    clock: TimeSteps = TimeSteps(1e-4, 1500)
    twin: LiverTwin = LiverTwin(seed=2021)
    registration: MarkerFit = MarkerFit()
    recording: str = quantity(
        "", "1", "the recording; none: the shipped one of the generated body, else made in memory"
    )


def liver_scene(mesh: Mesh, material: Material, ramp: Ramp = Ramp()) -> Scene:
    """The body (`LiverBody.mesh`) held, loaded and watched at A and B; of one input, "pull" N."""
    return Scene(
        mesh,
        material,
        (Support("held", (0, 1, 2)),),
        loads=(Load("pull", "loaded", (0.0, 0.0, 1.0), ramp.reading),),
        probes=tuple(Probe(name, _place(mesh, at)) for name, at in watched(mesh).items()),
    )


def watched(mesh: Mesh) -> dict[str, int]:
    """Nodes A, of the loaded ones the nearest to their middle, and B, of the free ones of the
    surface the nearest to the middle of the body's top."""
    x, loaded = mesh.nodes, mesh.facet_nodes("loaded")
    taken = np.union1d(loaded, mesh.facet_nodes("held"))
    free = np.setdiff1d(np.unique(mesh.surface), taken)
    low, high = x.min(axis=0), x.max(axis=0)
    top = np.array([*(low + high)[:2] / 2, high[2]])
    return {
        "node_A": _nearest(x, loaded, x[loaded].mean(axis=0)),
        "node_B": _nearest(x, free, top),
    }


def fiducials(mesh: Mesh) -> dict[str, tuple[float, ...]]:
    """Four held nodes, each as far as can be from those before it (m)."""
    x = mesh.nodes[mesh.facet_nodes("held")]
    chosen = [int(np.argmax(x[:, 0]))]
    while len(chosen) < _FIDUCIALS:
        away = np.linalg.norm(x[:, None] - x[chosen], axis=2).min(axis=1)
        chosen.append(int(np.argmax(away)))
    return {f"f{i}": tuple(x[at].tolist()) for i, at in enumerate(chosen, start=1)}


def _nearest(x: Floats, nodes: Ints, point: Floats) -> int:
    return int(nodes[np.argmin(np.linalg.norm(x[nodes] - point, axis=1))])


def _place(mesh: Mesh, node: int) -> tuple[float, ...]:
    return tuple(mesh.nodes[node].tolist())


def load(p: PulledLiver, folder: Path) -> tuple[Recording, ...]:
    """A recording of the body that is here. Raises `RecordingError` for one of the other body."""
    which = p.body.which
    if which == "data" and not p.recording:
        return (stamped(record(p, lambda _: None), p),)
    path = Path(p.recording) if p.recording else folder.parent / "recordings" / SHIPPED
    recording = read_recording(path)
    of = recording.record("provenance").get("body")
    if of != which:
        raise RecordingError(
            f"{path.name} is of body '{of}', not of '{which}'; pass --set body.body={of}"
        )
    return (recording,)


def build(recording: Recording, p: PulledLiver, model: None) -> Scene:
    return _scene(p, p.material.material)


def _scene(p: PulledLiver, material: Material) -> Scene:
    return liver_scene(p.body.mesh(p.body.which), material, p.loading)


def place(recording: Recording, p: PulledLiver, scene: Scene) -> Registered:
    return follow_signal(recording, scene.mesh, "pull", "N", p.registration)


def sets(p: PulledLiver, seen: Registered) -> Mapping[str, Any]:
    return {"dt": p.clock.dt}


def twin_of(p: PulledLiver) -> SteppedTwin:
    scene = _scene(p, p.twin.true(p.material.material))
    for _ in range(p.twin.halved):
        scene = refined(scene)
    return SteppedTwin(
        scene,
        CentralDifference,
        lambda t: p.loading.force * t / t[-1],
        p.clock.dt,
        p.clock.steps,
        p.twin.finer,
    )


def same_model(p: PulledLiver) -> bool:
    """Whether the twin is the models' own."""
    return p.twin == replace(p.twin, stiffness=1.0, nu=None, halved=0, finer=1)


def record(p: PulledLiver, progress: Progress) -> Recording:
    made, twin = twin_of(p), p.twin
    mesh = made.scene.mesh
    declared = {
        "body": p.body.which,
        "element": f"P1 tetrahedra, {len(mesh.nodes)} nodes, {len(mesh.cells)} cells",
        "law": f"{made.scene.material.law}, central difference, lumped mass",
    }
    return made.record(
        Origin("ekf_liver", twin.seed, same_model(p), declared),
        fiducials(mesh),
        twin.camera,
        lambda run: {"pull": Reading(run.traces["pull.force"].y, "N")},
        progress,
    )


def truth(p: PulledLiver, seen: Registered) -> Truth:
    """The twin's displacements at the steps; its fields at 200 of them where it has our mesh."""
    made = twin_of(p)
    found = truth_of(made.run(output_frames(p.clock.steps, 200)), made.scene)
    return found if p.twin.halved == 0 else Truth(found.probes)
