"""Separability of effects: size of an effect against the noise of every sensor.

An effect is the difference between two models against the same measurement. Over k points with
noise sd it is seen with separation rms(difference) / sqrt(sd^2/k + shared^2), where `shared` is
what averaging does not remove: registration, mesh and inputs. Above 2 the sensor tells the two
apart.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from validate.arrays import rms
from validate.compare.residual import Residual
from validate.compare.score import max_length

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
