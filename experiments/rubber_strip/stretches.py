"""Stretches of a tracked strip, along it and across: affine maps of the planes of its patches."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats
from validate.errors import RecordingError

_LEAST = 6  # points of a patch that are seen
Seen = NDArray[np.bool_]


@dataclass(frozen=True)
class Stretches:
    """Of patches from one end to the other: `axial`, `across` (nt, p), 1 in the first state.

    `sd_axial`, `sd_across`: standard deviation of their mean over the patches from what the points
    of a patch scatter about its affine map, in the first state after rest.
    """

    axial: Floats
    across: Floats
    sd_axial: float
    sd_across: float

    @property
    def ratio(self) -> Floats:
        """-ln(across)/ln(axial) (nt - 1, p) of the states after the first."""
        return -np.log(self.across[1:]) / np.log(self.axial[1:])


def stretches(x: Floats, patches: int) -> Stretches:
    """From positions x (nt, n, 3) m, NaN = not seen; the first state is at rest.

    Raises `RecordingError` for fewer than two states or patches, and a patch in which fewer than
    six points are seen.
    """
    seen: Seen = np.asarray(np.isfinite(x).all(axis=2))
    if len(x) < 2 or patches < 2:
        raise RecordingError(f"{len(x)} states in {patches} patches: at least two of both")
    if seen[0].sum() < _LEAST * patches:
        raise RecordingError(
            f"{seen[0].sum()} points seen at rest, {_LEAST * patches} needed for {patches} "
            "patches; --set patches= fewer"
        )
    x, seen = x[:, seen[0]], seen[:, seen[0]]
    axis = np.linalg.svd(x[0] - x[0].mean(axis=0), full_matrices=False)[2][0]
    order = np.argsort(x[0] @ axis, kind="stable")
    found = [_patch(x[:, part], seen[:, part], axis) for part in np.array_split(order, patches)]
    axial, across = (np.stack([one[i] for one in found], axis=1) for i in range(2))
    sds = np.array([one[2] for one in found])
    of_mean = np.sqrt((sds**2).mean(axis=0) / patches)
    return Stretches(axial, across, float(of_mean[0]), float(of_mean[1]))


def _patch(x: Floats, seen: Seen, axis: Floats) -> tuple[Floats, Floats, Floats]:
    """Stretches (nt,) of fibres along the axis and across it; their standard deviations (2,)."""
    few = int(seen.sum(axis=1).min())
    if few < _LEAST:
        state = int(np.argmin(seen.sum(axis=1)))
        raise RecordingError(
            f"state {state}: {few} of {x.shape[1]} points of a patch are seen, {_LEAST} needed; "
            "--set patches= fewer"
        )
    rest = x[0] - x[0].mean(axis=0)
    normal = np.linalg.svd(rest, full_matrices=False)[2][2]
    along = axis - (axis @ normal) * normal
    along /= np.linalg.norm(along)
    plane = rest @ np.stack([along, np.cross(normal, along)], axis=1)
    maps = [_affine(plane[s], state[s] - rest[s]) for state, s in zip(x, seen, strict=True)]
    F = np.array([G for G, _ in maps]) + np.stack([along, np.cross(normal, along)], axis=0)
    lengths = np.linalg.norm(F, axis=2)
    noise = maps[1][1] / np.sqrt((plane**2).sum(axis=0))
    return lengths[:, 0], lengths[:, 1], noise


def _affine(plane: Floats, moved: Floats) -> tuple[Floats, float]:
    """Displacement gradient (2, 3) of moved (k, 3) over the plane (k, 2), and the rms of what is
    left, a component."""
    A = np.column_stack([plane, np.ones(len(plane))])
    G, *_ = np.linalg.lstsq(A, moved, rcond=None)
    left = moved - A @ G
    return np.asarray(G[:2]), float(np.sqrt((left**2).sum() / (3 * (len(plane) - 3))))
