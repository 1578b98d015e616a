"""Compiled element loops at large strain: forces, tangents by node, products, strain energy.

Which loop takes a body is told by its geometry, whose kind the compiler knows: tet4 of two moduli
(blocks, 11 x 16), tet4 whose law has a card (blocks, 11 + k, 16), mixed hex8 (four dimensions,
`fem.kernels.bricks`). Laws without logarithms go 8 or 16 cells at a time
(`fem.kernels.tetrahedra_in_lanes`), the others cell by cell (`fem.kernels.cells`).

Neither NaN nor infinity is assumed away (no `nnan`, `ninf`): a run that diverges must be seen to.
The numpy reference is `fem.large_strain.hyperelastic.Body`.
"""

import numpy as np
from numba import prange
from numpy.typing import NDArray

from validate.arrays import Floats
from validate.fem.kernels import (
    bricks as brick_kernels,
)
from validate.fem.kernels import (
    cells as cell_kernels,
)
from validate.fem.kernels import (
    lanes,
)
from validate.fem.kernels import (
    laws as law_kernels,
)
from validate.fem.kernels import (
    nodes_in_lanes as lane_nodes,
)
from validate.fem.kernels import (
    points as point_kernels,
)
from validate.fem.kernels import (
    tensors as kernel_tensors,
)
from validate.fem.kernels import (
    tetrahedra_in_lanes as lane_kernels,
)
from validate.fem.kernels.bricks import add_brick_forces, bricks_looked_at
from validate.fem.kernels.cells import (
    add_carded,
    add_carded_blocks,
    add_carded_products,
    add_late,
    cells_looked_at,
)
from validate.fem.kernels.jit_cache import compiled
from validate.fem.kernels.nodes_in_lanes import BLOCK, FOUR
from validate.fem.kernels.points import INVARIANTS
from validate.fem.kernels.tensors import FAST
from validate.fem.kernels.tetrahedra_in_lanes import (
    add_lane_blocks,
    add_lane_forces,
    add_lane_products,
)

Cells = NDArray[np.int32]

#: Whose functions are in the code of these loops.
MODULES = (
    brick_kernels, cell_kernels, kernel_tensors, lane_kernels, lane_nodes, lanes, law_kernels,
    point_kernels,
)  # fmt: skip
_compiled = compiled(*MODULES, nogil=True, fastmath=FAST, error_model="numpy")
_threaded = compiled(*MODULES, nogil=True, parallel=True, error_model="numpy")


def work_size(nodes: int) -> int:
    """Length of the workspace of a body."""
    return max(brick_kernels.WORK, 4 * -(-nodes // BLOCK) * BLOCK * FOUR)


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
    (`fem.laws.viscous`).

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
