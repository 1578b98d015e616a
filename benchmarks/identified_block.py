"""A block of 5184 unknowns between plates it sticks to: what `benchmarks/identify.py` times.

Force and the bulge of two points are recorded with noise from the model itself; modulus, Poisson
ratio and the second Mooney-Rivlin coefficient stand open.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from validate.compare.verdict import Accept
from validate.fem.system import build as build_system
from validate.parameters import quantity, with_given
from validate.pipeline.calibration.calibration import Calibrates, Calibration, Free
from validate.pipeline.experiment.experiment import Experiment, Twin
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import Built, Tree
from validate.recording.types import Recording
from validate.register.markers.markers import MarkerObservation
from validate.register.registration import Registered
from validate.register.signals import SignalObservation, holds_at
from validate.scene.geometries.specification import Box
from validate.scene.material import Material
from validate.scene.scene import Drive, Probe, Scene, Support
from validate.solve.march import march, output_frames
from validate.solve.static.newton import StaticNewton
from validate.twin.tracker import Camera, Origin, Reading, points_of

SIDE, CELLS = 0.03, 11
HOLDS = (2e-3, 4e-3, 6e-3)  # m
FIDUCIALS = {"f1": (0.0, 0.0, 0.0), "f2": (SIDE, 0.0, 0.0), "f3": (0.0, SIDE, 0.0)}
BULGES = {"right": (SIDE, SIDE / 2, SIDE / 2), "left": (0.0, SIDE / 2, SIDE / 3)}


@dataclass(frozen=True)
class Second:
    """What the law has beyond E and nu, as a parameter that may stand open."""

    second: float | None = quantity(None, "Pa", "Mooney-Rivlin's C01; none: identified")


TRUE = {"material.E": 20e3, "material.nu": 0.42, "second": 1e3}
METHODS = {
    "newton": Method("Mooney-Rivlin, static", StaticNewton("none"), {"material.C01": "as second"})
}


def record(tree: Tree, progress: Callable[[str], None]) -> Recording:
    true = Built()(None, with_given(tree, TRUE), METHODS["newton"].scene)
    stepper = StaticNewton("none").prepare(build_system(true))
    y, t = np.array(HOLDS)[:, None], np.arange(1.0, len(HOLDS) + 1)
    run = march("twin", stepper, t, y, output_frames(len(HOLDS), 3), 0.0)
    readings = {
        "stage": Reading(np.array(HOLDS), "m"),
        "cell": Reading(run.traces["stage.force"].y, "N", 0.02),
    }
    at = {name: np.array(x) for name, x in FIDUCIALS.items()}
    camera = Camera(2e-5, 1, still=10_000)
    return Origin("block", 7, True).record(points_of(run, true), at, camera, readings)


def place(recording: Recording, p: Any, its: Scene) -> Registered:
    stage = SignalObservation.driving(recording, "stage", "m")
    cell = SignalObservation.validating(
        recording, "cell", "N", quantity="force", trace="stage.force"
    )
    rest, *holds = holds_at(stage, stage.t, HOLDS, 1e-6)
    return Registered(
        (stage, MarkerObservation.placed(recording, its.mesh), cell), tuple(holds), rest
    )


def load(tree: Tree, folder: Path) -> tuple[Recording, ...]:
    return (record(tree, print),)


EXPERIMENT = Experiment(
    name="identified_block",
    title="Block between plates it sticks to",
    source="this file",
    scene=Scene(
        body=Box((SIDE,) * 3, cells=(CELLS,) * 3),
        material=Material(None, None, "mooney_rivlin", 1000.0),
        supports=(Support("z0"), Support("z1", (0, 1))),
        drives=(Drive("stage", "z1", "-z"),),
        probes=tuple(Probe(name, at) for name, at in BULGES.items()),
    ),
    settings=Second(),
    methods=METHODS,
    accepted=("newton",),
    accept=(Accept("left", 1e-4, "ours"),),
    load=load,
    place=place,
    calibrations=(
        Calibration(
            "newton",
            (
                Free("material.E", 2e3, 2e5, "assumed"),
                Free("material.nu", 0.2, 0.49, "assumed", "the bulge"),
                Free("second", 0.0, 2e3, "assumed", "force at larger strain"),
            ),
            (Calibrates(("force", "right")),),
        ),
    ),
    twin=Twin(record, remake=(), kind="same model"),
)
