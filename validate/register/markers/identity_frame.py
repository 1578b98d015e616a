"""Markers that are recorded in the body's frame, without a fit."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from validate.arrays import Floats
from validate.register.markers.measures import Reflection, Scale
from validate.register.markers.quality import Registration
from validate.register.markers.transform import Similarity


@dataclass(frozen=True)
class AsDeclared(Registration):
    """The identity, without residuals: how well the frames agree is the word of who declared it."""

    @property
    def fle(self) -> float:
        return 0.0

    def tre_at(self, points: ArrayLike) -> Floats:
        """Zeros (m,) m at points (m, d) m: what was declared has no error of a fit."""
        return np.zeros(len(np.asarray(points)))


def as_declared(names: Sequence[str], places: Floats, sd: float) -> AsDeclared:
    """Return the markers at places (k, 3) m of both frames, with noise `sd` m per axis."""
    return AsDeclared(
        Similarity(np.eye(3), np.zeros(3)), tuple(names), places, np.zeros_like(places), sd,
        "rigid", Reflection(0.0, np.inf), Scale(1.0, 0.0),
    )  # fmt: skip
