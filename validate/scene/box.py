"""A block of Kuhn tetrahedra on a regular grid, with its six sides as facet sets."""

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.scene.mesh import Mesh, boundary_facets, kuhn_cells


def box(size: tuple[float, ...], cells: tuple[int, ...]) -> Mesh:
    """[0, size] m in `cells` boxes per axis; sets "x0", "x1", "y0", "y1" (3-D: "z0", "z1").

    Nodes run with x fastest: node i + j nx + k nx ny. Kuhn's split is along one diagonal, (0,0,0)
    to (1,1,1): a symmetric load moves such a mesh a little sideways.
    Raises `SceneError` for a size or a number of cells that is not positive.
    """
    if len(size) != len(cells) or min(size) <= 0 or min(cells) < 1:
        raise SceneError(f"box of {size} m in {cells} cells: sizes and counts must be positive")
    lines = [np.linspace(0.0, s, n + 1) for s, n in zip(size, cells, strict=True)]
    grid = np.meshgrid(*reversed(lines), indexing="ij")
    nodes = np.stack([g.ravel() for g in reversed(grid)], axis=1)
    d = len(size)
    corners = kuhn_cells(tuple(n + 1 for n in reversed(cells)))
    # The grid's axes are reversed, which mirrors the cells where the reversal is odd.
    corners = corners[:, [0, *range(1, d - 1), d, d - 1]]
    facets = boundary_facets(corners, d)
    middles = nodes[facets].mean(axis=1)
    sets = {
        f"{axis}{end}": facets[np.isclose(middles[:, c], at, atol=1e-9 * max(size))]
        for c, axis in enumerate("xyz"[:d])
        for end, at in ((0, 0.0), (1, size[c]))
    }
    return Mesh(nodes, corners, "tet4" if d == 3 else "tri3", sets)


def centroids(mesh: Mesh) -> Floats:
    """Middle of every cell (e, d) m."""
    return np.asarray(mesh.nodes[mesh.corners].mean(axis=1))
