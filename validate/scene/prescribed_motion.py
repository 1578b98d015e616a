"""Prescribed displacements of nodes that follow tracked points as a rigid body."""

from dataclasses import MISSING, dataclass
from functools import cached_property

import numpy as np

from validate.arrays import Floats, checked
from validate.errors import SceneError
from validate.parameters import quantity
from validate.scene.places import Place

_AXES = "xyz"
_NOTHING = 1e-9  # singular value, of the largest, that points do not determine


@dataclass(frozen=True)
class Prescribed:
    """A set of nodes that follows `points` (label and place m), whose displacements are inputs.

    It moves by the small rigid motion nearest to what was tracked (3 points, 2 in 2-D). Declared,
    points may be `labels` alone: where they are, the recording says. Raises `SceneError` for points
    that do not determine the motion.
    """

    name: str
    facets: Place = quantity(MISSING, "1", "what follows the points")
    points: tuple[tuple[str, tuple[float, ...]], ...] = ()
    labels: tuple[str, ...] = quantity((), "1", "names of the points, where the recording has them")

    def __post_init__(self) -> None:
        if self.labels and not self.points:
            return
        labels = [label for label, _ in self.points]
        if not labels or len(set(labels)) < len(labels):
            raise SceneError(
                f"'{self.name}': {len(labels)} tracked points; expected one label for each"
            )
        sizes = {len(place) for _, place in self.points}
        if sizes not in ({2}, {3}):
            raise SceneError(f"'{self.name}': tracked points of {sorted(sizes)} coordinates")
        checked(self.places, f"points of '{self.name}' [m]", (None, None), error=SceneError)
        self.columns(self.places)

    @cached_property
    def places(self) -> Floats:
        """(p, d) m."""
        return np.array([place for _, place in self.points], dtype=np.float64)

    @property
    def inputs(self) -> tuple[str, ...]:
        """`<name>.<label>.<axis>` (p d,)."""
        axes = _AXES[: self.places.shape[1]]
        return tuple(f"{self.name}.{label}.{axis}" for label, _ in self.points for axis in axes)

    def columns(self, x: Floats) -> Floats:
        """Displacements (k d, p d) m of nodes at x (k, d) m per metre of every input."""
        d = x.shape[1]
        if d != self.places.shape[1]:
            raise SceneError(
                f"'{self.name}': points of {self.places.shape[1]} coordinates in {d} dimensions"
            )
        at = self._motions()
        sizes = np.linalg.svd(at, compute_uv=False)
        found = int((sizes > _NOTHING * sizes.max()).sum())
        if found < at.shape[1]:
            raise SceneError(
                f"'{self.name}': {len(self.points)} tracked points determine {found} of the "
                f"{at.shape[1]} numbers of a rigid motion; track more points, not in one line"
            )
        return np.asarray(_rigid(x, self.places) @ np.linalg.pinv(at))

    def deviations(self, sd: float) -> Floats:
        """Deviations (6 or 3, p d) m of one standard deviation each, whose outer products add up to
        what the set follows of `sd` m of every coordinate.

        What the points' noise has beyond its rigid motions moves nothing.
        """
        motions, _ = np.linalg.qr(self._motions())
        return np.asarray(sd * motions.T)

    def _motions(self) -> Floats:
        """Displacements (p d, 6 or 3) m of the points in every rigid motion."""
        return _rigid(self.places, self.places)


def _rigid(x: Floats, around: Floats) -> Floats:
    """Motions (k d, 3 or 6): translations and small rotations about the middle of the points."""
    k, d = x.shape
    middle, size = around.mean(axis=0), max(float(np.ptp(around, axis=0).max()), 1e-300)
    y = (x - middle) / size
    planes = [(0, 1)] if d == 2 else [(1, 2), (2, 0), (0, 1)]
    motions = np.zeros((k, d, d + len(planes)))
    for c in range(d):
        motions[:, c, c] = 1.0
    for r, (i, j) in enumerate(planes):
        motions[:, i, d + r], motions[:, j, d + r] = -y[:, j], y[:, i]
    return motions.reshape(k * d, -1)
