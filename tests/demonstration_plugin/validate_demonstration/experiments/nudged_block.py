"""A pulled block: the filter of this plug-in among filters and models of the package."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from validate_demonstration.gent import GentCoefficients
from validate_demonstration.nudging import Nudging

from validate.compare.verdict import Accept
from validate.parameters import quantity
from validate.pipeline.experiment.experiment import Experiment, Progress, Twin
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import Built, TimeSteps, TrackedTwin, Tree
from validate.pipeline.run.method_run import Truth
from validate.recording.types import Recording
from validate.register.registration import Registered
from validate.scene.geometries.specification import Box
from validate.scene.material import Material
from validate.scene.scene import Load, Probe, Scene, Support
from validate.solve.dynamic.implicit import NewtonDynamics
from validate.solve.dynamic.newmark import Newmark
from validate.solve.march import output_frames
from validate.twin.tracker import Origin, Reading, SteppedTwin

LARGE = {
    "material.law": "gent",
    "material.coefficients": GentCoefficients(J_m=30.0),
    "material.stiffness_damping": 0.0,
    "material.mass_damping": "500 1/s",
}


@dataclass(frozen=True)
class NudgedBlock:
    """What the scene does not hold: the traction, the steps, the twin's tracker."""

    traction: float = quantity(600.0, "Pa", "on the top face, upward")
    clock: TimeSteps = TimeSteps(0.002, 100)
    twin: TrackedTwin = TrackedTwin()


def twin_of(tree: Tree) -> SteppedTwin:
    own: NudgedBlock = tree.settings
    width, depth, _ = tree.scene.body.size
    return SteppedTwin(
        Built()(None, tree),
        Newmark,
        lambda t: np.full(len(t), own.traction * width * depth),
        own.clock.dt,
        own.clock.steps,
    )


def record(tree: Tree, progress: Progress) -> Recording:
    width, depth, _ = tree.scene.body.size
    corners = {"f1": (0.0, 0.0), "f2": (width, 0.0), "f3": (0.0, depth), "f4": (width, depth)}
    return twin_of(tree).record(
        Origin("nudged_block", tree.settings.twin.seed, True, {"law": "linear elasticity"}),
        {name: (*corner, 0.0) for name, corner in corners.items()},
        tree.settings.twin.camera,
        lambda run: {"pull": Reading(run.traces["pull.force"].y, "N")},
        progress,
    )


def truth(tree: Tree, seen: Registered) -> Truth:
    twin = twin_of(tree)
    return Truth.of(twin.run(output_frames(tree.settings.clock.steps, 200)), twin.scene)


def place(recording: Recording, tree: Tree, scene: Scene) -> Registered:
    return Registered.following(recording, scene.mesh, "pull", "N")


def sets(tree: Tree, seen: Registered) -> Mapping[str, Any]:
    return {"dt": tree.settings.clock.dt}


EXPERIMENT = Experiment(
    name="nudged_block",
    title="Pulled block, nudged towards the measurement of one node",
    source="the demonstration of plug-ins",
    recording="nudged_block.mcap",
    scene=Scene(
        body=Box(("4 mm", "4 mm", "4 mm"), cells=(2, 2, 2)),
        material=Material("10 kPa", 0.47, rho="1068 kg/m3", stiffness_damping="0.1 s"),
        supports=(Support("z0"),),
        loads=(Load("pull", "z1", "+z"),),
        probes=(
            Probe("node_A", ("2 mm", "2 mm", "4 mm")),
            Probe("node_B", ("2 mm", "2 mm", "2 mm")),
            Probe("corner", ("0 mm", "0 mm", "4 mm")),
        ),
    ),
    settings=NudgedBlock(),
    methods={
        "fem": Method("FEM", Newmark()),
        "nudged": Method("FEM, nudged towards node A", Nudging(), markers=("node_A",)),
        "gent": Method("FEM, Gent's law", NewtonDynamics(), LARGE),
    },
    accepted=("nudged",),
    accept=(Accept("node_B", 0.1e-3, "a tenth of the largest displacement", statistic="rms"),),
    place=place,
    sets=sets,
    axis="z",
    reference="fem",
    twin=Twin(record, truth, kind="same model", seed=NudgedBlock().twin.seed),
)
