"""The block of Kuhn tetrahedra: counts, numbering, volumes, sides."""

import numpy as np
import pytest

from validate.errors import SceneError
from validate.scene.geometries.box import box, centroids


def test_paper_001s_block_has_its_counts() -> None:
    """4 x 4 x 7 mm in cells of 1 mm: 200 nodes, 672 tetrahedra (paper 001, Table 1)."""
    mesh = box((0.004, 0.004, 0.007), (4, 4, 7))
    assert (len(mesh.nodes), len(mesh.cells)) == (200, 672)
    i, j, k = 2, 3, 5
    assert mesh.nodes[i + 5 * j + 25 * k] == pytest.approx([0.002, 0.003, 0.005])


@pytest.mark.parametrize(
    ("size", "cells"), [((3.0, 2.0, 1.0), (2, 3, 4)), ((3.0, 2.0), (2, 3)), ((1.0, 1.0), (1, 1))]
)
def test_cells_fill_the_block_the_right_way_round(
    size: tuple[float, ...], cells: tuple[int, ...]
) -> None:
    mesh = box(size, cells)
    d = len(size)
    assert len(mesh.cells) == np.prod(cells) * {2: 2, 3: 6}[d]
    volumes = mesh.cell_volumes()
    assert volumes.min() > 0
    assert volumes == pytest.approx(np.full(len(volumes), np.prod(size) / len(volumes)))
    assert centroids(mesh).T @ volumes == pytest.approx(np.prod(size) * np.array(size) / 2)


def test_every_cube_is_split_along_one_diagonal() -> None:
    mesh = box((1.0, 1.0, 1.0), (1, 1, 1))
    assert all({0, 7} <= set(cell) for cell in mesh.cells.tolist())


@pytest.mark.parametrize("size", [(3.0, 2.0, 1.0), (3.0, 2.0)])
def test_sides_lie_where_their_names_say(size: tuple[float, ...]) -> None:
    d = len(size)
    cells = (2, 3, 4)[:d]
    mesh = box(size, cells)
    assert sorted(mesh.facets) == sorted(f"{c}{end}" for c in "xyz"[:d] for end in (0, 1))
    for axis, letter in enumerate("xyz"[:d]):
        for end in (0, 1):
            facets = mesh.facets[f"{letter}{end}"]
            assert (mesh.nodes[facets][..., axis] == end * size[axis]).all()
            others = [n for a, n in enumerate(cells) if a != axis]
            assert len(facets) == np.prod(others) * (d - 1)


@pytest.mark.parametrize(
    ("size", "cells"), [((1.0, 1.0), (1, 0)), ((1.0, -1.0), (1, 1)), ((1.0, 1.0), (1, 1, 1))]
)
def test_a_block_that_is_none_is_refused(size: tuple[float, ...], cells: tuple[int, ...]) -> None:
    with pytest.raises(SceneError, match="sizes and counts must be positive"):
        box(size, cells)
