"""Cell of a coverage study: draws of a method's recordings, with verdicts in every world.

A drawn recording is the real one with its samples where a true model would have them: exact
readings less measured samples add up, so that inputs, and parameters that are wrong, are
differences of readings. Noise, registration and clock are drawn by the observations themselves.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite

import numpy as np

from validate.arrays import Floats, rms
from validate.compare.overall_verdict import judge_all
from validate.compare.residual import Residual, residuals, stacked
from validate.compare.verdict import Check, errors_of, name_of, nothing_compared
from validate.pipeline.run.case_solution import run_on
from validate.pipeline.run.job import Job
from validate.pipeline.run.method_run import MethodRun
from validate.pipeline.run.runs import ExperimentRuns
from validate.register.observation import AnyDraw, Draw, Exact
from validate.register.registration import Registered
from validate.study.coverage.bench import ExactReading, Opening, Stated, drawable
from validate.study.coverage.plan import FILTER_DRAWS, WRONG_DRAWS, DrawCell

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
        seen = self._drawn(reading, draws)
        runs, method = self.mine.runs, self.runs.settings[self.mine.method]
        if method.markers:
            runs = run_on(
                self.runs.experiment, self.mine.method, method, self.runs.parameters,
                self.mine.scene, seen,
            )  # fmt: skip
        found = stacked(r for pair in zip(seen, runs, strict=True) for r in residuals(*pair))
        return {
            s.name: r
            for s in self.given.stated for r in found.values()
            if name_of(r, s.statistic) == s.name
        }  # fmt: skip

    def _drawn(self, reading: ExactReading, draws: Sequence[AnyDraw]) -> tuple[Registered, ...]:
        left = iter(reading.left)
        return tuple(
            replace(
                seen,
                observations=tuple(
                    o if o.role == "drives" else drawable(o).anew(next(left), draw)
                    for o in seen.observations
                ),
            )
            for seen, draw in zip(self.mine.registered, draws, strict=True)
        )

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
        checks = [_judged(bench, label, k) for k in kept]
        worlds[label] = {s.name: _over([c[s.name] for c in checks]) for s in given.stated}
        overall[label] = tuple(bool(judge_all(list(c.values())).differs) for c in checks)
    first = cell.first == 0
    return Draws(
        worlds, overall, _measured(bench, numbers) if given.steps else _of_all(worlds[PERFECT]),
        _at_limit(bench, numbers),
        _alone(bench) if first else {}, _off(bench) if first else {},
    )  # fmt: skip


def _judged(bench: DrawBench, label: str, draw: int) -> dict[str, Check]:
    given, truth = bench.given, bench.given.truth(draw)
    if label:
        truth = truth.plus(1.0, given.wrong[label], given.base)
    found = bench.residuals(truth, bench.noise(draw))
    return {
        s.name: s.terms.judge(found[s.name]) if s.name in found else _nothing(s)
        for s in given.stated
    }


def _at_limit(bench: DrawBench, numbers: Sequence[int]) -> dict[str, tuple[str, ...]]:
    """Acceptances of a model whose error is the limit itself, where a wrong answer is likeliest:
    of every point, along the first component."""
    required = [s for s in bench.given.stated if s.limit is not None and not s.fitted]
    found: dict[str, list[str]] = {s.name: [] for s in required}
    for k in numbers if required else ():
        drawn = bench.residuals(bench.given.truth(k), bench.noise(k))
        for s in (s for s in required if s.name in drawn):
            off = np.zeros_like(drawn[s.name].values)
            off[:, 0] = s.limit
            wrong = replace(drawn[s.name], values=drawn[s.name].values + off, scale=None)
            found[s.name].append(s.terms.judge(wrong).acceptance)
    return {name: tuple(answers) for name, answers in found.items()}


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


def _measured(bench: DrawBench, numbers: Sequence[int]) -> dict[str, tuple[float, ...]]:
    """E by the measurement alone: the inputs are as they are judged."""
    found: dict[str, list[float]] = {s.name: [] for s in bench.given.stated}
    statistics = {s.name: s.statistic for s in bench.given.stated}
    for k in numbers:
        for name, residual in bench.residuals(bench.given.base, bench.noise(k)).items():
            errors = errors_of(residual, statistics[name])
            found[name].append(float(errors.E[errors.worst(np.zeros(len(errors.E)))]))
    return {name: tuple(errors) for name, errors in found.items()}


def _of_all(judged: Mapping[str, Judged]) -> dict[str, tuple[float, ...]]:
    """E where no input is uncertain: the measurement is all that is drawn."""
    return {name: tuple(e for e in one.E if e is not None) for name, one in judged.items()}


def _alone(bench: DrawBench) -> dict[str, dict[str, tuple[float, ...]]]:
    base = bench.residuals(bench.given.base, bench.exact())
    found: dict[str, dict[str, tuple[float, ...]]] = {}
    for name, pair in bench.given.steps.items():
        sides = [bench.residuals(side, bench.exact()) for side in pair]
        found[name] = {
            k: tuple(rms(side[k].values - r.values) for side in sides if k in side)
            for k, r in base.items()
        }
    return found


def _off(bench: DrawBench) -> dict[str, float]:
    """The largest rms difference between linear and full responses, by check."""
    worst: dict[str, float] = {}
    for draw, reading in bench.given.checks.items():
        full = bench.residuals(reading, bench.exact())
        line = bench.residuals(bench.given.linear(draw), bench.exact())
        for name in full.keys() & line.keys():
            off = rms(full[name].values - line[name].values)
            worst[name] = max(off, worst.get(name, 0.0))
    return worst
