"""Likely causes of a difference between a computed and a measured history.

A history is that of markers, of an outline's places, or of a force. Each cause is a correction of
the computed one with one or two numbers: a lag of the clock, a factor (unit, or load over modulus),
another zero, an oscillator in place of statics, another frequency, another damping, a cubic
stiffening, a loop between loading and unloading, one marker left out. The share of
the residual's mean square that the best correction removes ranks them. A share says what the
residual looks like, not what is true: each cause names the measurement or run that would tell.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Exhibit, NumberTable
from validate.compare.result import MethodResult
from validate.errors import ValidateError
from validate.identify.recorded_motion import RecordedMotion, Ringing, recorded_motion
from validate.numbers import with_unit
from validate.pipeline.bodies.first_modes import first_frequencies
from validate.pipeline.run.method_run import MethodRun
from validate.register.observation import History

Failed = Collection[str]  # quantities of checks, as force.rms

_FEWEST = 8  # samples
_LEAST = 0.05  # of the residual: a correction that removes less is no cause
_LAGS = 101  # that are tried
_REACH = 0.25  # of the recorded period: the longest lag
_DAMPING = 0.03  # of the oscillator, where no ring-down was recorded
_UNITS = (1e3, 1e-3, 1e6, 1e-6, 25.4, 1 / 25.4, 10.0, 0.1, 9.80665, 1 / 9.80665)
_UNIT = 0.03  # how near a factor must come to one of them
_ODD = 2.0  # times the others' relative error: a marker alone


@dataclass(frozen=True)
class Cause:
    """It removes a `share` of the residual's mean square; `words` on what is seen, what `tells`."""

    name: str
    share: float
    words: str
    tells: str


@dataclass(frozen=True)
class Difference:
    """A `history`; `inertia` says whether the simulation has any, `first` Hz is the body's first
    mode."""

    history: History
    inertia: bool
    first: float | None

    @property
    def t(self) -> Floats:
        return self.history.t

    @property
    def names(self) -> tuple[str, ...]:
        return self.history.names

    @property
    def measured(self) -> Floats:
        return self.history.measured

    @property
    def simulated(self) -> Floats:
        return self.history.simulated

    def explained(self, other: Floats) -> float:
        """Share 0..1 of the residual's mean square that is gone with another simulation."""
        return 1 - _square(other - self.measured) / _square(self.simulated - self.measured)


def likely_causes(found: Difference) -> tuple[Cause, ...]:
    """Those that remove a twentieth of the residual or more, the best first."""
    size = float(np.nanmax(np.abs(found.measured), initial=0.0))
    if len(found.t) < _FEWEST or not size > 0 or not _square(found.simulated - found.measured) > 0:
        return ()
    shown = _motion(found.t, found.names, found.measured, found.history.sd)
    tried = (_inertia, _frequency, _damping, _law, _loop, _clock, _marker, _zero, _factor)
    causes = [cause for one in tried if (cause := one(found, shown)) and cause.share >= _LEAST]
    return tuple(sorted(causes, key=lambda c: -c.share))


def _square(x: Floats) -> float:
    return float(np.nanmean(x**2))


def _motion(
    t: Floats, names: tuple[str, ...], x: Floats, noise: float = 0.0
) -> RecordedMotion | None:
    try:
        return recorded_motion(t, {n: x[:, j] for j, n in enumerate(names)}, noise)
    except ValidateError:
        return None


# --- causes ---------------------------------------------------------------------------------------


def _inertia(found: Difference, shown: RecordedMotion | None) -> Cause | None:
    """Statics drives one oscillator at the body's first mode."""
    if found.inertia or found.first is None or shown is None:
        return None
    damping = shown.ringing.damping if shown.ringing else _DAMPING
    moved = _oscillated(found.t, found.simulated, found.first, float(np.clip(damping, 0, 0.9)))
    share = found.explained(moved)
    if shown.inertia_matters(found.first):
        share = max(share, 1.0)  # the model cannot have it, whatever else is wrong
    return Cause(
        "inertia", share,
        f"the recorded motion is mostly at {shown.frequency:.3g} Hz, the body's first mode at "
        f"{found.first:.3g} Hz, and the method has no inertia",
        "answer motion.how = dynamic in `validate new`, or record the same load more slowly",
    )  # fmt: skip


def _oscillated(t: Floats, u: Floats, first: float, damping: float) -> Floats:
    """q'' + 2 z w q' + w^2 q = w^2 u, from rest where u begins."""
    w, h = 2 * np.pi * first, float(np.median(np.diff(t)))
    A, B, C, D = np.array([[0, 1], [-w * w, -2 * damping * w]]), np.array([[0], [w * w]]), np.array(
        [[1, 0]]
    ), np.zeros((1, 1))  # fmt: skip
    from scipy.signal import cont2discrete  # takes 0.15 s, and few runs need it

    A, B, *_ = cont2discrete((A, B, C, D), h, "zoh")
    known = np.nan_to_num(u).reshape(len(u), -1)
    x, q = np.zeros((2, known.shape[1])), np.empty_like(known)
    for i, force in enumerate(known):
        x = A @ x + B * force
        q[i] = x[0]
    return np.asarray(q.reshape(u.shape))


def _rung(found: Difference, shown: RecordedMotion | None) -> tuple[Ringing, Ringing] | None:
    """How the marker that moves most rings, measured and simulated."""
    if shown is None or not found.inertia:
        return None
    j = found.names.index(shown.marker)
    other = _motion(found.t, (shown.marker,), found.simulated[:, [j]])
    if other is None or shown.ringing is None or other.ringing is None:
        return None
    return shown.ringing, other.ringing


def _frequency(found: Difference, shown: RecordedMotion | None) -> Cause | None:
    """The simulation on a clock that runs as fast as it rings too slowly."""
    rung = _rung(found, shown)
    if rung is None:
        return None
    ratio = rung[0].frequency / rung[1].frequency
    since = found.t[0] + ratio * (found.t - found.t[0])
    return Cause(
        "modulus or density", found.explained(_at(found, since)),
        f"it rings at {rung[0].frequency:.4g} Hz, simulated at {rung[1].frequency:.4g} Hz: "
        f"consistent with {ratio**2:.3g} times the given E / rho",
        "weigh the body (rho); identify E on a static log; --set material.E=VALUE",
    )  # fmt: skip


def _damping(found: Difference, shown: RecordedMotion | None) -> Cause | None:
    """The simulated swing about its end fades as the recorded one does."""
    rung = _rung(found, shown)
    if rung is None:
        return None
    faster = 2 * np.pi * (rung[0].frequency * rung[0].damping - rung[1].frequency * rung[1].damping)
    last = np.nanmean(found.simulated[-max(len(found.t) // 4, 1) :], axis=0)
    fade = np.exp(-np.clip(faster * (found.t - found.t[0]), -5, 50))[:, None, None]
    return Cause(
        "damping", found.explained(last + (found.simulated - last) * fade),
        f"its ring-down has a ratio of {rung[0].damping:.3g}, simulated {rung[1].damping:.3g}",
        "identify it on the first part: motion.fit_window=SECONDS",
    )  # fmt: skip


def _law(found: Difference, shown: RecordedMotion | None) -> Cause | None:
    """A part that grows as the cube of the motion, beyond one in proportion to it."""
    u, y = found.simulated, found.measured
    cube = u * np.linalg.norm(np.nan_to_num(u), axis=2, keepdims=True) ** 2
    return Cause(
        "law", found.explained(_fit((u, cube), y)) - found.explained(_fit((u,), y)),
        "the residual grows faster than the motion: another law at large strain",
        'add a method with another law: moving("large", "neo_hooke"), or solid("...", "neo_hooke")',
    )  # fmt: skip


def _loop(found: Difference, shown: RecordedMotion | None) -> Cause | None:
    """Another sign where the motion goes back: friction in a support or contact, or a relaxing
    material."""
    u, y = found.simulated, found.measured
    if found.inertia:
        return None  # a loop is a lag there, or damping
    back = np.abs(u) * np.sign(np.nan_to_num(np.gradient(u, found.t, axis=0)))
    return Cause(
        "contact or friction", found.explained(_fit((u, back), y)) - found.explained(_fit((u,), y)),
        "the residual depends on whether the load rises or falls",
        "load and unload twice, at two speeds: relaxation depends on the speed, friction does "
        "not; put a marker on the support",
    )  # fmt: skip


def _clock(found: Difference, shown: RecordedMotion | None) -> Cause | None:
    """One lag for all markers."""
    if shown is None:
        return None
    whole = float(found.t[-1] - found.t[0])
    reach = _REACH * min(1 / shown.frequency if shown.frequency > 0 else whole, whole)
    lags = np.linspace(-reach, reach, _LAGS)
    shares = [found.explained(_at(found, found.t - lag)) for lag in lags]
    best = int(np.argmax(shares))
    lag = lags[best]
    return Cause(
        "clock", shares[best],
        f"the recorded motion comes {1e3 * abs(lag):.3g} ms "
        f"{'later' if lag > 0 else 'earlier'} than the simulated one",
        "put the files on one clock (validate align), or set motion.start; tap the body once so "
        "that both record it",
    )  # fmt: skip


def _marker(found: Difference, shown: RecordedMotion | None) -> Cause | None:
    """Two markers whose names were exchanged, or one that is far worse than the others."""
    k = len(found.names)
    if k < 2 or not found.history.each:
        return None
    swapped = _swapped(found)
    if swapped:
        return swapped
    each = [_square((found.simulated - found.measured)[:, j]) for j in range(k)]
    off = np.maximum(np.array(each) - found.history.sd**2, 0.0)
    size = np.array([max(_square(found.measured[:, j]), 1e-30) for j in range(k)])
    odd = np.sqrt(off / size)
    worst = int(odd.argmax())
    rest = float(np.median(np.delete(odd, worst)))
    if not odd[worst] > _ODD * rest or not off[worst] > found.history.sd**2:
        return None
    share = float(off[worst] / off.sum())
    return Cause(
        "wrong marker", share * (1 - rest / odd[worst]),
        f"'{found.names[worst]}' is off by {100 * odd[worst]:.3g} % of its motion, the others "
        f"by {100 * rest:.3g} %",
        f"check that '{found.names[worst]}' is the marker of that name in the layout, and still "
        f"attached",
    )  # fmt: skip


def _swapped(found: Difference) -> Cause | None:
    """The best exchange of two names, where it removes most of the residual."""
    best: tuple[float, int, int] = (0.5, 0, 0)
    for i, j in permutations(range(len(found.names)), 2):
        if i < j:
            order = list(range(len(found.names)))
            order[i], order[j] = j, i
            best = max(best, (found.explained(found.simulated[:, order]), i, j))
    share, i, j = best
    if i == j:
        return None
    return Cause(
        "wrong marker", share,
        f"'{found.names[i]}' moves as '{found.names[j]}' should, and vice versa",
        "exchange the two names in the layout or the recording",
    )  # fmt: skip


def _zero(found: Difference, shown: RecordedMotion | None) -> Cause | None:
    """The same offset at all times: of each sensor its mean residual, where it is beyond noise."""
    off = np.nanmean(found.measured - found.simulated, axis=0)
    largest = float(np.abs(off).max())
    if not largest > found.history.sd:
        return None
    return Cause(
        "zero", found.explained(found.simulated + off),
        f"the residual has a mean of {with_unit(largest, found.history.unit)} at all times",
        "check the first samples, before the load: tare the sensor, or set seen.still",
    )  # fmt: skip


def _factor(found: Difference, shown: RecordedMotion | None) -> Cause | None:
    """One factor for everything: a wrong unit where it is one, else load over modulus."""
    u, y = found.simulated, found.measured
    seen = np.isfinite(u) & np.isfinite(y)
    factor = float((u[seen] @ y[seen]) / max(float(u[seen] @ u[seen]), 1e-300))
    share = found.explained(factor * u)
    unit = next((x for x in _UNITS if abs(factor / x - 1) < _UNIT), None)
    if unit:
        return Cause(
            "wrong unit", share, f"measured is {factor:.4g} times simulated: near {unit:.4g}",
            "measure one length of the body with a ruler, and one load with a scale",
        )  # fmt: skip
    of = "load over modulus" if found.history.unit == "m" else "the modulus"
    return Cause(
        "load or modulus", share, f"measured is {factor:.3g} times simulated, at all places "
                                  f"and times: consistent with that multiple of {of}",
        "identify E on a static log with a force; calibrate the force",
    )  # fmt: skip


def _fit(basis: Sequence[Floats], y: Floats) -> Floats:
    """The best combination of the basis."""
    seen = np.isfinite(y) & np.all([np.isfinite(b) for b in basis], axis=0)
    A = np.stack([b[seen] for b in basis], axis=1)
    factors = np.linalg.lstsq(A, y[seen], rcond=None)[0]
    return np.asarray(sum(c * b for c, b in zip(factors, basis, strict=True)))


def _at(found: Difference, t: Floats) -> Floats:
    """The simulated motion at other times, at rest before the first."""
    u = np.nan_to_num(found.simulated).reshape(len(found.t), -1)
    before = np.vstack([np.zeros(u.shape[1]), u])
    times = np.append(2 * found.t[0] - found.t[1], found.t)
    moved = np.stack([np.interp(t, times, column) for column in before.T], axis=1)
    return np.asarray(moved.reshape(found.simulated.shape))


# --- of a run -------------------------------------------------------------------------------------


def difference_of(followed: MethodRun, history: History, inertia: bool) -> Difference:
    """Return a history of a run, beside the body's first mode."""
    try:
        first = first_frequencies(followed.body, 1)[0]
    except (ValidateError, np.linalg.LinAlgError):
        first = None
    return Difference(history, inertia, first)


def explained_by(
    results: Sequence[MethodResult], differences: Callable[[str, Failed], Sequence[Difference]]
) -> tuple[str, tuple[Exhibit, ...]]:
    """Return a sentence with the likeliest cause of the first method with a check that fails, and a
    table of all causes by method and history; nothing where every check passes or nothing was
    recorded over time. `differences` are those of a method's observations with a failed
    quantity."""
    rows, sentence = [], ""
    for method in results:
        failed = {c.name.split("@")[0] for c in method.checks
                  if "differs" in (c.validation, c.acceptance)
                  or c.acceptance == "not good enough"}  # fmt: skip
        for found in differences(method.name, failed) if failed else ():
            causes = likely_causes(found)
            if causes and not sentence:
                names = ", ".join(c.name for c in causes[:3])
                sentence = (
                    f" Likely causes, in order: {names}: {causes[0].words}; {causes[0].tells}."
                )
            rows += [(method.label, found.history.name, i, c.name, 100 * min(c.share, 1.0), c.words,
                      c.tells) for i, c in enumerate(causes, 1)]  # fmt: skip
    if not rows:
        return "", ()
    table = NumberTable(
        "likely_causes",
        "Patterns of the residual, and the share of its mean square that each cause explains. "
        "Shares overlap: they rank causes but do not prove one.",
        ("method", "of", "order", "cause", "share / %", "observation", "next check"),
        tuple(rows), below="next check",
    )  # fmt: skip
    return sentence, (Exhibit("likely-causes", "Likely causes of the difference", (),
                              tables=(table,)),)  # fmt: skip
