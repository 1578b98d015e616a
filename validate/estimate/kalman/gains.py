"""Precomputed gains of a linear filter; they depend only on the schedule of measurements."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from validate.arrays import Floats
from validate.estimate.kalman.covariance import Claim, Covariance, Recursion
from validate.estimate.kalman.formulas import Gain, Seen
from validate.estimate.measurements import Timetable

# Change of the gain from one measurement to the next, of its largest entry, at which it is taken as
# settled: with a memory of a hundred measurements 1e-4 is left of it, below every noise's effect.
SETTLED = 1e-6


@dataclass(frozen=True)
class GainSequence:
    """Gains by step; from step `frozen` on they repeat (None: they never settled).

    `computed` counts the gains that were computed, `before` are those that were `mapped` to these;
    all lie in the span of `basis` (n, w), orthonormal columns, where one is known that is narrow.
    """

    gains: Mapping[int, Gain]
    frozen: int | None
    computed: int
    before: "GainSequence | None" = None
    basis: Floats | None = None

    def at(self, step: int) -> Gain | None:
        return self.gains.get(step)

    def mapped(self, turn: Callable[[Floats], Floats]) -> "GainSequence":
        """The same gains in other coordinates by a linear `turn`; repeats stay one array."""
        distinct = {id(gain): gain for gain in self.gains.values()}
        if not distinct:
            return self
        columns = np.cumsum([gain.G.shape[1] for gain in distinct.values()])[:-1]
        whole = np.hstack([gain.G for gain in distinct.values()])  # one product, not hundreds
        W = self.basis
        whole = turn(whole) if W is None else turn(W) @ (W.T @ whole)
        parts = zip(distinct.items(), np.split(whole, columns, axis=1), strict=True)
        turned = {
            k: Gain(np.ascontiguousarray(G), gain.S_yy, gain.seen, gain.root)
            for (k, gain), G in parts
        }
        gains = {step: turned[id(gain)] for step, gain in self.gains.items()}
        return replace(self, gains=MappingProxyType(gains), before=self, basis=None)


@dataclass(frozen=True)
class Event:
    """A measurement: its step, its gain, what is claimed after it, and if its gain is a repeat."""

    step: int
    gain: Gain
    claim: Claim
    repeated: bool


def schedule(timetable: Timetable) -> Mapping[int, Seen]:
    """Which components are measured at which steps, in order."""
    rows = sorted(timetable.z.items())
    return MappingProxyType({k: tuple(np.isfinite(z).tolist()) for k, z in rows})


def events(
    recursion: Recursion, when: Mapping[int, Seen], tolerance: float = SETTLED
) -> Iterator[Event]:
    """Gains in order. Once settled they repeat while interval and components stay what they are;
    after a break the recursion goes on from where it stood."""
    claim, last, step = recursion.start(), None, 0
    pattern: tuple[int, Seen] | None = None
    settled = False
    for k, seen in when.items():
        same = (k - step, seen) == pattern
        if last is not None and settled and same:
            yield Event(k, last, claim, True)
        else:
            gain, claim = recursion.update(recursion.predict(claim, k - step), seen)
            settled = last is not None and same and _close(gain.G, last.G, tolerance)
            last, pattern = gain, (k - step, seen)
            yield Event(k, gain, claim, False)
        step = k


def _close(new: Floats, old: Floats, tolerance: float) -> bool:
    return float(np.abs(new - old).max()) <= tolerance * float(np.abs(new).max())


def gain_sequence(
    recursion: Recursion, when: Mapping[int, Seen], tolerance: float = SETTLED
) -> GainSequence:
    """All gains of a schedule; `frozen` is the step after which none was computed any more."""
    gains, computed, frozen = {}, 0, None
    for event in events(recursion, when, tolerance):
        gains[event.step] = event.gain
        if not event.repeated:
            computed, frozen = computed + 1, None
        elif frozen is None:
            frozen = event.step
    return GainSequence(MappingProxyType(gains), frozen, computed)


class Claims:
    """Covariance at the end of any step, recomputed in one pass while steps rise.

    A whole covariance per step would not fit in memory; only the walk's place is kept.
    """

    def __init__(
        self, covariance: Covariance, when: Mapping[int, Seen], tolerance: float = SETTLED
    ) -> None:
        self._covariance, self._when, self._tolerance = covariance, when, tolerance
        self._walk: Iterator[Event] | None = None
        self._ahead: Event | None = None
        self._claim: Claim
        self._step = 0

    def at(self, step: int) -> Claim:
        if self._walk is None or step < self._step:
            self._walk = events(self._covariance, self._when, self._tolerance)
            self._claim, self._step = self._covariance.start(), 0
            self._ahead = next(self._walk, None)
        while self._ahead is not None and self._ahead.step <= step:
            self._claim, self._step = self._ahead.claim, self._ahead.step
            self._ahead = next(self._walk, None)
        if step > self._step:
            self._claim = self._covariance.predict(self._claim, step - self._step)
        self._step = step
        return self._claim
