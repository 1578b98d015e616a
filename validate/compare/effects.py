"""Uncertain inputs, and the size of their effects against the noise of every sensor.

An effect is the difference between two models against the same measurement. Over k points with
noise sd it is seen with separation rms(difference) / sqrt(sd^2/k + shared^2), where `shared` is
what averaging does not remove: registration, mesh and inputs. Above 2 the sensor tells the two
apart.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats, rms
from validate.compare.residual import Residual
from validate.compare.score import max_length
from validate.compare.verdict import Sensitivity
from validate.errors import ComparisonError

TELLS_APART = 2.0


@dataclass(frozen=True)
class Change:
    """Change of one quantity by an effect: rms and largest, in `unit`, and its separation."""

    name: str
    rms: float
    max: float
    unit: str
    separation: float


@dataclass(frozen=True)
class Sensor:
    """A sensor that could be added: its quantity, its noise (SI) and its name."""

    name: str
    quantity: str
    sd: float


@dataclass(frozen=True)
class Effect:
    """One row of the error budget: cause, changed quantities, sensors that detect it or would."""

    name: str
    doc: str
    changes: tuple[Change, ...]
    seen_by: tuple[str, ...]
    would_see: tuple[str, ...]


def effect(
    name: str,
    doc: str,
    one: Mapping[str, Residual],
    other: Mapping[str, Residual],
    shared: Mapping[str, float],
    sensors: Sequence[Sensor],
) -> Effect:
    """Return the effect of going from one model to the other; `shared` (SI) per quantity's name."""
    names = [n for n in one if n in other and one[n].values.shape == other[n].values.shape]
    recorded = [n for n in names if one[n].sd > 0]
    changes = tuple(_change(one[n], other[n], one[n].sd, shared.get(n, 0.0)) for n in names)
    seen = tuple(c.name for c in changes if c.name in recorded and c.separation > TELLS_APART)
    would = tuple(
        s.name
        for s in sensors
        for n in names
        if one[n].quantity == s.quantity
        and (s.sd < one[n].sd or one[n].sd == 0)
        and _change(one[n], other[n], s.sd, shared.get(n, 0.0)).separation > TELLS_APART
    )
    return Effect(name, doc, changes, seen, tuple(dict.fromkeys(would)))


def _change(one: Residual, other: Residual, sd: float, shared: float) -> Change:
    moved = other.values - one.values
    noise = np.sqrt(moved.shape[1] * (sd**2 / one.count + one.systematic**2) + shared**2)
    size = rms(moved)
    # Without a measured noise there is no sensor that could see the change.
    separation = float(size / noise) if sd > 0 else 0.0
    return Change(one.name, size, max_length(moved), one.unit, separation)


# --- uncertain inputs: source of their ranges, and additivity of their effects -------------------

REACH = float(np.sqrt(3.0))  # an input lies uniformly within so many standard uncertainties
_ROUNDING = 1e-9
_TABLES = 200  # of which the one with the least correlated columns is taken


@dataclass(frozen=True)
class Declared:
    """An uncertain input: its range in words, and where that comes from or "assumed"."""

    name: str
    range: str
    source: str


@dataclass(frozen=True)
class Joint:
    """u_input of a residual by first order and by `draws` of all inputs at once, in `unit`."""

    name: str
    unit: str
    first_order: float
    sampled: float
    draws: int

    @property
    def percent(self) -> float | None:
        """How much more the sample shows than first order, %; None without a first order."""
        return 100 * (self.sampled / self.first_order - 1) if self.first_order else None


def joint_draws(draws: int, inputs: int, seed: int = 1) -> Floats:
    """(draws, inputs) standard uncertainties: a Latin hypercube of uniform ranges.

    Centred strata (McKay, Beckman, Conover, Technometrics 21 (1979)); of `_TABLES` permutations the
    one whose columns are least correlated, since a chance correlation would pass for an effect.
    """
    rng = np.random.default_rng(seed)
    strata = REACH * ((2 * np.arange(draws) + 1) / draws - 1)
    tables = [rng.permuted(np.tile(strata, (inputs, 1)), axis=1).T for _ in range(_TABLES)]
    products = [table.T @ table for table in tables]
    correlated = [float(np.abs(p - np.diag(np.diag(p))).max()) for p in products]
    return tables[int(np.argmin(correlated))]


def joint(base: Residual, parts: Sequence[Sensitivity], drawn: Sequence[Residual]) -> Joint:
    """Both u_input of one residual; the sample counts distances from what was simulated.

    What a range does on one side only (plates cannot rub less than not at all) is an error too.
    """
    first = float(np.sqrt(sum(rms(p.change.values) ** 2 for p in parts)))
    sampled = rms(np.array([[rms(difference(one, base))] for one in drawn]))
    least = _ROUNDING * rms(base.values)  # an input that moves nothing leaves rounding
    first, sampled = (u if u > least else 0.0 for u in (first, sampled))
    return Joint(base.name, base.unit, first, sampled, len(drawn))


def difference(moved: Residual, base: Residual) -> Floats:
    """What an input changed of a residual, for every point of the `base` (k, c).

    An input that moves the ends of a window (a height, of strains) lets samples in or out. Those
    that both have are found by what was measured; at an end that only the base has, the change is
    that of the next sample. Raises `ComparisonError` where no samples are the same.
    """
    if moved.values.shape == base.values.shape:
        return np.asarray(moved.values - base.values)
    a = np.zeros((0, 1)) if moved.reference is None else moved.reference
    b = np.zeros((0, 1)) if base.reference is None else base.reference
    starts = range(1 - len(b), len(a)) if len(a) and len(b) else range(0)
    for start in sorted(starts, key=abs):
        rows = np.arange(len(base.values)) + start
        both = (rows >= 0) & (rows < len(moved.values))
        if 2 * both.sum() > len(rows) and np.array_equal(a[rows[both]], b[both]):
            first, last = np.flatnonzero(both)[[0, -1]]
            change = moved.values[rows[both]] - base.values[both]
            edges = (first, len(rows) - 1 - last)
            return np.asarray(np.pad(change, (edges, (0, 0)), mode="edge"))
    raise ComparisonError(
        f"{base.name}: {len(base.values)} samples, {len(moved.values)} with an input moved, and "
        "they are not the same ones; its uncertainty cannot be found"
    )
