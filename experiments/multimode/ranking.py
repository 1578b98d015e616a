"""How well every law fits the mode that calibrated, and how well it predicts the others.

Errors are rms over rows, relative to the measured stress. Their intervals are what another reading
of the same figures would give: readings drawn with the declared uncertainty, every law identified
again on them to first order, the drawn noise taken off the squares again. All laws see the same
draws, so that differences between them have intervals of their own.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from validate.arrays import Floats, rms
from validate.pipeline.run.method_run import MethodRun
from validate.register.observation import Selection
from validate.register.registration import Registered
from validate.scene.laws import LAWS
from validate.scene.meshless import StretchMode
from validate.solve.static.stretch_test import StretchTest

from .curves import Multimode, as_mode, point, principal
from .laws import LawCard
from .stress_observation import StressObservation

_DRAWS = 1000
_SEED = 1
_STEP = 1e-4  # of a coefficient, for slopes
_ENDS = (2.5, 97.5)  # %


@dataclass(frozen=True)
class LawError:
    """A relative error with its 95 % interval, and the draws (m,) that the interval is of."""

    value: float
    draws: Floats

    @property
    def low(self) -> float:
        return float(np.percentile(self.draws, _ENDS[0]))

    @property
    def high(self) -> float:
        return float(np.percentile(self.draws, _ENDS[1]))

    def below(self, other: "LawError") -> bool:
        """Whether it is smaller in 97.5 % of readings, which both see alike."""
        return bool(np.percentile(self.draws - other.draws, _ENDS[1]) < 0)


@dataclass(frozen=True)
class RankedLaw:
    """A law: errors of the mode that calibrated, of each other mode and of all those together.

    `lost`: mode and stretch where it loses positive energy, of the principal stretches measured.
    """

    method: str
    label: str
    fit: LawError
    modes: Mapping[StretchMode, LawError]
    predicted: LawError
    lost: tuple[str, float] | None
    coefficients: Mapping[str, float]


def ranked(
    p: Multimode, runs: Mapping[str, MethodRun], laws: Mapping[str, LawCard]
) -> list[RankedLaw]:
    """The laws that ran to the end, the one that predicts best first."""
    done = {n: f for n, f in runs.items() if all(run.finished for run in f.runs)}
    if not done:
        return []
    readings = _readings(p, next(iter(done.values())).registered)
    found = [_ranked(p, followed, laws[name], readings) for name, followed in done.items()]
    return sorted(found, key=lambda one: one.predicted.value)


def better_fit_worse_prediction(found: Sequence[RankedLaw]) -> list[tuple[RankedLaw, RankedLaw]]:
    """Pairs of laws of which the first fits better and predicts worse, both beyond their doubt."""
    return [
        (one, other)
        for one in found
        for other in found
        if one.fit.below(other.fit) and other.predicted.below(one.predicted)
    ]


def stress_of(seen: Registered) -> StressObservation:
    return seen.of(StressObservation)[0]


def mode_of(seen: Registered) -> StretchMode:
    return as_mode(stress_of(seen).quantity.removeprefix("stress."))


def errors(p: Multimode, law: LawCard, seen: Registered) -> Floats:
    """Relative errors (k,) of a law's coefficients in one mode, as the comparison has them."""
    run = StretchTest().solve(point(p, law, mode_of(seen)), seen.t, seen.inputs)
    (found,) = stress_of(seen).deviations(run, Selection("all"))
    return found.values[:, 0]


def _readings(p: Multimode, seen: Sequence[Registered]) -> list[Floats]:
    """Relative errors (draws, k) of other readings of every mode: of each row, and of its axis."""
    rng, by = np.random.default_rng(_SEED), p.ranges
    found = []
    for one in seen:
        stress = stress_of(one)
        k = int(stress.loaded.sum()) * stress.y.shape[1]
        axis = rng.normal(0, by.axis, (_DRAWS, 1))
        found.append(axis + rng.normal(0, by.reading, (_DRAWS, k)))
    return found


def _ranked(p: Multimode, followed: MethodRun, law: LawCard, readings: list[Floats]) -> RankedLaw:
    seen = followed.registered
    base = [errors(p, law, one) for one in seen]
    slopes = _slopes(p, law, seen, base)
    drawn = _identified_again(base, slopes, readings)
    free = slopes[0].shape[1]
    spreads = [
        _spread(e, d, p.ranges.reading, free if i == 0 else 0)
        for i, (e, d) in enumerate(zip(base, drawn, strict=True))
    ]
    modes = {mode_of(s): spread for s, spread in zip(seen[1:], spreads[1:], strict=True)}
    rest = np.concatenate(base[1:]), np.concatenate(drawn[1:], axis=1)
    return RankedLaw(
        followed.method, followed.label, spreads[0], modes, _spread(*rest, p.ranges.reading),
        _lost(p, law, seen), dict(vars(getattr(p, law))),
    )  # fmt: skip


def _slopes(
    p: Multimode, law: LawCard, seen: Sequence[Registered], base: Sequence[Floats]
) -> list[Floats]:
    """Changes (k, c) of the errors of every mode with the c coefficients, relative to each."""
    card = getattr(p, law)
    columns: list[list[Floats]] = [[] for _ in seen]
    for name, value in vars(card).items():
        moved = replace(p, **{law: replace(card, **{name: value * (1 + _STEP)})})
        for column, one, e in zip(columns, seen, base, strict=True):
            column.append((errors(moved, law, one) - e) / _STEP)
    return [np.stack(column, axis=1) for column in columns]


def _identified_again(
    base: Sequence[Floats], slopes: Sequence[Floats], readings: Sequence[Floats]
) -> list[Floats]:
    """Errors (draws, k) of every mode with other readings, the coefficients following the first
    mode's: e = s/y - 1 loses (1 + e) of the change of y."""
    lost = [(1 + e) * r for e, r in zip(base, readings, strict=True)]
    moved = lost[0] @ np.linalg.pinv(slopes[0]).T
    return [e - off + moved @ J.T for e, off, J in zip(base, lost, slopes, strict=True)]


def _spread(e: Floats, drawn: Floats, sd: float, free: int = 0) -> LawError:
    """Rms of the errors e (k,); of the draws (m, k) less what the drawn noise left over of `free`
    coefficients adds."""
    noise = sd**2 * (len(e) - free) / len(e)
    squares = np.maximum((drawn**2).mean(axis=1) - noise, 0.0)
    return LawError(rms(e[:, None]), np.sqrt(squares))


def _lost(p: Multimode, law: LawCard, seen: Sequence[Registered]) -> tuple[str, float] | None:
    """Where the law is unstable between the least and the largest principal stretch measured."""
    made = point(p, law, mode_of(seen[0])).material
    if not any(kind.ranged for kind in LAWS if kind.name == made.law):
        return None
    ends = [principal(mode_of(s), s.inputs) for s in seen]
    low, high = min(e.min() for e in ends), max(e.max() for e in ends)
    c = replace(made.coefficients, stretches=(float(low), float(high)))
    lost = c.lost_stability(made.law, made.shear_modulus)
    return (lost.mode, lost.stretch) if lost else None
