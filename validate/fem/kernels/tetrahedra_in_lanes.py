"""Compiled element loops of tet4, 8 cells at once (16 in single precision).

St. Venant-Kirchhoff, neo-Hooke, and Mooney-Rivlin and Yeoh in their split form. A block of 16 cells
has its numbers side by side, row by row; the nodes' displacements are copied with a pad, so that a
node is one load, and forces are added up in rows of their own.

A force of St. Venant-Kirchhoff is 228 flop, in 120 instructions of 8 cells; gathering and adding up
are as many again. The order of the cells makes no difference while the nodes stay in the caches.
"""

from typing import Any

from validate.arrays import Floats
from validate.fem.kernels.lanes import (
    BLOCK,
    FOUR,
    add_forces_of,
    add_numbers_of,
    edges,
    lanes_of,
    load,
)
from validate.fem.kernels.laws import first_split
from validate.fem.kernels.points import (
    INVARIANTS,
    NEO_HOOKE,
    SVK,
    Nine,
    Six,
    Three,
    along_neo_hooke,
    along_svk,
    first_of_stretched,
    first_svk,
    inlined,
    nodes_neo_hooke,
    nodes_svk,
    product,
    stretched,
    transposed,
)


@inlined
def _gradients(geometry: Floats, o: int) -> Nine:
    """dN/dX of nodes 1-3 of the cells from the flat index o on."""
    return (
        load(geometry, o), load(geometry, o + 16), load(geometry, o + 32),
        load(geometry, o + 48), load(geometry, o + 64), load(geometry, o + 80),
        load(geometry, o + 96), load(geometry, o + 112), load(geometry, o + 128),
    )  # fmt: skip


@inlined
def _moduli(geometry: Floats, o: int) -> tuple[float, float]:
    """a, b times volume."""
    return load(geometry, o + 144), load(geometry, o + 160)


@inlined
def room(nodes: int) -> int:
    """Numbers that fours of all nodes take in a workspace, up to where the next ones may begin
    without lying across the lines of a cache."""
    return -(-nodes // BLOCK) * BLOCK * FOUR


@inlined
def _padded(u: Floats, to: Floats) -> None:
    for n in range(u.size // 3):
        to[FOUR * n], to[FOUR * n + 1], to[FOUR * n + 2] = u[3 * n], u[3 * n + 1], u[3 * n + 2]


@inlined
def _place(k: int, count: int, size: int) -> tuple[int, int]:
    """Flat indices in the geometry, `size` numbers a block, and in the cells of the k-th lanes."""
    block, l = k * count // BLOCK, k * count % BLOCK
    return block * size + l, block * FOUR * BLOCK + l


@inlined
def _add_first(law: int, geometry: Floats, cells: Any, x: Floats, r: Floats) -> None:
    """Adds forces to r (4 n,) of padded displacements x.

    The edges of the next cells are gathered before a cell's forces are reckoned: what waits for
    each other in one cell is longer than a processor looks ahead.
    """
    count, size = lanes_of(x), geometry[0].size
    groups = cells.shape[0] * BLOCK // count
    U = edges(x, cells, 0)
    for k in range(groups):
        o, n = _place(k, count, size)
        coming = edges(x, cells, _place(min(k + 1, groups - 1), count, size)[1])
        G, (a, b) = _gradients(geometry, o), _moduli(geometry, o)
        H = product(U, G)
        P = first_svk(H, a, b) if law == SVK else _first_of_card(H, a, b, geometry, o)
        add_forces_of(r, cells, n, product(P, transposed(G)))
        U = coming


@inlined
def _add_neo_hooke(geometry: Floats, cells: Any, x: Floats, r: Floats) -> None:
    """The same, with the next cells' cube root begun as early: it takes longest to wait for."""
    count, size = lanes_of(x), geometry[0].size
    groups = cells.shape[0] * BLOCK // count
    H = product(edges(x, cells, 0), _gradients(geometry, 0))
    y = stretched(H)
    for k in range(groups):
        o, n = _place(k, count, size)
        o_next, n_next = _place(min(k + 1, groups - 1), count, size)
        coming = product(edges(x, cells, n_next), _gradients(geometry, o_next))
        y_coming = stretched(coming)
        G, (a, b) = _gradients(geometry, o), _moduli(geometry, o)
        add_forces_of(r, cells, n, product(first_of_stretched(H, y, a, b), transposed(G)))
        H, y = coming, y_coming


@inlined
def add_lane_forces(
    law: int, geometry: Floats, cells: Any, u: Floats, f: Floats, w: Floats
) -> None:
    """Add internal forces to f (N,); w is a workspace (2 `room`) of the numbers of `geometry`.

    Each law has a loop of its own: a choice within it would cost a tenth.
    """
    nodes = u.size // 3
    x, r = w[: room(nodes)], w[room(nodes) : 2 * room(nodes)]
    _padded(u, x)
    r[:] = 0
    if geometry.ndim == 3:
        _add_first(INVARIANTS, geometry, cells, x, r)
    elif law == SVK:
        _add_first(SVK, geometry, cells, x, r)
    else:
        _add_neo_hooke(geometry, cells, x, r)
    _add_unpadded(r, FOUR, 0, f, 3)


@inlined
def _add_unpadded(r: Floats, wide: int, first: int, f: Floats, rows: int) -> None:
    """Adds to f `rows` numbers a node, from the `first` of the `wide` that r has."""
    for n in range(f.size // rows):
        for i in range(rows):
            f[rows * n + i] += r[wide * n + first + i]


@inlined
def _first_of_card(H: Nine, a: float, b: float, geometry: Floats, o: int) -> Nine:
    c01, c20, c30 = load(geometry, o + 176), load(geometry, o + 192), load(geometry, o + 208)
    return first_split(H, a, (0.5 * b - c01, c01, c20, c30))


@inlined
def add_lane_products(
    law: int, geometry: Floats, cells: Any, u: Floats, v: Floats, f: Floats, w: Floats
) -> None:
    """Add K_t(u) v to f (N,); w (3 `room`)."""
    nodes, count, size = u.size // 3, lanes_of(w), geometry[0].size
    x, y = w[: room(nodes)], w[room(nodes) : 2 * room(nodes)]
    r = w[2 * room(nodes) : 3 * room(nodes)]
    _padded(u, x)
    _padded(v, y)
    r[:] = 0
    for k in range(cells.shape[0] * BLOCK // count):
        o, n = _place(k, count, size)
        G, (a, b) = _gradients(geometry, o), _moduli(geometry, o)
        H, D = product(edges(x, cells, n), G), product(edges(y, cells, n), G)
        P = along_svk(H, D, a, b) if law == SVK else along_neo_hooke(H, D, a, b)
        add_forces_of(r, cells, n, product(P, transposed(G)))
    _add_unpadded(r, FOUR, 0, f, 3)


@inlined
def _with_diagonal(f: Three, K: Six) -> Six:
    return f[0], f[1], f[2], K[0], K[1], K[2]


@inlined
def _with_block(f: Three, K: Six) -> Nine:
    return f[0], f[1], f[2], K[0], K[1], K[2], K[3], K[4], K[5]


@inlined
def _add_nodes(law: int, rows: int, geometry: Floats, cells: Any, x: Floats, r: Floats) -> None:
    """Adds forces and `rows` entries of the nodes' blocks to r of padded displacements x."""
    count, size = lanes_of(x), geometry[0].size
    groups = cells.shape[0] * BLOCK // count
    U = edges(x, cells, 0)
    for k in range(groups):
        o, n = _place(k, count, size)
        coming = edges(x, cells, _place(min(k + 1, groups - 1), count, size)[1])
        G, (a, b) = _gradients(geometry, o), _moduli(geometry, o)
        H = product(U, G)
        p, K = nodes_svk(H, G, a, b) if law == SVK else nodes_neo_hooke(H, G, a, b)
        if rows == 6:
            add_numbers_of(r, cells, n, (
                _with_block(p[0], K[0]), _with_block(p[1], K[1]),
                _with_block(p[2], K[2]), _with_block(p[3], K[3]),
            ))  # fmt: skip
        else:
            add_numbers_of(r, cells, n, (
                _with_diagonal(p[0], K[0]), _with_diagonal(p[1], K[1]),
                _with_diagonal(p[2], K[2]), _with_diagonal(p[3], K[3]),
            ))  # fmt: skip
        U = coming


@inlined
def add_lane_blocks(
    law: int, geometry: Floats, cells: Any, u: Floats, f: Floats, d: Floats, w: Floats
) -> None:
    """Add forces to f (N,) and the nodes' own blocks to d (3 n,) or (6 n,); w (4 `room`)."""
    nodes, rows = u.size // 3, 3 * d.size // f.size
    wide = 12 if rows == 6 else 8
    x, r = w[: room(nodes)], w[room(nodes) : (1 + wide // FOUR) * room(nodes)]
    _padded(u, x)
    r[:] = 0
    if law == SVK and rows == 6:
        _add_nodes(SVK, 6, geometry, cells, x, r)
    elif law == SVK:
        _add_nodes(SVK, 3, geometry, cells, x, r)
    elif rows == 6:
        _add_nodes(NEO_HOOKE, 6, geometry, cells, x, r)
    else:
        _add_nodes(NEO_HOOKE, 3, geometry, cells, x, r)
    _add_unpadded(r, wide, 0, f, 3)
    _add_unpadded(r, wide, 3, d, rows)
