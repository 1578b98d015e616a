"""A square block with a square cavity, in the plane (paper 000, Fig. 4)."""

import numpy as np

from validate.errors import SceneError
from validate.scene.mesh import Mesh, boundary_facets


def square_with_hole(side: float, hole: float, n: int) -> Mesh:
    """n x n squares split by alternating diagonals; x centred, y from -side to 0; sizes m.

    Facet sets "bottom" and "cavity". Raises `SceneError` when the hole is not a whole, centred
    number of squares, or touches the outer boundary.
    """
    cells_of_hole = hole * n / side
    k = round(cells_of_hole)
    if abs(cells_of_hole - k) > 1e-9 or not 0 < k < n - 1 or (n - k) % 2:
        raise SceneError(
            f"a hole of {1e3 * hole:g} mm in {n} squares over {1e3 * side:g} mm takes "
            f"{cells_of_hole:g} of them: choose a whole number, centred, inside the block"
        )
    line = np.linspace(0.0, side, n + 1)
    x, y = np.meshgrid(line - side / 2, line - side, indexing="ij")
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    inner = (n - k) // 2
    solid = ~((i >= inner) & (i < inner + k) & (j >= inner) & (j < inner + k))
    i, j = i[solid], j[solid]
    a, b = i * (n + 1) + j, (i + 1) * (n + 1) + j
    d, c = a + 1, b + 1
    even = ((i + j) % 2 == 0)[:, None]
    first = np.where(even, np.stack([a, b, c], 1), np.stack([a, b, d], 1))
    second = np.where(even, np.stack([a, c, d], 1), np.stack([b, c, d], 1))
    cells = np.vstack([first, second])
    nodes = np.stack([x.ravel(), y.ravel()], axis=1)
    used, number = np.unique(cells, return_inverse=True)
    nodes, cells = nodes[used], number.reshape(cells.shape)
    outside = boundary_facets(cells, 2)
    middle = nodes[outside].mean(axis=1)
    near = np.abs(middle - [0.0, -side / 2]).max(axis=1) < hole / 2 + 0.25 * side / n
    facets = {"bottom": outside[np.isclose(middle[:, 1], -side)], "cavity": outside[near]}
    return Mesh(nodes, cells, "tri3", facets)
