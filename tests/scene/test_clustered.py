"""Clustered blocks: the size of cells at the point, similar grids, even ones."""

import numpy as np
import pytest

from validate.scene.geometries.indented_bodies import clustered, clustered_block
from validate.scene.mesh import require_positive_cells


@pytest.mark.parametrize("at", [0.0, 0.3, 0.5, 1.0])
@pytest.mark.parametrize("share", [0.02, 0.2, 0.8])
def test_cells_at_the_point_have_their_share(at: float, share: float) -> None:
    t = np.linspace(0.0, 1.0, 200_001)
    x = clustered(t, at, share)
    assert x[[0, -1]] == pytest.approx([0.0, 1.0], abs=1e-12)
    assert (np.diff(x) > 0).all()
    slopes = np.gradient(x, t)
    assert slopes[np.argmin(np.abs(x - at))] == pytest.approx(share, rel=1e-3)
    assert slopes.min() == pytest.approx(share, rel=1e-3)


def test_a_share_of_one_is_even() -> None:
    t = np.linspace(0.0, 1.0, 7)
    assert np.array_equal(clustered(t, 0.4, 1.0), t)


def test_the_lines_of_a_finer_block_hold_those_of_a_coarser_one() -> None:
    """So that the grids of one share are similar."""
    low, high, at = (0.0, 0.01, 0.0), (0.02, 0.02, 0.005), (0.0, 0.015, 0.005)
    share = (0.1, 0.5, 0.3)
    coarse, fine = (clustered_block(low, high, (k, k, k), at, share) for k in (3, 6))
    for c in range(3):
        lines = [np.unique(mesh.nodes[:, c].round(12)) for mesh in (coarse, fine)]
        assert lines[1][::2] == pytest.approx(lines[0], abs=1e-12)
    require_positive_cells(fine)
    volume = np.prod(np.subtract(high, low))
    assert fine.cell_volumes().sum() == pytest.approx(volume, rel=1e-12)
