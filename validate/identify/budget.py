"""Uncertainty budget of an identified value after GUM (JCGM 100), over repeated tests, too.

from validate.identify.budget import IdentifiedValue
E = IdentifiedValue("material.E", 25e3, "Pa", "neo_hooke", "force@fit", {"noise": 90.0}, 200)
print(E.u, E.interval, E.dominant)

Lack-of-fit F test: is the residual of a fitted curve noise or a systematic shape?

A wrong law leaves a residual that bends smoothly with the load. Legendre polynomials of degree 2
to 4, freed of what the fit itself can follow, are fitted to the residual; their mean square over
that of the noise has Fisher's distribution where the law is right. Noise is taken from second
differences, which a smooth misfit hardly enters, times the dependence of successive samples.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import hypot, inf, isfinite, sqrt
from types import MappingProxyType
from typing import Self, cast

import numpy as np
from numpy.polynomial import legendre
from scipy.special import fdtrc, ndtri, stdtrit

from validate.arrays import Floats, Ints, rms
from validate.errors import RecordingError, UsageError
from validate.identify.modulus import MIN_SAMPLES, TestKind, load_noise, loading, zero_of
from validate.recording.merge import REPEATS, SHARE
from validate.recording.motion_capture.text_rows import ASSUMED
from validate.recording.types import Record, Recording, Signal, Source, clock_of

# --- Values of repeats on specimens: every specimen has one vote, however many logs it has.


@dataclass(frozen=True)
class Votes:
    """Means by specimen; `between`: their sd (None for one), `within`: sd of repeats of one (None
    where each has one log); in the unit of the values."""

    means: dict[str, float]
    between: float | None
    within: float | None
    logs: int

    @property
    def mean(self) -> float:
        return float(np.mean(list(self.means.values())))

    @property
    def sd_mean(self) -> float | None:
        """Of the mean over specimens: by what scatters most, specimens, else repeats; None where
        neither is known."""
        if self.between is not None:
            return float(self.between / np.sqrt(len(self.means)))
        return None if self.within is None else float(self.within / np.sqrt(self.logs))

    @classmethod
    def by_specimen(cls, values: Sequence[float], specimens: Sequence[str]) -> Self:
        """Values of logs, and the specimen of each; every specimen has one vote."""
        of = {s: np.array([v for v, o in zip(values, specimens, strict=True) if o == s])
              for s in dict.fromkeys(specimens)}  # fmt: skip
        means = {s: float(v.mean()) for s, v in of.items()}
        between = float(np.std(list(means.values()), ddof=1)) if len(means) > 1 else None
        freedom = len(values) - len(means)
        spread = sum(float(((v - v.mean()) ** 2).sum()) for v in of.values())
        within = float(np.sqrt(spread / freedom)) if freedom > 0 else None
        return cls(means, between, within, len(values))


# -------------------------------------------------------------------------------------------------

NOISE = "noise"
_COVERED = 0.95
_FEWEST = 10  # samples from which an autocorrelation is summed


@dataclass(frozen=True)
class IdentifiedValue:
    """A value in `unit` with its standard uncertainties by term, in the same unit.

    `by` is the method whose law was fitted, `on` the data, `count` their number. `freedom` is the
    number of degrees of freedom of the term "noise". `correlation` says what it has in common with
    the predictions, `finding` how the law's curve departs from the data ("": it does not).
    """

    name: str
    value: float
    unit: str
    by: str
    on: str
    parts: Mapping[str, float]
    count: int
    freedom: float = inf
    correlation: str = ""
    finding: str = ""
    given: tuple[float, float] | None = field(default=None)

    def __post_init__(self) -> None:
        object.__setattr__(self, "parts", MappingProxyType(dict(self.parts)))

    @property
    def u(self) -> float:
        """The combined standard uncertainty: the root of the sum of squares."""
        return hypot(*self.parts.values())

    @property
    def factor(self) -> float:
        """The coverage factor of 95 %: Student's, by the Welch-Satterthwaite formula (G.4)."""
        noise = self.parts.get(NOISE, 0.0)
        if not isfinite(self.freedom) or noise == 0 or not isfinite(self.u):
            return float(ndtri(0.5 + _COVERED / 2))
        freedom = max(self.freedom, 1.0) * (self.u / noise) ** 4
        return float(stdtrit(freedom, 0.5 + _COVERED / 2))

    @property
    def interval(self) -> tuple[float, float]:
        """The ends of the 95 % interval; those of a profile where one was `given`."""
        if self.given is not None:
            return self.given
        return self.value - self.factor * self.u, self.value + self.factor * self.u

    @property
    def dominant(self) -> str:
        """The largest term; "" without any."""
        return max(self.parts, key=lambda name: self.parts[name], default="")


def dependence(residual: Floats) -> float:
    """How many successive residuals (n,) count as one: 1 + 2 sum of their autocorrelations.

    The sum ends before the first pair of neighbouring lags that is not positive (Geyer 1992,
    initial positive sequence), so it is at least 1 and at most n / 2.
    """
    n = len(residual)
    r = residual - residual.mean()
    power = float(r @ r)
    if n < _FEWEST or power == 0:
        return 1.0
    rho = np.correlate(r, r, "full")[n - 1 :] / power
    total = -1.0
    for k in range(0, n // 2, 2):
        pair = float(rho[k] + rho[k + 1])
        if pair <= 0:
            break
        total += 2 * pair
    return float(np.clip(total, 1.0, n / 2))


DEGREES = (2, 3, 4)
BY_CHANCE = 0.01  # how often a right law is called wrong
MATERIAL = 1.0  # in u_val: a smaller misfit changes no verdict, however clearly it is seen
_FEWEST_PATTERN = 12  # samples


@dataclass(frozen=True)
class Pattern:
    """The smooth part (n,) of a residual, N; the chance that noise alone looks like it; and whether
    the measured force rises faster than the fitted curve at the largest loads."""

    smooth: Floats
    chance: float
    stiffens: bool

    @property
    def rms(self) -> float:
        return rms(self.smooth[:, None])

    @property
    def significant(self) -> bool:
        return self.chance < BY_CHANCE


def pattern(
    load: Floats, residual: Floats, followed: Floats, sd: float = 0.0, times: float = 1.0
) -> Pattern | None:
    """Of `residual` (n,), measured less fitted, against `load` (n,) rising; None for few samples.

    `followed` (n, p) are the shapes that the fit can follow by itself: its derivatives by what was
    fitted. `sd` is the sensor's: noise is never taken as less, and at least `times` samples count
    as one.
    """
    n = len(load)
    if n < _FEWEST_PATTERN or np.ptp(load) == 0:
        return None
    x = 2 * (load - load.min()) / np.ptp(load) - 1
    shapes = np.stack([legendre.Legendre.basis(k)(x) for k in DEGREES], axis=1)
    q, _ = np.linalg.qr(followed)
    free = shapes - q @ (q.T @ shapes)
    own, size, _ = np.linalg.svd(free, full_matrices=False)
    own = own[:, size > 1e-8 * max(size.max(), 1e-300)]
    left = residual - q @ (q.T @ residual)
    amounts = own.T @ left
    smooth = own @ amounts
    rough = left - smooth
    freedom = n - q.shape[1] - own.shape[1]
    if freedom < 2 or not len(amounts):
        return None
    times = max(dependence(rough), times)
    noise = max(sqrt(float(rough @ rough) / freedom), sd)
    least = 1e-9 * float(np.abs(residual).max(initial=0.0)) or 1e-300
    ratio = float(amounts @ amounts) / len(amounts) / (times * max(noise, least) ** 2)
    chance = float(fdtrc(len(amounts), max(freedom / times, 1.0), ratio))
    # The second coefficient of the smooth part: positive where both ends lie above the
    # middle.
    return Pattern(smooth, chance, bool(float(legendre.legfit(x, smooth, max(DEGREES))[2]) > 0))


# --- repeated tests of one or several specimens as one recording: mean and scatter ---------------

_TOE = 0.01  # of the way: where contact is told apart, see `zero_of`
_ALIKE = 0.01  # sizes and speeds of repeats differ by less, relative
_ASK = "--specimens one (all of one specimen), each, or a label for every log, as A,A,B"


@dataclass(frozen=True)
class Loading:
    """A log's loading from contact: t s, displacement m and force N (n,), displacement rising."""

    t: Floats
    d: Floats
    force: Floats
    words: str


def labels_of(said: str | None, logs: Sequence[Recording]) -> tuple[str, ...]:
    """Return the specimen of each log, as the user says; raises `UsageError` where nobody says it,
    and for recordings that are no logs of a testing machine."""
    names = [log.name for log in logs]
    for log in logs:
        if not {"displacement", "force"} <= set(log.signals) or "specimen" not in log.metadata:
            raise UsageError(
                f"{log.name} is not a log of a testing machine; only such logs can be repeats. "
                "Import one file at a time, and combine their streams with `validate merge`"
            )
    if said is None:
        raise UsageError(
            f"{len(logs)} logs, {', '.join(names[:8])}: their specimens are not declared; {_ASK}"
        )
    if said in ("one", "each"):
        return tuple("1" if said == "one" else str(i + 1) for i in range(len(logs)))
    labels = tuple(label.strip() for label in said.split(","))
    if len(labels) != len(logs) or not all(labels):
        raise UsageError(
            f"--specimens {said}: {len(labels)} labels for {len(logs)} logs, in the order "
            f"{', '.join(names[:8])}; {_ASK}"
        )
    return labels


def averaged(logs: Sequence[Recording], labels: Sequence[str], name: str) -> Recording:
    """One recording of at least two logs of one test.

    Signals `displacement` (n, 1) m and `force` (n, 1) N are the mean over specimens on the common
    path, compression positive, `force/sd` the sd of the mean at each point, and
    `displacement/<log>`, `force/<log>` the logs as they were read. The record `repeats` holds their
    counts and the relative standard uncertainty that judges the mean. Raises `RecordingError` for
    logs of different tests or sizes, and for less than 10 samples in common.
    """
    if len(logs) < 2:
        raise RecordingError(f"{len(logs)} logs; a mean needs at least 2")
    test, sizes = _alike(logs)
    names = tuple(log.name for log in logs)
    alone = len(set(names)) == len(names)
    names = names if alone else tuple(f"{i + 1}-{name}" for i, name in enumerate(names))
    paths = [_loaded(log, test) for log in logs]
    start, end = max(p.d[0] for p in paths), min(p.d[-1] for p in paths)
    count = min(int(((p.d >= start) & (p.d <= end)).sum()) for p in paths)
    if not end > start or count < MIN_SAMPLES:
        raise RecordingError(
            f"the logs share the displacements {1e3 * start:.4g} to {1e3 * end:.4g} mm with "
            f"{count} samples, at least {MIN_SAMPLES} are needed"
        )
    d = np.linspace(start, end, count)
    forces = np.array([np.interp(d, p.d, p.force) for p in paths])
    votes = [Votes.by_specimen(column, labels) for column in forces.T.tolist()]
    mean, sd = np.array([v.mean for v in votes]), np.array([v.sd_mean or 0.0 for v in votes])
    t = np.mean([np.interp(d, p.d, p.t) for p in paths], axis=0)
    sign = 1.0 if test == "compression" else -1.0
    # Of the mean: each log counts one over its specimen's logs, over the specimens.
    often = Counter(labels)
    each = [
        load_noise(log.signals["force"].y[:, 0]) / (often[label] * len(often))
        for log, label in zip(logs, labels, strict=True)
    ]
    signals = {
        "displacement": Signal(t, sign * d[:, None], "m", 0.0, "machine"),
        "force": Signal(t, sign * mean[:, None], "N", float(np.linalg.norm(each)), "machine"),
        "force/sd": Signal(t, sd[:, None], "N", 0.0, "machine"),
    }
    signals |= {
        f"{topic}/{own}": log.signals[topic]
        for own, log in zip(names, logs, strict=True) for topic in ("displacement", "force")
    }  # fmt: skip
    share = rms(sd[:, None]) / rms(mean[:, None])
    told = _told(votes[-1], labels, share, paths, names, float(d[-1]))
    stamps = {k: np.round(s.t * 1e9).astype(np.int64) for k, s in signals.items()}
    records = {
        f"{key}/{own}": record
        for own, log in zip(names, logs, strict=True)
        for key, record in log.metadata.items()
    }
    return Recording(
        name=name,
        source=Source(" + ".join(log.source.path for log in logs), "", 0, "mean of repeats"),
        t0_ns=0,
        signals=signals,
        clock={k: clock_of(k, None, ns, ns) for k, ns in stamps.items()},
        metadata={"specimen": sizes, **told, **records},
    )


def _alike(logs: Sequence[Recording]) -> tuple[TestKind, Record]:
    """The one test, and the sizes of all logs, their means where they hardly differ."""
    records = [dict(log.record("specimen")) for log in logs]
    tests = {r.get("test", "") for r in records}
    if len(tests) > 1 or not tests <= {"compression", "tension"}:
        raise RecordingError(
            f"repeats must be of one test, these are of {', '.join(sorted(tests))}; import "
            "each separately with --map test=compression or --map test=tension"
        )
    found: dict[str, str] = {}
    for key in sorted({k for r in records for k in r} - {"test", "speed_m_per_s"}):
        values = [float(r[key]) for r in records if key in r]
        if len(values) < len(logs) or np.ptp(values) > _ALIKE * np.mean(values):
            shown = ", ".join(f"{v:.6g}" for v in values[:8])
            raise RecordingError(
                f"repeats must be of one size, but {key} of {len(values)} of {len(logs)} logs "
                f"is {shown}; leave the others out"
            )
        found[key] = repr(float(np.mean(values)))
    (test,) = tests
    return cast("TestKind", test), {**found, "test": test}


def _loaded(recording: Recording, test: TestKind) -> Loading:
    log = loading(recording, test)
    way = float(np.ptp(log.d))
    near = log.force[: max(MIN_SAMPLES, int(np.argmax(log.d - log.d[0] > _TOE * way)))]
    offset, contact = zero_of(log.d, log.force, load_noise(near), _TOE * way)
    last = int(np.argmax(log.d)) + 1
    # Indices of the first loading whose displacement exceeds every one before.
    before = np.maximum.accumulate(np.append(-np.inf, log.d[: last - 1]))
    kept: Ints = np.flatnonzero((log.d[:last] > before) & (log.d[:last] >= contact))

    words = f"contact at {1e3 * contact + 0.0:.4g} mm, {offset:.4g} N taken off"
    if last < len(log.d):
        words += f", {len(log.d) - last} rows after the largest displacement not in the mean"
    return Loading(
        log.t[kept] - log.t[kept][0], log.d[kept] - contact, log.force[kept] - offset, words
    )


def _told(
    last: Votes,
    labels: Sequence[str],
    share: float,
    paths: Sequence[Loading],
    names: Sequence[str],
    end: float,
) -> dict[str, Record]:
    specimens = len(last.means)
    of = (
        "specimens"
        if specimens > 1
        else ("repeats of one specimen: the scatter between specimens is unknown")
    )
    many = "specimens" if specimens > 1 else "specimen"
    what = f"mean of {len(paths)} logs of {specimens} {many} to {1e3 * end:.4g} mm"
    durations = [float(np.interp(end, p.d, p.t)) for p in paths]
    speeds = np.ptp(durations) / np.mean(durations)
    about = {
        "repeats": f"{what}; {100 * share:.3g} % sd of the mean, of the scatter of {of}",
        **{f"zero of {own}": path.words for own, path in zip(names, paths, strict=True)},
    }
    if speeds > _ALIKE:
        about["speeds"] = f"differ: {min(durations):.4g} to {max(durations):.4g} s for one way"
    record = {
        "logs": str(len(paths)),
        "specimens": str(specimens),
        "specimen of each": ", ".join(f"{n}: {s}" for n, s in zip(names, labels, strict=True)),
        SHARE: repr(share),
    }
    return {REPEATS: record, ASSUMED: about}
