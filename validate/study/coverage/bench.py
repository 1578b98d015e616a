"""Coverage study on a worker: exact readings of a model, terms of the checks, drawn verdicts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf, isfinite

import numpy as np

from validate.arrays import Floats, rms
from validate.compare.convergence import Numerical
from validate.compare.overall_verdict import judge_all
from validate.compare.residual import Residual, reached_end, stacked
from validate.compare.verdict import (
    Accept,
    Check,
    Sensitivity,
    Statistic,
    errors_of,
    name_of,
    nothing_compared,
)
from validate.engine.store import key_of
from validate.errors import ComparisonError
from validate.identify.identification import Identification
from validate.pipeline.calibration.calibrated import Identify, here
from validate.pipeline.calibration.problem import Problem
from validate.pipeline.checks.checks import Terms, terms_of
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.options import Options
from validate.pipeline.run.case_solution import placed, run_on, solve
from validate.pipeline.run.job import Job
from validate.pipeline.run.method_run import MethodRun
from validate.pipeline.run.pipeline import set_out
from validate.pipeline.run.runs import ExperimentRuns
from validate.register.observation import AnyDraw, Draw, Drawable, Exact, Observation
from validate.study.coverage.plan import (
    FILTER_DRAWS,
    WRONG_DRAWS,
    DrawCell,
    ReadingCell,
    TermsCell,
    in_world,
    numbered,
    true_method,
)


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
    reached = None
    if terms.accept.statistic == "every" and residual.count != 1:
        found = errors_of(residual)
        reached = float(found.reach(np.zeros(len(found.E))).max() / 2)
    return Stated(
        terms.judge(residual).name, residual.unit, residual.count, terms.accept.required,
        terms.accept.statistic, reached,
        {k: u if isfinite(u) else None for k, u in numerical.parts.items()},
        numerical.words, numerical.deciding,
        dict(zip(names, (_moved(s, terms.accept.statistic) for s in terms.inputs), strict=True)),
        terms.fitted,
    )  # fmt: skip


def _moved(input_: Sensitivity, statistic: Statistic) -> tuple[float, ...]:
    change = input_.change.values
    if statistic != "every":
        return (rms(change),)
    return tuple(np.linalg.norm(change, axis=1).tolist())


# --- cell of a coverage study: draws of recordings, with verdicts in every world -----------------

PERFECT = ""  # the world in which the judged model is true


@dataclass(frozen=True)
class Judged:
    """One check over some draws: E (None: compared nothing), u_D, u_val (None: not bounded), and
    both answers."""

    E: tuple[float | None, ...]
    u_D: tuple[float, ...]
    u_val: tuple[float | None, ...]
    validations: tuple[str, ...]
    acceptances: tuple[str, ...]


@dataclass(frozen=True)
class Draws:
    """Some draws: checks by world and name, whether all of a world's together differ, E of the
    measurement alone by name, and the acceptances of models whose error is the limit; and from the
    first cell only, rms of what one standard uncertainty of each input to both sides does, by input
    and name, and how far a linear response was off."""

    worlds: Mapping[str, Mapping[str, Judged]]
    overall: Mapping[str, tuple[bool, ...]]
    measured: Mapping[str, tuple[float, ...]]
    at_limit: Mapping[str, tuple[str, ...]]
    alone: Mapping[str, Mapping[str, tuple[float, ...]]] = field(default_factory=dict)
    off: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Given:
    """What all draws of a method share; opens their bench. `key` stands for all of it.

    Readings of the judged model, of each input one standard uncertainty to both sides (plus,
    minus), of wrong worlds by label; and of whole draws where the response is not taken as linear.
    z (draws, inputs) are standard uncertainties; `noise` is the real noise over the declared one.
    """

    key: str
    method: str
    stated: tuple[Stated, ...] = field(compare=False)
    base: ExactReading = field(compare=False)
    steps: Mapping[str, tuple[ExactReading, ExactReading]] = field(compare=False)
    wrong: Mapping[str, ExactReading] = field(compare=False)
    full: Mapping[int, ExactReading] = field(compare=False)
    checks: Mapping[int, ExactReading] = field(compare=False)
    z: Floats = field(compare=False)
    seed: int = field(compare=False)
    noise: float = field(compare=False)
    opening: Opening = field(compare=False)

    def __call__(self, job: Job) -> "DrawBench":
        bench = self.opening(job)
        return DrawBench(self, bench.runs, bench.followed(self.method))

    def truth(self, draw: int) -> ExactReading:
        """Return the readings of exact sensors with that draw's inputs."""
        return self.full[draw] if draw in self.full else self.linear(draw)

    def linear(self, draw: int) -> ExactReading:
        """The same by straight lines to both sides of the judged model."""
        found = self.base
        for z, (plus, minus) in zip(self.z[draw].tolist(), self.steps.values(), strict=True):
            found = found.plus(abs(z), plus if z > 0 else minus, self.base)
        return found


@dataclass(frozen=True)
class DrawBench:
    """The judged method as it ran on the real recordings; a filter is run anew on every draw."""

    given: Given
    runs: ExperimentRuns
    mine: MethodRun

    def residuals(self, reading: ExactReading, draws: Sequence[AnyDraw]) -> dict[str, Residual]:
        """Those of the judged method against a drawn recording, by the name of their check."""
        left = iter(reading.left)
        seen = tuple(
            replace(
                registered,
                observations=tuple(
                    o if o.role == "drives" else drawable(o).anew(next(left), draw)
                    for o in registered.observations
                ),
            )
            for registered, draw in zip(self.mine.registered, draws, strict=True)
        )
        runs, method = self.mine.runs, self.runs.settings[self.mine.method]
        if method.markers:
            runs = run_on(
                self.runs.experiment, self.mine.method, method, self.runs.parameters,
                self.mine.scene, seen,
            )  # fmt: skip
        found = stacked(r for pair in zip(seen, runs, strict=True) for r in Residual.of(*pair))
        return {
            s.name: r
            for s in self.given.stated for r in found.values()
            if name_of(r, s.statistic) == s.name
        }  # fmt: skip

    def exact(self) -> list[AnyDraw]:
        return [Exact()] * len(self.mine.registered)

    def noise(self, draw: int) -> list[AnyDraw]:
        """The same noise in every world."""
        found: list[AnyDraw] = []
        for i, seen in enumerate(self.mine.registered):
            rng = np.random.default_rng([self.given.seed, draw, i])
            late = max(d.sd_t for d in seen.drives) * float(rng.standard_normal())
            found.append(Draw(rng, self.given.noise, late))
        return found


def run_draws(bench: DrawBench, cell: DrawCell) -> Draws:
    """Judges every draw of the cell in every world."""
    given, numbers = bench.given, range(cell.first, cell.first + cell.count)
    worlds, overall = {}, {}
    filtered = bool(bench.runs.settings[cell.method].markers)
    most = FILTER_DRAWS if filtered else WRONG_DRAWS
    for label in (PERFECT, *given.wrong):
        kept = [k for k in numbers if not label or k < most]
        checks = [_judged_draw(bench, label, k) for k in kept]
        worlds[label] = {s.name: _over([c[s.name] for c in checks]) for s in given.stated}
        overall[label] = tuple(bool(judge_all(list(c.values())).differs) for c in checks)
    # E by the measurement alone; where no input is uncertain, it is all that is drawn.
    if given.steps:
        errors: dict[str, list[float]] = {s.name: [] for s in given.stated}
        statistics = {s.name: s.statistic for s in given.stated}
        for k in numbers:
            for name, residual in bench.residuals(given.base, bench.noise(k)).items():
                drawn = errors_of(residual, statistics[name])
                errors[name].append(float(drawn.E[drawn.worst(np.zeros(len(drawn.E)))]))
        measured = {name: tuple(values) for name, values in errors.items()}
    else:
        perfect = worlds[PERFECT].items()
        measured = {name: tuple(e for e in one.E if e is not None) for name, one in perfect}
    alone: dict[str, dict[str, tuple[float, ...]]] = {}
    if cell.first == 0:
        base = bench.residuals(given.base, bench.exact())
        for name, pair in given.steps.items():
            sides = [bench.residuals(side, bench.exact()) for side in pair]
            alone[name] = {
                k: tuple(rms(side[k].values - r.values) for side in sides if k in side)
                for k, r in base.items()
            }
    # The largest rms difference between linear and full responses, by check.
    off: dict[str, float] = {}
    for draw, reading in given.checks.items() if cell.first == 0 else ():
        full = bench.residuals(reading, bench.exact())
        line = bench.residuals(given.linear(draw), bench.exact())
        for name in full.keys() & line.keys():
            apart = rms(full[name].values - line[name].values)
            off[name] = max(apart, off.get(name, 0.0))
    # Acceptances of a model whose error is the limit itself, where a wrong answer is likeliest: of
    # every point, along the first component.
    required = [s for s in given.stated if s.limit is not None and not s.fitted]
    limits: dict[str, list[str]] = {s.name: [] for s in required}
    for k in numbers if required else ():
        found = bench.residuals(given.truth(k), bench.noise(k))
        for s in (s for s in required if s.name in found):
            shift = np.zeros_like(found[s.name].values)
            shift[:, 0] = s.limit
            wrong = replace(found[s.name], values=found[s.name].values + shift, scale=None)
            limits[s.name].append(s.terms.judge(wrong).acceptance)
    at_limit = {name: tuple(answers) for name, answers in limits.items()}
    return Draws(worlds, overall, measured, at_limit, alone, off)


def _judged_draw(bench: DrawBench, label: str, draw: int) -> dict[str, Check]:
    given, truth = bench.given, bench.given.truth(draw)
    if label:
        truth = truth.plus(1.0, given.wrong[label], given.base)
    found = bench.residuals(truth, bench.noise(draw))
    return {
        s.name: s.terms.judge(found[s.name]) if s.name in found else _nothing(s)
        for s in given.stated
    }


def _nothing(s: Stated) -> Check:
    why = "the run did not reach the end"
    return nothing_compared(s.terms.accept, s.name, s.unit, why)


def _over(checks: Sequence[Check]) -> Judged:
    return Judged(
        tuple(c.value if c.count else None for c in checks),
        tuple(c.u_D for c in checks),
        tuple(c.u_val if isfinite(c.u_val) else None for c in checks),
        tuple(c.validation for c in checks),
        tuple(c.acceptance for c in checks),
    )
