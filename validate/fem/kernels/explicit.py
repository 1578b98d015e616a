"""Compiled element loops at large strain, and steps of central difference.

Which loop takes a body is told by its geometry, whose kind the compiler knows: tet4 of two moduli
(blocks, 11 x 16), tet4 whose law has a card (blocks, 11 + k, 16), mixed hex8 (four dimensions,
`fem.kernels.cells`). Laws without logarithms go 8 or 16 cells at a time
(`fem.kernels.tetrahedra_in_lanes`), the others cell by cell (`fem.kernels.cells`).

Neither NaN nor infinity is assumed away (no `nnan`, `ninf`): a run that diverges must be seen to.
The numpy reference is `fem.large_strain.hyperelastic.Body`.

Compiled steps of central difference on lumped masses (paper 003, eq 18).
"""

import numpy as np
from numba import prange
from numpy.typing import NDArray

from validate.arrays import Floats, Ints
from validate.fem.kernels import cells as cell_kernels
from validate.fem.kernels import lanes
from validate.fem.kernels import laws as law_kernels
from validate.fem.kernels import points as point_kernels
from validate.fem.kernels import tetrahedra_in_lanes as lane_kernels
from validate.fem.kernels.cells import (
    add_brick_forces,
    add_carded,
    add_carded_blocks,
    add_carded_products,
    add_late,
    bricks_looked_at,
    cells_looked_at,
)
from validate.fem.kernels.jit_cache import compiled
from validate.fem.kernels.lanes import BLOCK, FOUR
from validate.fem.kernels.points import FAST, INVARIANTS, inlined
from validate.fem.kernels.tetrahedra_in_lanes import (
    add_lane_blocks,
    add_lane_forces,
    add_lane_products,
)

Cells = NDArray[np.int32]

#: Whose functions are in the code of these loops.
MODULES = (
    cell_kernels, lane_kernels, lanes, law_kernels, point_kernels,
)  # fmt: skip
_compiled = compiled(*MODULES, nogil=True, fastmath=FAST, error_model="numpy")
_threaded = compiled(*MODULES, nogil=True, parallel=True, error_model="numpy")


def work_size(nodes: int) -> int:
    """Length of the workspace of a body."""
    return max(cell_kernels.WORK, 4 * -(-nodes // BLOCK) * BLOCK * FOUR)


def parts_size(nodes: int) -> int:
    """Length of a thread's row: forces, and the workspace from a line of the cache on."""
    return -(-3 * nodes // BLOCK) * BLOCK + work_size(nodes)


@_compiled
def add_forces(law: int, geometry: Floats, cells: Cells, u: Floats, f: Floats, w: Floats) -> None:
    """Add the internal forces N of all blocks to f (N,); w is a workspace (`work_size`).

    Cells (blocks, 4, 16) hold 8 x node, those of hexahedra (blocks, 8, 16) 3 x node.
    """
    if geometry.ndim == 4:
        add_brick_forces(geometry, cells, u, f, w)
    elif geometry.ndim == 2 or law == INVARIANTS:
        add_lane_forces(law, geometry, cells, u, f, w)
    elif geometry.ndim == 3:
        add_carded(law, geometry, cells, u, f)


@_compiled
def add_late_forces(
    law: int, geometry: Floats, cells: Cells, u: Floats, f: Floats, memory: Floats, series: Floats
) -> None:
    """`add_forces` of a viscoelastic body in a split form, at the end of a step
    (`fem.laws.viscoelasticity`).

    `memory` (blocks, 6 + 6 k, 16) is V S of the isochoric law and V Q of the k branches, as xx, yy,
    zz, xy, xz, yz, after the step before: overwritten; `series` (blocks, 2 k, 16) exp(-x) and
    g (1 - exp(-x))/x of each branch.
    """
    add_late(law, geometry, cells, u, f, memory, series)


@_threaded
def add_forces_in_parts(
    law: int, geometry: Floats, cells: Cells, u: Floats, f: Floats, parts: Floats
) -> None:
    """The same by as many threads as `parts` (threads, `parts_size`) has rows, each for itself.

    A thread adds up its share of the blocks in its own row; the rows are added in their order, so
    results do not depend on which thread was first.
    """
    threads, blocks, size = parts.shape[0], cells.shape[0], f.size
    begin = -(-size // BLOCK) * BLOCK
    for t in prange(threads):
        first, end = t * blocks // threads, (t + 1) * blocks // threads
        own = parts[t, :size]
        own[:] = 0.0
        add_forces(law, geometry[first:end], cells[first:end], u, own, parts[t, begin:])
    for t in range(threads):
        for i in range(size):
            f[i] += parts[t, i]


@_compiled
def add_forces_and_blocks(
    law: int, geometry: Floats, cells: Cells, u: Floats, f: Floats, d: Floats, w: Floats
) -> None:
    """Add the internal forces to f (N,) and the nodes' own blocks of the tangent to d.

    d (3 n,) takes the diagonal; d (6 n,) the blocks as xx, yy, zz, xy, xz, yz.
    """
    if geometry.ndim == 3:
        add_carded_blocks(law, geometry, cells, u, f, d)
    else:
        add_lane_blocks(law, geometry, cells, u, f, d, w)


@_compiled
def add_products(
    law: int, geometry: Floats, cells: Cells, u: Floats, v: Floats, f: Floats, w: Floats
) -> None:
    """Add K_t(u) v to f (N,)."""
    if geometry.ndim == 3:
        add_carded_products(law, geometry, cells, u, v, f)
    else:
        add_lane_products(law, geometry, cells, u, v, f, w)


@_compiled
def looked_at(
    law: int, count: int, geometry: Floats, cells: Cells, u: Floats, w: Floats
) -> tuple[float, float, int]:
    """Strain energy J, least det F and number of det F <= 0 of the first `count` cells."""
    if geometry.ndim == 4:
        return bricks_looked_at(count, geometry, cells, u, w)
    return cells_looked_at(law, count, geometry, cells, u)


Springs = tuple[Cells, Cells, Floats]


@inlined
def pull(springs: Springs, u: Floats, r: Floats) -> None:
    """r = K u of springs, rows of a csr matrix; zero without any."""
    starts, columns, values = springs
    for i in range(r.size):
        r[i] = 0.0
    if values.size > 0:
        for i in range(r.size):
            for k in range(starts[i], starts[i + 1]):
                r[i] += values[k] * u[columns[k]]


@inlined
def _moved(u: Floats, d: Floats, r: Floats, keep: Floats, gain: Floats) -> None:
    for i in range(u.size):
        d[i] = keep[i] * d[i] - gain[i] * r[i]
        u[i] += d[i]


@inlined
def _moved_damped(
    u: Floats, d: Floats, r: Floats, old: Floats, keep: Floats, gain: Floats, lag: float
) -> float:
    """The same with damping; returns what it took, J."""
    taken = 0.0
    for i in range(u.size):
        drag = lag * (r[i] - old[i])
        new = keep[i] * d[i] - gain[i] * (r[i] + drag)
        if gain[i] > 0:
            way = (new + d[i]) / 2
            taken += (1 - keep[i]) / gain[i] * way * way + drag * way
        d[i], old[i] = new, r[i]
        u[i] += new
    return taken


@inlined
def _rates(rows: Floats, keep: Floats, gain: Floats, lag: float, dt: float) -> float:
    """v and a at u (paper 003, eqs 13-14), which know the next increment; sum of d^2."""
    u, d, r, old, v, a = rows[0], rows[1], rows[2], rows[3], rows[4], rows[5]
    total = 0.0
    for i in range(u.size):
        drag = r[i] if lag == 0.0 else r[i] + lag * (r[i] - old[i])
        new = keep[i] * d[i] - gain[i] * drag
        v[i], a[i] = (new + d[i]) / (2 * dt), (new - d[i]) / (dt * dt)
        total += d[i] * d[i] + u[i] * 0.0
    return total


@inlined
def _inputs(begin: Floats, end: Floats, share: float, to: Floats) -> None:
    """Inputs (k + l,) a share of the way."""
    for c in range(to.size):
        to[c] = begin[c] + share * (end[c] - begin[c])


@inlined
def _input(columns: Floats, j: int, inputs: Floats, first: int) -> float:
    """Row j of `columns` (., k) times the inputs from `first` on."""
    total = 0.0
    for c in range(columns.shape[1]):
        total += columns[j, c] * inputs[first + c]
    return total


@compiled(*MODULES, nogil=True, fastmath=FAST, error_model="numpy")
def advance(
    law: int,
    geometry: Floats,
    cells: Cells,
    springs: Springs,
    rows: Floats,
    keep: Floats,
    gain: Floats,
    lag: float,
    dt: float,
    held: Ints,
    moves: Floats,
    loaded: Ints,
    loads: Floats,
    begin: Floats,
    end: Floats,
    substeps: int,
    w: Floats,
    memory: Floats | None,
    series: Floats | None,
) -> tuple[float, float, float]:
    """`substeps` steps of central difference (paper 003, eq 18) in increments d = u - u_before.

    d' = keep d - gain (r + lag (r - old) - f), u' = u + d', with keep = (1 - b)/(1 + b), gain =
    (dt^2/m)/(1 + b), b = alpha dt/2, lag = beta/dt; zeros where held. `rows` (6, N) are u, d, the
    forces r at u and `old` before it, v and a: overwritten, the last two from nothing. `held`
    unknowns move by `moves` (held, k) times the first inputs, `loaded` ones take `loads`
    (loaded, l) times the others; inputs go linearly from `begin` to `end` (k + l,). Returns the
    work J of loads and prescribed motion and what damping took, up to half a step before the last
    time, and the sum of d^2, not finite where any unknown is not. `w` is a workspace or the
    parts of `add_forces_in_parts`. `memory` and `series` are those of `add_late_forces`.
    """
    u, d, r, old, v, a = rows[0], rows[1], rows[2], rows[3], rows[4], rows[5]
    k = moves.shape[1]
    work, taken = 0.0, 0.0
    damped = lag > 0 or bool((keep[gain > 0] < 1).any())
    old_inputs, inputs = begin.copy(), begin.copy()
    for s in range(substeps):
        _inputs(begin, end, s / substeps, old_inputs)
        _inputs(begin, end, (s + 1) / substeps, inputs)
        for j in range(loaded.size):
            i = loaded[j]
            work += _input(loads, j, old_inputs, k) * d[i] / 2
            v[i], a[i] = d[i], lag * (r[i] - old[i])
        for j in range(held.size):
            work += r[held[j]] * d[held[j]] / 2
        if damped:
            taken += _moved_damped(u, d, r, old, keep, gain, lag)
        else:
            _moved(u, d, r, keep, gain)
        for j in range(loaded.size):
            i, f = loaded[j], _input(loads, j, old_inputs, k)
            way, drag = (v[i] + d[i]) / 2, (1 - keep[i]) / gain[i]
            d[i] += gain[i] * f
            u[i] += gain[i] * f
            work += f * d[i] / 2
            if damped:  # what it took was reckoned without the load
                more = gain[i] * f / 2
                taken += drag * more * (2 * way + more) + a[i] * more
        for j in range(held.size):
            i = held[j]
            d[i] = _input(moves, j, inputs, 0) - u[i]
            u[i] += d[i]
            work += r[i] * d[i] / 2
        pull(springs, u, r)
        # What follows is known to the compiler: each kind of body has its own code alone.
        if memory is not None and series is not None:
            add_late_forces(law, geometry, cells, u, r, memory, series)
        elif w.ndim == 2:
            add_forces_in_parts(law, geometry, cells, u, r, w)
        else:
            add_forces(law, geometry, cells, u, r, w)
    size = _rates(rows, keep, gain, lag, dt)
    for j in range(loaded.size):
        i, more = loaded[j], gain[loaded[j]] * _input(loads, j, inputs, k)
        v[i] += more / (2 * dt)
        a[i] += more / (dt * dt)
    for j in range(held.size):
        v[held[j]], a[held[j]] = d[held[j]] / dt, 0.0
    return work, taken, size
