"""Worker data of a coverage study: exact readings of a model, and terms of the checks."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf, isfinite

import numpy as np

from validate.arrays import Floats, rms
from validate.compare.convergence import Numerical
from validate.compare.residual import Residual, reached_end
from validate.compare.verdict import Accept, Sensitivity, Statistic, errors_of
from validate.engine.store import key_of
from validate.errors import ComparisonError
from validate.identify.identification import Identification
from validate.pipeline.calibration.calibrated import Identify, here
from validate.pipeline.calibration.problem import Problem
from validate.pipeline.checks.checks import Terms, terms_of
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.options import Options
from validate.pipeline.run.case_solution import placed, solve
from validate.pipeline.run.job import Job
from validate.pipeline.run.method_run import MethodRun
from validate.pipeline.run.pipeline import set_out
from validate.pipeline.run.runs import ExperimentRuns
from validate.register.observation import Drawable, Observation
from validate.study.coverage.plan import ReadingCell, TermsCell, in_world, numbered, true_method


@dataclass(frozen=True)
class ExactReading:
    """Exact readings less measured samples, of every observation of every recording, at t s."""

    left: tuple[Floats, ...]
    t: tuple[Floats, ...]

    @property
    def size(self) -> int:
        return sum(len(part) for part in self.left)

    def plus(self, share: float, other: "ExactReading", less: "ExactReading") -> "ExactReading":
        """With `share` of the difference between two others."""
        parts = zip(self.left, other.left, less.left, strict=True)
        return ExactReading(tuple(a + share * (b - c) for a, b, c in parts), self.t)

    def on(self, base: "ExactReading") -> "ExactReading":
        """At the samples of another: a body of another size may leave others of a signal in.

        Raises `ComparisonError` for markers or outlines of which there are not as many.
        """
        parts = zip(self.left, self.t, base.left, base.t, strict=True)
        return ExactReading(tuple(_at(*part) for part in parts), base.t)


def _at(left: Floats, t: Floats, other: Floats, other_t: Floats) -> Floats:
    if left.shape == other.shape:
        return left
    if len(left) != len(t):
        raise ComparisonError(
            f"{len(left)} numbers are measured in the drawn recording, {len(other)} as judged"
        )
    return np.interp(other_t, t, left)


@dataclass(frozen=True)
class Stated:
    """What one check is judged with, as it is stored; None in `numerical`: nothing bounds it.

    `limit` is None without a requirement. `measurement` is half of what the measurement alone
    reaches by chance where every point is judged; None where the draws say it themselves. `inputs`
    are what one standard uncertainty of each does, by point where every one is judged.
    """

    name: str
    unit: str
    count: int
    limit: float | None
    statistic: Statistic
    measurement: float | None
    numerical: Mapping[str, float | None]
    words: str
    deciding: Mapping[str, str]
    inputs: Mapping[str, tuple[float, ...]]
    fitted: str

    @property
    def terms(self) -> Terms:
        parts = {k: inf if u is None else u for k, u in self.numerical.items()}
        inputs = (
            Sensitivity(k, Residual("u", "all", np.array(u)[:, None], 0.0, 0.0, self.unit,
                                    "a standard uncertainty"))
            for k, u in self.inputs.items()
        )  # fmt: skip
        numerical = Numerical(parts, self.words, self.deciding)
        accept = Accept(self.name, self.limit, "as declared", statistic=self.statistic)
        return Terms(accept, numerical, tuple(inputs), self.fitted)


@dataclass(frozen=True)
class AllStated:
    """All checks of a method."""

    checks: tuple[Stated, ...]


class CoverageBench:
    """An experiment set out, and its judged methods as they run on the real recordings."""

    def __init__(self, runs: ExperimentRuns) -> None:
        self.runs = runs

    def followed(self, method: str) -> MethodRun:
        return self.runs.main(method)


@dataclass(frozen=True)
class Opening:
    """Opens an experiment with what was identified before, by the number of its calibration."""

    key: str
    found: Mapping[int, Identification] = field(default_factory=dict, compare=False)

    def __call__(self, job: Job) -> CoverageBench:
        out = set_out(*_judged(job), identify=self._identified)
        out.runs.start(out.found.recordings)
        return CoverageBench(out.runs)

    def _identified(self, number: int, problem: Problem) -> Identification:
        return self.found[number] if number in self.found else here(number, problem)


def opened_here(job: Job, identify: Identify = here) -> tuple[CoverageBench, Opening]:
    """Identify once, by `identify`; the opening spares workers that."""
    found: dict[int, Identification] = {}

    def once(number: int, problem: Problem) -> Identification:
        found[number] = identify(number, problem)
        return found[number]

    out = set_out(*_judged(job), identify=once)
    # Raise `ComparisonError`, before anything is solved, for an observation whose noise cannot be
    # drawn again
    of, runs = out.experiment, out.runs
    for name in of.accepted:
        _, registered = placed(of, out.found.recordings, runs.settings[name], runs.parameters)
        for observation in (o for seen in registered for o in seen.compared):
            drawable(observation)
    out.runs.start(out.found.recordings)
    return CoverageBench(out.runs), Opening(key_of(job, "opening"), found)


def _judged(job: Job) -> tuple[Experiment, Options]:
    """With the accepted methods and their truths alone: no rival is identified."""
    experiment = job.experiment()
    surrogate = experiment.uncertainty.surrogate if experiment.uncertainty else ""
    each = [*experiment.accepted, *(true_method(experiment, n) for n in experiment.accepted)]
    names = tuple(dict.fromkeys([*each, surrogate] if surrogate and each else each))
    return experiment, Options(dict(job.values), names, job.quick)


def drawable(o: Observation) -> Drawable:
    if not isinstance(o, Drawable):
        raise ComparisonError(
            f"'{o.name}' is compared as {type(o).__name__}, whose noise cannot be drawn again "
            "(it has no `left` and `anew`), so coverage is not known; take an experiment that "
            "compares markers, outlines or signals, such as kf_cube or fluid_phantom"
        )
    return o


def run_reading(bench: CoverageBench, cell: ReadingCell) -> ExactReading:
    """Raise `ComparisonError` for a run that does not reach the end, and what solving does."""
    runs = bench.runs
    parameters = in_world(runs.experiment, runs.parameters, cell.world)
    found = solve(
        runs.experiment, runs.recordings, cell.method, runs.settings[cell.method], parameters
    )
    for seen, run in zip(found.registered, found.runs, strict=True):
        if not reached_end(seen, run):
            raise ComparisonError(f"{cell.label}: {run.outcome.state}, {run.outcome.why}")
    pairs = list(zip(found.registered, found.runs, strict=True))
    return ExactReading(
        tuple(drawable(o).left(run) for seen, run in pairs for o in seen.compared),
        tuple(o.t for seen, _ in pairs for o in seen.compared),
    )


def run_terms(bench: CoverageBench, cell: TermsCell) -> AllStated:
    """Raise `ComparisonError` where the method compares nothing."""
    mine = bench.followed(cell.method)
    found = [
        _stated(mine.residuals[name], terms)
        for _, by_name in terms_of(bench.runs, mine)
        for name, terms in by_name.items()
    ]
    if not found:
        ends = "; ".join(f"{r.outcome.state} {r.outcome.why}".strip() for r in mine.runs)
        raise ComparisonError(f"{cell.method}: no accepted quantity was compared ({ends})")
    return AllStated(tuple(found))


def _stated(residual: Residual, terms: Terms) -> Stated:
    numerical, names = terms.numerical, numbered([s.name for s in terms.inputs])
    return Stated(
        terms.judge(residual).name, residual.unit, residual.count, terms.accept.required,
        terms.accept.statistic, _reached(residual, terms.accept.statistic),
        {k: u if isfinite(u) else None for k, u in numerical.parts.items()},
        numerical.words, numerical.deciding,
        dict(zip(names, (_moved(s, terms.accept.statistic) for s in terms.inputs), strict=True)),
        terms.fitted,
    )  # fmt: skip


def _reached(residual: Residual, statistic: Statistic) -> float | None:
    if statistic != "every" or residual.count == 1:
        return None
    found = errors_of(residual)
    return float(found.reach(np.zeros(len(found.E))).max() / 2)


def _moved(input_: Sensitivity, statistic: Statistic) -> tuple[float, ...]:
    change = input_.change.values
    if statistic != "every":
        return (rms(change),)
    return tuple(np.linalg.norm(change, axis=1).tolist())
