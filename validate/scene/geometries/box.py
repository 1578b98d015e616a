"""Blocks on a regular grid, of Kuhn simplices or of bricks, and families of similar grids.

The sides of a block are facet sets.

Families of similar grids: every refinement scales every direction by the same factor.

A grid of n cells per axis is a whole multiple of a base, n = k b. Its family are the other
multiples, j b: their cells are larger in the ratio k / j along every axis. A grid whose numbers
of cells have no common factor has no exact family of a practical size; `member` then returns the
most similar grid of whole cells.
"""

from collections.abc import Callable, Sequence
from math import gcd, log, prod

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.scene.mesh import Mesh, boundary_facets, kuhn_cells, require_nodes
from validate.scene.shape_functions import CORNERS

Cells = tuple[int, ...]

_MULTIPLES = (4, 3, 2)  # of its base that a nominal grid may be, the preferred one first
_HALF = 1e-9  # a half is rounded down: the cheaper grid
_AROUND = 0.06  # of the wanted share: how far off it the most similar grid is looked for


def divided(ideal: Sequence[float], even: Sequence[bool] = ()) -> Cells:
    """Return whole cells per axis near the `ideal` numbers: two, three or four times a base.

    Of the three the nearest one is taken (least squares of the logarithms), so that cells are
    nearly cubes. Every grid of the family has an even number of cells along the axes in `even`.
    """
    grids = [
        tuple(k * step * max(1, int(n / k / step + 0.5)) for n, step in zip(ideal, s, strict=True))
        for k in _MULTIPLES
        for s in (_steps(len(ideal), even),)
    ]

    def off(grid: Cells) -> float:
        return sum(log(a / b) ** 2 for a, b in zip(grid, ideal, strict=True))

    best = min(map(off, grids))
    return next(grid for grid in grids if off(grid) <= best + _HALF)


def member(cells: Sequence[int], share: float, even: Sequence[bool] = ()) -> Cells:
    """Return the grid of the family with about `share` (not 1) of the cells along every axis.

    It is coarser for a share below 1 and finer above it.
    """
    k = _multiple(cells, even)
    if k == 1:
        # Return the grid with the most equal ratios near the share; itself is none.
        cells = tuple(cells)
        grids = {
            tuple(max(1, round(s * n)) for n in cells)
            for s in share * np.linspace(1 - _AROUND, 1 + _AROUND, 49)
        }
        others = [g for g in sorted(grids) if (share > 1) == (prod(g) > prod(cells)) and g != cells]
        if not others:
            return tuple(max(1, n + (1 if share > 1 else -1)) for n in cells)
        wanted = share ** len(cells) * prod(cells)
        return min(others, key=lambda g: (similarity(cells, g), abs(log(prod(g) / wanted))))
    j = round(share * k - _HALF)
    j = max(j, k + 1) if share > 1 else max(1, min(j, k - 1))
    return tuple(n // k * j for n in cells)


def fitting(
    cells: Sequence[int], fits: Callable[[Cells], bool], even: Sequence[bool] = ()
) -> Cells:
    """Return `cells`, or the finest grid of their family that `fits`; else the coarsest one."""
    k = _multiple(cells, even)
    grids = [tuple(n // k * j for n in cells) for j in range(k, 0, -1)]
    return next(filter(fits, grids), grids[-1])


def similarity(cells: Sequence[int], others: Sequence[int]) -> float:
    """Return the largest over the smallest ratio of cells along the axes; 1 for similar grids."""
    ratios = [b / a for a, b in zip(cells, others, strict=True)]
    return max(ratios) / min(ratios)


def _multiple(cells: Sequence[int], even: Sequence[bool]) -> int:
    """How many times its base a grid is."""
    steps = _steps(len(cells), even)
    return gcd(*(n // s if n % s == 0 else 1 for n, s in zip(cells, steps, strict=True)))


def _steps(axes: int, even: Sequence[bool]) -> Cells:
    return tuple(2 if flag else 1 for flag in (tuple(even) or (False,) * axes))


def box(size: tuple[float, ...], cells: tuple[int, ...]) -> Mesh:
    """[0, size] m in `cells` boxes per axis; sets "x0", "x1", "y0", "y1" (3-D: "z0", "z1").

    Nodes run with x fastest: node i + j nx + k nx ny. Kuhn's split is along one diagonal, (0,0,0)
    to (1,1,1): a symmetric load moves such a mesh a little sideways.
    Raises `SceneError` for a size or a number of cells that is not positive.
    """
    nodes = _nodes(size, cells)
    d = len(size)
    corners = kuhn_cells(tuple(n + 1 for n in reversed(cells)))
    # The grid's axes are reversed, which mirrors the cells where the reversal is odd.
    corners = corners[:, [0, *range(1, d - 1), d, d - 1]]
    return Mesh(nodes, corners, "tet4" if d == 3 else "tri3", _sides(nodes, corners, size))


def grid(size: tuple[float, ...], cells: tuple[int, ...]) -> Mesh:
    """[0, size] m in `cells` quadrilaterals or hexahedra per axis, sets and nodes as in `box`.

    Cells run with x fastest, too. Raises `SceneError` as `box` does.
    """
    nodes = _nodes(size, cells)
    d = len(size)
    strides = np.cumprod([1, *(n + 1 for n in cells[:-1])])
    first = np.arange(len(nodes)).reshape([n + 1 for n in reversed(cells)])
    base = first[(slice(0, -1),) * d].ravel()
    corners = base[:, None] + (CORNERS[d].astype(np.int64) @ strides)
    return Mesh(nodes, corners, "hex8" if d == 3 else "quad4", _sides(nodes, corners, size))


def _nodes(size: tuple[float, ...], cells: tuple[int, ...]) -> Floats:
    if len(size) != len(cells) or min(size) <= 0 or min(cells) < 1:
        raise SceneError(f"box of {size} m in {cells} cells: sizes and counts must be positive")
    require_nodes(tuple(n + 1 for n in cells))
    lines = [np.linspace(0.0, s, n + 1) for s, n in zip(size, cells, strict=True)]
    planes = np.meshgrid(*reversed(lines), indexing="ij")
    return np.stack([g.ravel() for g in reversed(planes)], axis=1)


def _sides(nodes: Floats, corners: Ints, size: tuple[float, ...]) -> dict[str, Ints]:
    facets = boundary_facets(corners, len(size))
    middles = nodes[facets].mean(axis=1)
    return {
        f"{axis}{end}": facets[np.isclose(middles[:, c], at, atol=1e-9 * max(size))]
        for c, axis in enumerate("xyz"[: len(size)])
        for end, at in ((0, 0.0), (1, size[c]))
    }


def centroids(mesh: Mesh) -> Floats:
    """Middle of every cell (e, d) m."""
    return np.asarray(mesh.nodes[mesh.corners].mean(axis=1))
