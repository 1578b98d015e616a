"""Compiled element loops at large strain: tet4 cell by cell, mixed hex8.

Vector lanes support neither branches nor logarithms, so that these loops take one cell at a time.

Geometry is (blocks, 11 x 16), or with the card of a law (blocks, 11 + k, 16): the compiler knows
which, so that neither kind is in the code of the other. Cells (blocks, 4, 16) hold 8 x node. The
coupled forms take about 120 ns a cell, Ogden of three terms 1 us.

Compiled element loops of mixed hexahedra (hex8, mean dilatation) at large strain. Blocks of 16
cells go lane by lane, as in `fem.kernels.explicit`. Two passes over the eight points of a block:
displacement gradients and the cells' mean of J - 1, then the isochoric stress of the invariants
(`fem.kernels.laws`) with the pressure of that mean. All eight points are integrated: no zero-energy
modes, so no stabilisation and no constant of one. The numpy reference is
`fem.large_strain.hyperelastic.Body`.

Geometry (blocks, 9, 25, 16): for every point 24 slopes dN_a/dX_j in rows 8 j + a and the weight;
then the card: kappa, C10, C01, C20, C30 in Pa, 1/V in 1/m3.
"""

from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.fem.kernels.lanes import BLOCK
from validate.fem.kernels.laws import (
    Four,
    energy_invariants,
    energy_ogden,
    first_coupled,
    first_ogden,
    first_split,
    product_invariants,
    product_ogden,
)
from validate.fem.kernels.points import (
    INVARIANTS,
    INVARIANTS_COUPLED,
    OGDEN,
    OGDEN_COUPLED,
    Nine,
    Six,
    Three,
    combined,
    deformation,
    energy,
    first_neo_hooke,
    inlined,
    inverse,
    product,
    rest,
    row,
    times,
    transposed,
    volume,
)

ROWS = 11  # of geometry: 9 gradients of nodes 1-3, 2 moduli times volume; a law's card follows


@inlined
def _number(geometry: Floats, block: int, k: int, l: int) -> float:
    if geometry.ndim == 3:
        return float(geometry[block, k, l])
    return float(geometry[block, k * BLOCK + l])


@inlined
def gradients(geometry: Floats, block: int, l: int) -> Nine:
    """dN/dX of nodes 1-3."""
    return (
        _number(geometry, block, 0, l), _number(geometry, block, 1, l),
        _number(geometry, block, 2, l), _number(geometry, block, 3, l),
        _number(geometry, block, 4, l), _number(geometry, block, 5, l),
        _number(geometry, block, 6, l), _number(geometry, block, 7, l),
        _number(geometry, block, 8, l),
    )  # fmt: skip


@inlined
def _unknowns(cells: Any, block: int, l: int) -> tuple[Any, Any, Any, Any]:
    """First unknowns of a cell's nodes. Unsigned: a sign would be tested for at every access."""
    eight, three = np.uint64(8), np.uint64(3)
    return (
        np.uint64(cells[block, 0, l]) // eight * three,
        np.uint64(cells[block, 1, l]) // eight * three,
        np.uint64(cells[block, 2, l]) // eight * three,
        np.uint64(cells[block, 3, l]) // eight * three,
    )


@inlined
def _three(u: Floats, n: Any) -> Three:
    return u[n], u[n + np.uint64(1)], u[n + np.uint64(2)]


@inlined
def _gradient(G: Nine, cells: Any, block: int, l: int, u: Floats) -> Nine:
    """du/dX of a cell."""
    n0, n1, n2, n3 = _unknowns(cells, block, l)
    o, x, y, z = _three(u, n0), _three(u, n1), _three(u, n2), _three(u, n3)
    U = (
        x[0] - o[0], y[0] - o[0], z[0] - o[0], x[1] - o[1], y[1] - o[1], z[1] - o[1],
        x[2] - o[2], y[2] - o[2], z[2] - o[2],
    )  # fmt: skip
    return product(U, G)


@inlined
def _add(f: Floats, n: Any, x: Three) -> None:
    for i in range(3):
        f[n + np.uint64(i)] += x[i]


@inlined
def _add_forces(f: Floats, cells: Any, block: int, l: int, P: Nine, G: Nine) -> None:
    """Adds V P g of all four nodes."""
    n0, n1, n2, n3 = _unknowns(cells, block, l)
    f1, f2, f3 = times(P, row(G, 0)), times(P, row(G, 1)), times(P, row(G, 2))
    _add(f, n0, rest(f1, f2, f3))
    _add(f, n1, f1)
    _add(f, n2, f2)
    _add(f, n3, f3)


@inlined
def _four(card: Floats, b: float) -> Four:
    """C10 V, C01 V, C20 V, C30 V of mu V and the last three of them."""
    return 0.5 * b - card[0], card[0], card[1], card[2]


@inlined
def _first(law: int, H: Nine, a: float, b: float, card: Floats) -> Nine:
    """V P of the laws that have a card."""
    if law == INVARIANTS:
        return first_split(H, a, _four(card, b))
    if law == INVARIANTS_COUPLED:
        return first_coupled(H, a, _four(card, b))
    return first_ogden(law == OGDEN_COUPLED, H, a, card)


@inlined
def _first_along(law: int, H: Nine, D: Nine, a: float, b: float, card: Floats) -> Nine:
    """V dP along D of the laws that have a card."""
    if law < OGDEN:
        return product_invariants(law == INVARIANTS_COUPLED, H, D, a, _four(card, b))
    return product_ogden(law == OGDEN_COUPLED, H, D, a, card)


@inlined
def add_carded(law: int, geometry: Floats, cells: Any, u: Floats, f: Floats) -> None:
    """Add the forces of laws that have a card."""
    for block in range(cells.shape[0]):
        for l in range(BLOCK):
            G, card = gradients(geometry, block, l), geometry[block, ROWS:, l]
            H = _gradient(G, cells, block, l, u)
            a, b = geometry[block, 9, l], geometry[block, 10, l]
            _add_forces(f, cells, block, l, _first(law, H, a, b, card), G)


@inlined
def add_carded_products(
    law: int, geometry: Floats, cells: Any, u: Floats, v: Floats, f: Floats
) -> None:
    for block in range(cells.shape[0]):
        for l in range(BLOCK):
            G, card = gradients(geometry, block, l), geometry[block, ROWS:, l]
            H, D = _gradient(G, cells, block, l, u), _gradient(G, cells, block, l, v)
            a, b = geometry[block, 9, l], geometry[block, 10, l]
            _add_forces(f, cells, block, l, _first_along(law, H, D, a, b, card), G)


@inlined
def _dyad(axis: int, g: Three) -> Nine:
    """e g^T."""
    x, y, z = 1.0 if axis == 0 else 0.0, 1.0 if axis == 1 else 0.0, 1.0 if axis == 2 else 0.0
    return (
        x * g[0], x * g[1], x * g[2], y * g[0], y * g[1], y * g[2], z * g[0], z * g[1], z * g[2]
    )  # fmt: skip


@inlined
def add_carded_blocks(
    law: int, geometry: Floats, cells: Any, u: Floats, f: Floats, d: Floats
) -> None:
    """Add forces to f (N,) and the nodes' own blocks to d (3 n,) or (6 n,), by their columns."""
    rows = np.uint64(3 * d.size // f.size)
    for block in range(cells.shape[0]):
        for l in range(BLOCK):
            G, card = gradients(geometry, block, l), geometry[block, ROWS:, l]
            H = _gradient(G, cells, block, l, u)
            a, b = geometry[block, 9, l], geometry[block, 10, l]
            _add_forces(f, cells, block, l, _first(law, H, a, b, card), G)
            g1, g2, g3 = row(G, 0), row(G, 1), row(G, 2)
            for k, n in enumerate(_unknowns(cells, block, l)):
                g = g1 if k == 1 else g2 if k == 2 else g3 if k == 3 else rest(g1, g2, g3)
                x = y = z = (0.0, 0.0, 0.0)
                for axis in range(3):
                    column = times(_first_along(law, H, _dyad(axis, g), a, b, card), g)
                    x, y, z = y, z, column
                o = n // np.uint64(3) * rows
                _add(d, o, (x[0], y[1], z[2]))
                if rows == np.uint64(6):
                    _add(d, o + np.uint64(3), (x[1], x[2], y[2]))


@inlined
def _pulled_back(P: Nine, G: Nine) -> Six:
    """F^-1 P of a symmetric result, G = F^-T: xx, yy, zz, xy, xz, yz."""
    S = product(transposed(G), P)
    return S[0], S[4], S[8], S[1], S[2], S[5]


@inlined
def _late(memory: Floats, series: Floats, block: int, l: int, S: Six) -> Nine:
    """V times the sum of the branches' stresses after a step that ends at V S; remembers both."""
    x, y, z, xy, xz, yz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(series.shape[1] // 2):
        decay, gain, o = series[block, 2 * k, l], series[block, 2 * k + 1, l], 6 * (k + 1)
        for i in range(6):
            change = gain * (S[i] - memory[block, i, l])
            memory[block, o + i, l] = decay * memory[block, o + i, l] + change
        x += memory[block, o, l]
        y += memory[block, o + 1, l]
        z += memory[block, o + 2, l]
        xy += memory[block, o + 3, l]
        xz += memory[block, o + 4, l]
        yz += memory[block, o + 5, l]
    for i in range(6):
        memory[block, i, l] = S[i]
    return x, xy, xz, xy, y, yz, xz, yz, z


@inlined
def add_late(
    law: int, geometry: Floats, cells: Any, u: Floats, f: Floats, memory: Floats, series: Floats
) -> None:
    """Add forces of a viscoelastic body in a split form (`fem.laws.viscoelasticity`)."""
    for block in range(cells.shape[0]):
        for l in range(BLOCK):
            G = gradients(geometry, block, l)
            a, b = _number(geometry, block, 9, l), _number(geometry, block, 10, l)
            H = _gradient(G, cells, block, l, u)
            if geometry.ndim == 3:
                P = _first(law, H, 0.0, b, geometry[block, ROWS:, l])
            else:
                P = first_neo_hooke(H, 0.0, b)
            X, dJ = inverse(H)
            late = product(deformation(H), _late(memory, series, block, l, _pulled_back(P, X)))
            P = combined(1.0, combined(1.0, P, 1.0, late), 0.5 * a * dJ * (dJ + 2), X)
            _add_forces(f, cells, block, l, P, G)


@inlined
def _energy_carded(law: int, H: Nine, a: float, b: float, dJ: float, card: Floats) -> float:
    if law < OGDEN:
        return energy_invariants(law == INVARIANTS_COUPLED, H, a, _four(card, b), dJ)
    return energy_ogden(law == OGDEN_COUPLED, H, a, card, dJ)


@inlined
def cells_looked_at(
    law: int, count: int, geometry: Floats, cells: Any, u: Floats
) -> tuple[float, float, int]:
    """Strain energy J, least det F and number of det F <= 0 of the first `count` cells."""
    total, least, inverted = 0.0, np.inf, 0
    for block in range(cells.shape[0]):
        for l in range(min(BLOCK, count - block * BLOCK)):
            H = _gradient(gradients(geometry, block, l), cells, block, l, u)
            a, b = _number(geometry, block, 9, l), _number(geometry, block, 10, l)
            dJ, _ = volume(H)
            least = min(least, 1 + dJ)
            inverted += not 1 + dJ > 0
            if geometry.ndim == 3:
                total += _energy_carded(law, H, a, b, dJ, geometry[block, ROWS:, l])
            else:
                total += energy(law, H, a, b, dJ)
    return total, least, inverted


LANES, POINTS, CORNERS = 16, 8, 8
BRICK_ROWS = 25  # of a point: 24 slopes and the weight
_G, _U = 0, BRICK_ROWS * LANES
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
def _brick_gradient(w: Floats, l: int) -> Nine:
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
        _load(w, _G, BRICK_ROWS, geometry, block, q)
        for l in range(LANES):
            H = _brick_gradient(w, l)
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
        _load(w, _G, BRICK_ROWS, geometry, block, q)
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
