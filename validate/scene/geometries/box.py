"""Blocks on a regular grid, of Kuhn simplices or of bricks, with their sides as facet sets."""

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.scene.mesh import Mesh, boundary_facets, kuhn_cells, require_nodes
from validate.scene.shape_functions import CORNERS


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
