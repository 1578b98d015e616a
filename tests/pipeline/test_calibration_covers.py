"""Intervals of a modulus and a Poisson ratio of a finite-element body, over 60 whole twins."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from calibrating import NU, OPEN, OPENED, E, known, placed
from tiny import FIDUCIALS, LOADS, STEPS

from validate.fem.system import build
from validate.identify.identification import InTurn, identify
from validate.pipeline.calibration.calibrated import problem_of
from validate.pipeline.calibration.calibration import Calibrates, Calibration
from validate.pipeline.experiment.tree import Tree
from validate.recording.types import Recording
from validate.register.registration import Registered
from validate.scene.scene import Scene
from validate.solve.fluid.cavities import NoFluid
from validate.solve.march import march, output_frames
from validate.solve.types import Run
from validate.twin.tracker import Camera, Origin, Reading, points_of

TRUTH = (10e3, 0.3)
STAGE = np.linspace(0, LOADS[-1], STEPS + 1)[1:]
BOTH = replace(
    OPEN,
    parameters=known(nu=None),
    calibrations=(Calibration("fem", (E, NU), (Calibrates(("force", "node_B")),)),),
    place=lambda recording, tree, its: once(recording, tree, its),
)


class Once:
    """Registers a recording once: where its markers lie depends on no modulus."""

    def __init__(self) -> None:
        self.found: tuple[Recording, Registered] | None = None

    def __call__(self, recording: Recording, tree: Tree, its: Scene) -> Registered:
        if self.found is None or self.found[0] is not recording:
            self.found = recording, placed(recording, tree, its)
        return self.found[1]


once = Once()


def moved(true: Scene) -> Run:
    t = np.arange(1.0, STEPS + 1)
    stepper = NoFluid().prepare(build(true))
    return march("twin", stepper, t, STAGE[:, None], output_frames(STEPS, 2), 0.0)


def recorded(true: Scene, run: Run, seed: int) -> Recording:
    """Noise of the cell and the camera, and of the markers it is registered by."""
    force = Reading(run.traces["stage.force"].y, "N", 1e-4)
    at = {name: np.array(x) for name, x in FIDUCIALS.items()}
    camera, readings = Camera(1e-6, 1, still=10_000), {"stage": Reading(STAGE, "m"), "cell": force}
    return Origin("moved", seed, True).record(points_of(run, true), at, camera, readings)


@pytest.mark.slow
def test_intervals_hold_the_truth_of_sixty_twins_of_a_body() -> None:
    """Force on the stage and a marker's motion; 190 and 194 of 200 in an earlier run.

    95 % of 60 are 57 with a standard deviation of 1.7: 54 or fewer have a probability of 8 %.
    Intervals of half the width would hold 40, of twice the width 60.
    """
    (shipped,) = OPEN.load(OPENED, Path())
    true = OPEN.build(shipped, known(E=TRUTH[0], nu=TRUTH[1]), None)
    assert isinstance(true, Scene)
    run, held = moved(true), np.zeros(2)
    first = recorded(true, run, 0)
    problem = problem_of(BOTH, 0, (E, NU), BOTH.parameters, BOTH.methods, (first,))
    for seed in range(60):
        part = replace(problem.parts[0], recordings=(recorded(true, run, seed),))
        drawn = replace(problem, parts=(part,))
        found = identify(drawn.space, InTurn(drawn.residual), starts=1)
        held += [e.low <= v <= e.high for e, v in zip(found.estimates, TRUTH, strict=True)]
    assert (held >= 54).all()
    assert (held < 60).all()
