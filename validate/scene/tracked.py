"""Displacements prescribed on a set of nodes, interpolated from tracked points with their noise."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.interpolate import RBFInterpolator

from validate.arrays import Floats, checked
from validate.errors import SceneError
from validate.scene.select import Place

_AXES = "xyz"
_NOTHING = 1e-9  # singular value, of the largest, that points do not determine


@dataclass(frozen=True)
class Prescribed:
    """A set of nodes that follows `points` (label and place m), whose displacements are inputs.

    `interpolation`: "rigid" is the small rigid motion nearest to what was tracked (3 points, 2 in
    2-D), "affine" the nearest affine one (4, 3 in 2-D), "radial" goes through every point (linear
    radial functions). All are linear in what was tracked: `covariance` (p d, p d) m^2 of the
    inputs, point by point, x y z, enters u_input (`replay.uncertain_drives`). Raises `SceneError`
    for points that do not determine the motion, and for what is no covariance.
    """

    name: str
    facets: Place
    points: tuple[tuple[str, tuple[float, ...]], ...]
    interpolation: Literal["rigid", "affine", "radial"] = "rigid"
    covariance: tuple[tuple[float, ...], ...] | None = None

    def __post_init__(self) -> None:
        labels = [label for label, _ in self.points]
        if not labels or len(set(labels)) < len(labels):
            raise SceneError(f"'{self.name}': {len(labels)} tracked points, each needs a label")
        sizes = {len(place) for _, place in self.points}
        if sizes not in ({2}, {3}):
            raise SceneError(f"'{self.name}': tracked points of {sorted(sizes)} coordinates")
        checked(self.places, f"points of '{self.name}' [m]", (None, None), error=SceneError)
        self.columns(self.places)
        if self.covariance is not None:
            size = self.places.size
            P = checked(self.covariance, f"covariance of '{self.name}' [m^2]", (size, size),
                        error=SceneError)  # fmt: skip
            least = float(np.linalg.eigvalsh((P + P.T) / 2).min())
            if not np.allclose(P, P.T, rtol=1e-9, atol=0) or least < -1e-9 * np.abs(P).max():
                raise SceneError(
                    f"covariance of '{self.name}': it must be symmetric with eigenvalues of at "
                    f"least 0, the least is {least:.3g} m^2"
                )

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
        if self.interpolation == "rigid":
            at, to = (_rigid(y, self.places) for y in (self.places, x))
            return np.asarray(to @ self._inverse(at))
        return np.asarray(np.kron(self._shares(x), np.eye(d)), dtype=np.float64)

    def _shares(self, x: Floats) -> Floats:
        at, to = (_affine(y, self.places) for y in (self.places, x))
        if self.interpolation == "affine":
            return np.asarray(to @ self._inverse(at))
        full = np.linalg.matrix_rank(at, tol=_NOTHING) == at.shape[1]
        through = RBFInterpolator(
            self.places, np.eye(len(at)), kernel="linear", degree=1 if full else 0
        )
        return np.asarray(through(x))

    def _inverse(self, at: Floats) -> Floats:
        sizes = np.linalg.svd(at, compute_uv=False)
        found = int((sizes > _NOTHING * sizes.max()).sum())
        if found < at.shape[1]:
            raise SceneError(
                f"'{self.name}': {len(self.points)} tracked points determine {found} of the "
                f"{at.shape[1]} numbers of a {self.interpolation} motion; track more points, not "
                "in one line or plane, or take radial"
            )
        return np.asarray(np.linalg.pinv(at))

    def deviations(self, sd: float = 0.0) -> Floats:
        """Deviations (r, p d) m of one standard deviation each, whose outer products add up to what
        of the covariance the set follows; `sd` m of every coordinate where none is given.

        A rigid set follows six motions (3 in 2-D), an affine one twelve (6): what the points' noise
        has beyond them moves nothing.
        """
        P = sd**2 * np.eye(self.places.size)
        if self.covariance is not None:
            P = np.array(self.covariance)
        at = self._motions()
        if at is not None:
            back = np.linalg.pinv(at)
            P = back @ P @ back.T
        sizes, vectors = np.linalg.eigh(P)
        kept = sizes > 1e-12 * max(float(sizes.max()), 1e-300)
        own = np.asarray((np.sqrt(sizes[kept]) * vectors[:, kept]).T)
        return own if at is None else np.asarray(own @ at.T)

    def _motions(self) -> Floats | None:
        """Displacements (p d, m) m of the points in every motion that the set can follow; None
        where it goes through every point."""
        if self.interpolation == "radial":
            return None
        if self.interpolation == "rigid":
            return _rigid(self.places, self.places)
        shares = _affine(self.places, self.places)
        return np.asarray(np.kron(shares, np.eye(self.places.shape[1])), dtype=np.float64)


def _affine(x: Floats, around: Floats) -> Floats:
    """1 and the places (k, d + 1), of the points' size about their middle."""
    middle, size = around.mean(axis=0), max(float(np.ptp(around, axis=0).max()), 1e-300)
    return np.hstack([np.ones((len(x), 1)), (x - middle) / size])


def _rigid(x: Floats, around: Floats) -> Floats:
    """Motions (k d, 3 or 6): translations and small rotations about the middle of the points."""
    k, d = x.shape
    y = _affine(x, around)[:, 1:]
    planes = [(0, 1)] if d == 2 else [(1, 2), (2, 0), (0, 1)]
    motions = np.zeros((k, d, d + len(planes)))
    for c in range(d):
        motions[:, c, c] = 1.0
    for r, (i, j) in enumerate(planes):
        motions[:, i, d + r], motions[:, j, d + r] = -y[:, j], y[:, i]
    return motions.reshape(k * d, -1)
