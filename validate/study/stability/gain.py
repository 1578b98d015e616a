"""Stability of a pressure loop: critical gain of a static experiment with a fluid.

Nothing steps in time there, but paper 000's loop P <- P + Kp (1 - V/V0) (eqs 9 and 10) is a fixed
point that settles where every |1 - Kp dV/dP / V0| < 1. Predicted: 2 / (dV/dP / V0) at the pressure
that keeps the volume. Measured: the gain beyond which the loop itself ends without having settled.
"""

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from validate.arrays import Floats
from validate.engine.cell import Plan, Where
from validate.engine.execution import CELLS, Finished, Report, finish
from validate.engine.store import key_of
from validate.errors import ComparisonError
from validate.fem.system import Responses, build, responses
from validate.pipeline.bodies.own_body import own_body, with_law
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.run.job import Job, job_of
from validate.pipeline.run.named_run import study_folder
from validate.solve.fluid.cavities import ExactPressure
from validate.solve.fluid.pressure_curve import tuned_gain
from validate.solve.fluid.pressure_loop import PressureLoop
from validate.study.stability.cell import measured_limit

LOADS = (0.25, 0.5, 0.75, 1.0)  # of the largest recorded input
PER_DECADE, DECADES = 8, 3  # of gains, around the tuned one
TOLERANCE = 0.02  # of the predicted limit
# Near its limit the loop settles slowly: by .7 % below it 1e-6 takes a thousand updates.
_LOOP = PressureLoop(1.0, tolerance=1e-6, max_updates=1000, warm_start=False)


@dataclass(frozen=True)
class GainCell:
    """The loop under a share of the largest load."""

    load: float
    key: str
    timed: bool = False

    @property
    def label(self) -> str:
        return f"pressure loop at {self.load:g} of the load"


@dataclass(frozen=True)
class GainLimit:
    """Gains Pa with the updates (-1: never settled) that the loop took; limits Pa; the `tuned` gain
    of paper 000, section 3.3."""

    gains: tuple[float, ...]
    updates: tuple[int, ...]
    predicted: float
    measured: float | None
    tuned: float

    @property
    def error(self) -> float | None:
        """Measured over predicted limit less 1."""
        return None if self.measured is None else self.measured / self.predicted - 1

    @property
    def holds(self) -> bool:
        return self.error is not None and abs(self.error) <= TOLERANCE


@dataclass(frozen=True)
class GainMap:
    """All loads with their limits; refused ones are left out of `limits`."""

    experiment: Experiment
    cells: tuple[GainCell, ...]
    done: Finished[GainLimit]

    @property
    def limits(self) -> tuple[tuple[GainCell, GainLimit], ...]:
        found = ((c, self.done.records[c.key].value) for c in self.cells)
        return tuple((c, value) for c, value in found if value is not None)

    @property
    def passed(self) -> bool:
        """Whether every load has a measured limit, and where it is predicted."""
        return len(self.limits) == len(self.cells) and all(v.holds for _, v in self.limits)


@dataclass(frozen=True)
class GainBench:
    """The response columns of the body, and the largest inputs (k,) m that were recorded."""

    responses: Responses
    largest: Floats


def gain_map(
    experiment: Experiment,
    *,
    out: Path | None = None,
    where: Where | None = None,
    report: Report | None = None,
) -> GainMap | None:
    """None where no fluid is kept in a cavity. Raises what finding the experiment's scene does."""
    if not own_body(experiment).scene.cavities:
        return None
    job = job_of(experiment)
    cells = tuple(GainCell(load, key_of(job, "gain", load)) for load in LOADS)
    plan = Plan(job, cells, open_bench, run_cell, GainLimit)
    done = finish(plan, study_folder(experiment, "stability", out) / CELLS, where, report)
    return GainMap(experiment, cells, done)


def open_bench(job: Job) -> GainBench:
    own = own_body(job.experiment())
    inputs = own.seen.inputs
    largest = inputs[int(np.argmax(np.abs(inputs).sum(axis=1)))]
    return GainBench(responses(build(with_law(own.scene, "linear"))), np.asarray(largest))


def run_cell(bench: GainBench, cell: GainCell) -> GainLimit:
    """Raise `ComparisonError` where no pressure keeps the volume."""
    drives = cell.load * bench.largest
    tuned = tuned_gain(bench.responses)
    reach = 10 ** (DECADES / 2)
    gains = tuned * np.geomspace(1 / reach, reach, DECADES * PER_DECADE + 1)
    predicted = _predicted(bench.responses, drives)
    updates = partial(_updates, bench.responses, drives)
    measured = measured_limit(lambda gain: 0.0 if updates(gain) >= 0 else 2.0, predicted, 1.0)
    return GainLimit(
        tuple(gains.tolist()), tuple(updates(g) for g in gains), predicted, measured, tuned
    )


def _updates(columns: Responses, drives: Floats, gain: float) -> int:
    stepper = replace(_LOOP, gain=gain).on(columns)
    state = stepper.step(stepper.rest(), drives)
    return -1 if state.failure else int(state.updates)


def _predicted(columns: Responses, drives: Floats) -> float:
    """2 over the largest eigenvalue of (dV_i/dP_j) / V0_i at the root."""
    stepper = ExactPressure().on(columns)
    state = stepper.step(stepper.rest(), drives)
    if state.failure:
        raise ComparisonError(f"no pressure keeps the volume constant: {state.failure[1]}")
    k = columns.drives
    pressures = [state.numbers[f"{c.name}.pressure"] for c in columns.scene.cavities]
    z = np.concatenate([[1.0], drives, pressures])
    slopes = 3 * (columns.volumes @ z @ z)
    compliance = slopes[:, k + 1 :] / columns.rest_volumes[:, None]
    return float(2 / np.abs(np.linalg.eigvals(compliance)).max())
