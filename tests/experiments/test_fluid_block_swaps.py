"""Displacements given in place of forces: thousands of pivots against the compliance itself."""

import numpy as np
import pytest
from phantoms import COARSE_GRID, phantom_mesh, phantom_scene

from experiments.fluid_block.boundary_swap import Swapped, mixed
from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.linear_solvers.condense import Condensed
from validate.fem.system import build


@pytest.fixture(scope="module")
def A() -> Floats:
    """The compliance of the phantom on its cavity and its plate."""
    small = Condensed.of(build(phantom_scene(phantom_mesh(COARSE_GRID))), np.arange(12))
    return np.asarray(small.compliance[np.ix_(small.free, small.free)])


def test_ten_thousand_swaps_keep_forces_and_displacements_together(A: Floats) -> None:
    """Forces and displacements given at random: u = A f within 1e-9."""
    random = np.random.default_rng(5)
    swapped = Swapped(A)
    for i in random.integers(0, len(A), 10_000):
        swapped.swap(int(i))
    assert swapped.pivots == 10_000
    assert 0 < swapped.worst_drift < 1e-9
    assert 0.3 < swapped.driven.mean() < 0.7
    given = random.normal(size=len(A)) * np.where(swapped.driven, 1e-3, 1.0)
    u, f = swapped.solve(given)
    assert np.array_equal(np.where(swapped.driven, u, f), given)
    assert u == pytest.approx(A @ f, abs=1e-9 * np.abs(u).max())


def test_a_matrix_made_at_once_is_that_of_single_pivots(A: Floats) -> None:
    A = A[:40, :40]
    swapped = Swapped(A)
    for i in (3, 17, 5, 3, 30):
        swapped.swap(i)
    at_once = mixed(A, np.array([5, 17, 30]))
    size = np.sqrt(np.diag(A))
    scale = np.where(swapped.driven, 1 / size, size)
    assert swapped.T / np.outer(scale, scale) == pytest.approx(
        at_once / np.outer(scale, scale), abs=1e-11
    )
    swapped.refactor()
    assert pytest.approx(at_once, abs=0) == swapped.T
    assert swapped.refactorisations == 1


def test_a_swap_and_back_leaves_the_matrix(A: Floats) -> None:
    swapped = Swapped(A)
    swapped.swap(7)
    assert swapped.driven.sum() == 1
    swapped.swap(7)
    assert not swapped.driven.any()
    assert pytest.approx(A, abs=1e-13 * np.abs(A).max()) == swapped.T


def test_drift_beyond_the_limit_is_measured_and_mended(A: Floats) -> None:
    swapped = Swapped(A[:30, :30])
    swapped.swap(4)
    swapped.T[2, 3] *= 1 + 1e-4
    assert swapped.drift() > 1e-9
    for _ in range(63):
        swapped.swap(8)
    assert swapped.refactorisations == 1
    assert swapped.drift() < 1e-12


def test_what_follows_from_others_cannot_be_driven() -> None:
    swapped = Swapped(np.array([[1.0, 1.0], [1.0, 1.0]]))
    swapped.swap(0)
    with pytest.raises(SceneError, match=r"unknown 1 cannot.*0"):
        swapped.swap(1)
