"""Compiled element loops of mixed hexahedra (hex8, mean dilatation) at large strain.

Blocks of 16 cells go lane by lane, as in `fem.kernels.explicit`. Two passes over the eight points
of a block: displacement gradients and the cells' mean of J - 1, then the isochoric stress of the
invariants (`fem.kernels.laws`) with the pressure of that mean. All eight points are integrated:
no zero-energy modes, so no stabilisation and no constant of one. The numpy reference is
`fem.large_strain.hyperelastic.Body`.

Geometry (blocks, 9, 25, 16): for every point 24 slopes dN_a/dX_j in rows 8 j + a and the weight;
then the card: kappa, C10, C01, C20, C30 in Pa, 1/V in 1/m3.
"""

from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.fem.kernels.laws import Four, energy_invariants, first_split
from validate.fem.kernels.tensors import Nine, combined, inlined, volume

LANES, POINTS, CORNERS = 16, 8, 8
ROWS = 25  # of a point: 24 slopes and the weight
_G, _U = 0, ROWS * LANES
_F = _U + 24 * LANES
_H = _F + 24 * LANES
_MEAN = _H + POINTS * 9 * LANES
_CARD = _MEAN + LANES
WORK = _CARD + 6 * LANES  # length of the workspace


@inlined
def _along(w: Floats, a: int, b: int) -> float:
    """Sum over a cell's corners of two groups of eight rows."""
    return float(
        w[a] * w[b] + w[a + 16] * w[b + 16] + w[a + 32] * w[b + 32] + w[a + 48] * w[b + 48]
        + w[a + 64] * w[b + 64] + w[a + 80] * w[b + 80] + w[a + 96] * w[b + 96]
        + w[a + 112] * w[b + 112]
    )  # fmt: skip


@inlined
def _gradient(w: Floats, l: int) -> Nine:
    """H at the point whose slopes are loaded."""
    u, v, t, g, h, k = _U + l, _U + l + 128, _U + l + 256, l, l + 128, l + 256
    return (
        _along(w, u, g), _along(w, u, h), _along(w, u, k),
        _along(w, v, g), _along(w, v, h), _along(w, v, k),
        _along(w, t, g), _along(w, t, h), _along(w, t, k),
    )  # fmt: skip


@inlined
def _stored(w: Floats, o: int) -> Nine:
    return (
        w[o], w[o + 16], w[o + 32], w[o + 48], w[o + 64], w[o + 80], w[o + 96], w[o + 112],
        w[o + 128],
    )  # fmt: skip


@inlined
def _store(w: Floats, o: int, H: Nine) -> None:
    w[o], w[o + 16], w[o + 32], w[o + 48], w[o + 64] = H[0], H[1], H[2], H[3], H[4]
    w[o + 80], w[o + 96], w[o + 112], w[o + 128] = H[5], H[6], H[7], H[8]


@inlined
def _load(w: Floats, to: int, rows: int, geometry: Floats, block: int, q: int) -> None:
    for k in range(rows):
        for l in range(LANES):
            w[to + k * LANES + l] = geometry[block, q, k, l]


@inlined
def _gather(w: Floats, cells: Any, block: int, u: Floats) -> None:
    """u of the corners in rows 8 i + a, forces and means cleared."""
    for a in range(CORNERS):
        for l in range(LANES):
            n, o = np.uint64(cells[block, a, l]), _U + a * LANES + l
            w[o] = u[n]
            w[o + 128] = u[n + np.uint64(1)]
            w[o + 256] = u[n + np.uint64(2)]
    for k in range(24 * LANES):
        w[_F + k] = 0.0
    for l in range(LANES):
        w[_MEAN + l] = 0.0


@inlined
def _means(w: Floats, geometry: Floats, block: int) -> None:
    """H of every point, the card, and the mean of J - 1 of every cell."""
    for q in range(POINTS):
        _load(w, _G, ROWS, geometry, block, q)
        for l in range(LANES):
            H = _gradient(w, l)
            _store(w, _H + q * 144 + l, H)
            w[_MEAN + l] += w[384 + l] * volume(H)[0]
    _load(w, _CARD, 6, geometry, block, POINTS)
    for l in range(LANES):
        w[_MEAN + l] *= w[_CARD + 80 + l]


@inlined
def _moduli(w: Floats, l: int, by: float) -> Four:
    return (
        by * w[_CARD + 16 + l], by * w[_CARD + 32 + l], by * w[_CARD + 48 + l],
        by * w[_CARD + 64 + l],
    )  # fmt: skip


@inlined
def _push(w: Floats, l: int, P: Nine) -> None:
    """Adds P g of every corner to its forces."""
    for a in range(CORNERS):
        o, f = a * LANES + l, _F + a * LANES + l
        x, y, z = w[o], w[o + 128], w[o + 256]
        w[f] += P[0] * x + P[1] * y + P[2] * z
        w[f + 128] += P[3] * x + P[4] * y + P[5] * z
        w[f + 256] += P[6] * x + P[7] * y + P[8] * z


@inlined
def _stressed(w: Floats, geometry: Floats, block: int) -> None:
    """Forces of the isochoric stress and of p cof F, p = U'(mean of J)."""
    for l in range(LANES):
        s = w[_MEAN + l]
        w[_MEAN + l] = 0.5 * w[_CARD + l] * s * (s + 2) / (1 + s)
    for q in range(POINTS):
        _load(w, _G, ROWS, geometry, block, q)
        for l in range(LANES):
            H, by = _stored(w, _H + q * 144 + l), w[384 + l]
            K, p = volume(H)[1], by * w[_MEAN + l]
            P = combined(1.0, first_split(H, 0.0, _moduli(w, l, by)), p, K)
            _push(w, l, (P[0] + p, P[1], P[2], P[3], P[4] + p, P[5], P[6], P[7], P[8] + p))


@inlined
def add_brick_forces(geometry: Floats, cells: Any, u: Floats, f: Floats, w: Floats) -> None:
    """Add the internal forces N of all blocks to f (N,); cells (blocks, 8, 16) hold 3 x node."""
    for block in range(cells.shape[0]):
        _gather(w, cells, block, u)
        _means(w, geometry, block)
        _stressed(w, geometry, block)
        for a in range(CORNERS):
            for l in range(LANES):
                n, o = np.uint64(cells[block, a, l]), _F + a * LANES + l
                f[n] += w[o]
                f[n + np.uint64(1)] += w[o + 128]
                f[n + np.uint64(2)] += w[o + 256]


@inlined
def bricks_looked_at(
    count: int, geometry: Floats, cells: Any, u: Floats, w: Floats
) -> tuple[float, float, int]:
    """Strain energy J, least det F of a point, and number of the first `count` cells with
    det F <= 0 in one."""
    energy, least, inverted = 0.0, np.inf, 0
    for block in range(cells.shape[0]):
        _gather(w, cells, block, u)
        _means(w, geometry, block)
        for l in range(min(LANES, count - block * LANES)):
            s, lowest = w[_MEAN + l], np.inf
            energy += 0.25 * w[_CARD + l] / w[_CARD + 80 + l] * (s * (s + 2) - 2 * np.log1p(s))
            for q in range(POINTS):
                H, by = _stored(w, _H + q * 144 + l), geometry[block, q, 24, l]
                dJ = volume(H)[0]
                lowest = min(lowest, 1 + dJ)
                energy += energy_invariants(False, H, 0.0, _moduli(w, l, by), dJ)
            least = min(least, lowest)
            inverted += not lowest > 0
    return energy, least, inverted
