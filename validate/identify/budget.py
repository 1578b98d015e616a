"""Uncertainty budget of an identified value after GUM (JCGM 100), and a test for lack of fit.

from validate.identify.budget import IdentifiedValue
E = IdentifiedValue("material.E", 25e3, "Pa", "neo_hooke", "force@fit", {"noise": 90.0}, 200)
print(E.u, E.interval, E.dominant)

Lack-of-fit F test: is the residual of a fitted curve noise or a systematic shape?

A wrong law leaves a residual that bends smoothly with the load. Legendre polynomials of degree 2
to 4, freed of what the fit itself can follow, are fitted to the residual; their mean square over
that of the noise has Fisher's distribution where the law is right. Noise is taken from second
differences, which a smooth misfit hardly enters, times the dependence of successive samples.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import hypot, inf, isfinite, sqrt
from types import MappingProxyType

import numpy as np
from numpy.polynomial import legendre
from scipy.special import fdtrc, ndtri, stdtrit

from validate.arrays import Floats, rms

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


def by_specimen(values: Sequence[float], specimens: Sequence[str]) -> Votes:
    """Values of logs, and the specimen of each; every specimen has one vote."""
    of = {s: np.array([v for v, o in zip(values, specimens, strict=True) if o == s])
          for s in dict.fromkeys(specimens)}  # fmt: skip
    means = {s: float(v.mean()) for s, v in of.items()}
    between = float(np.std(list(means.values()), ddof=1)) if len(means) > 1 else None
    freedom = len(values) - len(means)
    spread = sum(float(((v - v.mean()) ** 2).sum()) for v in of.values())
    within = float(np.sqrt(spread / freedom)) if freedom > 0 else None
    return Votes(means, between, within, len(values))


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
