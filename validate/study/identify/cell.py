"""Cell of an identification: a fit from one start, or one side of a profile."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from validate.engine.worker_cache import Kept
from validate.identify.least_squares import Fit, fit
from validate.identify.profile import Side, side
from validate.identify.scaled_curve import linear_fit
from validate.pipeline.calibration.calibrated import problem_of
from validate.pipeline.calibration.free_parameters import asked
from validate.pipeline.calibration.problem import Problem, with_free
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.options import Options, all_methods, configure
from validate.pipeline.experiment.origins import opened
from validate.pipeline.run.job import Job

Known = tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class Of:
    """Which problem: the number of a calibration, what is `wanted` as the user asks, and what
    calibrations before it found."""

    number: int
    wanted: tuple[str, ...]
    known: Known


@dataclass(frozen=True)
class StartCell:
    """A fit from coordinates `start` (p,)."""

    of: Of
    start: tuple[float, ...]
    label: str
    key: str = ""
    timed: bool = False


@dataclass(frozen=True)
class LinearCell:
    """The closed form of a parameter that the residual may be linear in."""

    of: Of
    label: str
    key: str = ""
    timed: bool = False


@dataclass(frozen=True)
class SideCell:
    """One side of a parameter's profile about the best fit."""

    of: Of
    best: Fit
    parameter: int
    sign: int
    scale: float
    label: str
    key: str = ""
    timed: bool = False


class IdentifyBench:
    """An experiment as its recordings have it, and the problems that were asked for."""

    def __init__(self, experiment: Experiment, options: Options) -> None:
        parameters, _ = configure(experiment, options)
        found = opened(experiment, parameters)
        self.parameters, self.recordings = found.parameters, found.recordings
        self.experiment: Experiment = experiment.follows(
            experiment, found.recordings, found.parameters
        )
        self.methods = all_methods(experiment, options)
        self._problems: Kept[Problem] = Kept(8)

    def problem(self, of: Of) -> Problem:
        """Raise what loading the recordings that calibrate does."""
        return self._problems.get(of, lambda: self._problem(of))

    def _problem(self, of: Of) -> Problem:
        parameters: Any = with_free(self.parameters, dict(of.known))
        experiment, free = asked(self.experiment, self.parameters, of.wanted)
        return problem_of(
            experiment, of.number, free[of.number], parameters, self.methods, self.recordings
        )


def open_bench(job: Job) -> IdentifyBench:
    return IdentifyBench(job.experiment(), Options(dict(job.values), (), job.quick))


def run_linear(bench: IdentifyBench, cell: LinearCell) -> Fit:
    problem = bench.problem(cell.of)
    return linear_fit(problem.residual, problem.space)


def run_start(bench: IdentifyBench, cell: StartCell) -> Fit:
    return fit(bench.problem(cell.of).residual, np.array(cell.start))


def run_side(bench: IdentifyBench, cell: SideCell) -> Side:
    residual = bench.problem(cell.of).residual
    return side(residual, cell.best, cell.parameter, cell.sign, cell.scale)
