"""How large something was, measured and simulated: what relative bias and scatter are made of."""

import re
from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.compare.residual import Residual

# What a quantity is called in a statement over experiments: by a word of its name, else its unit.
_BY_WORD = (
    "displacement", "position", "force", "stress", "stretch", "frequency", "pressure", "strain",
)  # fmt: skip
_BY_UNIT = {
    "m": "displacement", "N": "force", "N/m": "force", "Pa": "stress", "Hz": "frequency",
    "m2": "area",
}  # fmt: skip
_PLACES = ("contour", "outline", "diameter", "radius", "landmark")


@dataclass(frozen=True)
class Size:
    """Rms lengths in the quantity's unit: measured, and simulated along what was measured.

    The measurement's independent noise is out of both; `u` is the standard uncertainty that it and
    what all points share leave in the measured one. Negative: simulated the other way.
    """

    measured: float
    simulated: float
    u: float


def kind_of(quantity: str, unit: str) -> str:
    """What was measured, in a word; "" where none fits."""
    words = re.split(r"[._]", quantity)
    if named := [word for word in words if word in _BY_WORD and _fits(word, unit)]:
        return named[0]
    if unit == "m" and words[0] in _PLACES:
        return "position"
    return _BY_UNIT.get(unit, "")


def _fits(word: str, unit: str) -> bool:
    """An extensometer may be called stretch, and measure metres."""
    return unit == "1" or word not in ("stretch", "strain")


def size_of(residual: Residual) -> Size | None:
    """The size of what was compared; None without a measured one, or with noise alone.

    Of many points: simulated = b measured, b the least-squares factor of the simulated values on
    the measured ones through zero, <s, m>/<m, m>, with the noise's share c sd^2 out of <m, m>.
    """
    m = _measured(residual)
    if m is None:
        return None
    d, (k, c) = residual.values, residual.values.shape
    noise = c * residual.sd**2 if k * c > 1 else 0.0
    squared = float((m**2).sum() / k) - noise
    if not squared > 0:
        return None
    measured = float(np.sqrt(squared))
    along = (float((d * m).sum() / k) + noise) / measured
    own = residual.sd * np.sqrt(c / (residual.freedom or k * c))
    return Size(measured, measured + along, float(np.hypot(own, residual.systematic)))


def _measured(residual: Residual) -> Floats | None:
    if residual.reference is not None:
        return residual.reference
    return None if residual.measured is None else np.array([[residual.measured]])
