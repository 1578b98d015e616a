"""Stability of a pressure loop: critical gain of a static experiment with a fluid.

Nothing steps in time there, but paper 000's loop P <- P + Kp (1 - V/V0) (eqs 9 and 10) is a fixed
point that settles where every |1 - Kp dV/dP / V0| < 1. Predicted: 2 / (dV/dP / V0) at the pressure
that keeps the volume. Measured: the gain beyond which the loop itself ends without having settled.
The report of such an experiment shows the map of the gain, if it has a loop.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Exhibit, Mark, NumberTable, Panel, RegimeMap
from validate.engine.cell import Plan, Where
from validate.engine.execution import CELLS, Finished, Report, finish
from validate.engine.store import key_of
from validate.errors import ComparisonError
from validate.fem.system import Responses, build
from validate.pipeline.bodies.own_body import own_body, with_law
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.run.job import Job, job_of, study_folder
from validate.report.views.view_filling import Shown, table
from validate.solve.fluid.cavities import ExactPressure
from validate.solve.fluid.pressure_curve import tuned_gain
from validate.solve.fluid.pressure_loop import PressureLoop
from validate.study.stability.cell import measured_limit
from validate.study.study_page import Findings

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
    return GainBench(Responses.of(build(with_law(own.scene, "linear"))), np.asarray(largest))


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


_REGIMES = ("settles", "never settles")
_NOTHING = (
    "{name} declares no density and no fluid. It has no scheme that marches in time and no "
    "pressure loop, so there is no stability to map."
)


def told_nothing(experiment: Experiment, quick: bool) -> Findings:
    """Return a page that says so."""
    said = _NOTHING.format(name=experiment.name)
    words = Exhibit("stability", "No scheme steps in time", (said,))
    document = {"kind": "stability", "points": 0}
    return Findings(
        f"Stability map: {experiment.title}",
        said,
        (words,),
        document,
        table("cells", "", (), {}),
        quick,
    )


def told_gain(found: GainMap, quick: bool) -> Findings:
    band = ("good", "Predictions hold") if found.passed else ("bad", "Predictions fail")
    columns: Mapping[str, Shown] = {
        "share of the largest load / 1": "0.load", "predicted limit / Pa": "1.predicted",
        "measured limit / Pa": "1.measured", "relative difference / 1": "1.error",
        "tuned gain / Pa": "1.tuned", "updates at the nearest gain": _nearest,
    }  # fmt: skip
    limits = table("gains", "Limits of the gain under load", found.limits, columns)
    words = (
        "Paper 000's loop P <- P + Kp (1 - V/V0) settles where |1 - Kp dV/dP / V0| < 1. Predicted "
        "from the compliance of the cavity at the pressure that keeps its volume; measured by "
        "running the loop from rest and halving the interval.",
    )
    maps = (_map(found),) if found.limits else ()
    exhibit = Exhibit("gain", "The gain of the pressure loop", words, (limits,), regimes=maps)
    return Findings(
        f"Stability map: {found.experiment.title}", sentence(found), (exhibit,),
        {
            "kind": "stability",
            "passed": found.passed,
            "points": sum(len(v.gains) for _, v in found.limits),
            "gains": [{"load": c.load, **asdict(v)} for c, v in found.limits],
            "refused": [r.why for r in found.done.records.values() if r.why],
        },
        _cells(found), quick, passed=found.passed, band=band,
    )  # fmt: skip


def sentence(found: GainMap) -> str:
    """Where the loop's gain has its limit, and whether that was predicted, in one sentence."""
    errors = [abs(v.error) for _, v in found.limits if v.error is not None]
    limits = [v.measured for _, v in found.limits if v.measured is not None]
    if not limits:
        return "No scheme steps in time; no limit of the pressure loop's gain was found."
    tuned = found.limits[0][1].tuned
    return (
        "No scheme steps in time; the loop that keeps the fluid's volume settles up to gains "
        f"of {min(limits):.4g} to {max(limits):.4g} Pa (tuned: {tuned:.4g} Pa), at most "
        f"{100 * max(errors):.2g} % from the predicted ones, {100 * TOLERANCE:g} % allowed."
    )


def _nearest(limit: tuple[GainCell, GainLimit]) -> int:
    """Updates at the gain that is nearest to the tuned one."""
    _, v = limit
    return v.updates[int(np.argmin(np.abs(np.log(np.array(v.gains) / v.tuned))))]


def _map(found: GainMap) -> RegimeMap:
    first = found.limits[0][1]
    codes = [[int(n < 0) for n in v.updates] for _, v in found.limits]
    border = np.array([v.predicted for _, v in found.limits])
    panel = Panel("pressure loop", np.array(codes), border)
    return RegimeMap(
        "gain", f"{found.experiment.name}: gain against load", "gain / Pa",
        "share of the largest load", np.array(first.gains),
        tuple(f"{c.load:g}" for c, _ in found.limits), _REGIMES, (panel,),
        (Mark("tuned", first.tuned, 0.0),), "Line: predicted limit. Mark: the tuned gain.",
    )  # fmt: skip


def _cells(found: GainMap) -> NumberTable:
    rows = [
        (c.load, gain, None if n < 0 else n)
        for c, v in found.limits
        for gain, n in zip(v.gains, v.updates, strict=True)
    ]
    return table("cells", "Every gain.", rows, {"load_1": "0", "gain_Pa": "1", "updates": "2"})
