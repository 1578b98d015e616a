"""Local polynomials: exact for what they hold, and honest about the noise that they fit."""

import numpy as np
import pytest

from experiments.gel_indentation.particle_linking import best_neighbours, local_fit, noise

X = np.random.default_rng(3).uniform(size=(800, 3))


def quadratic(x: np.ndarray) -> np.ndarray:
    return np.stack([1 + x[:, 0] * x[:, 2], x[:, 1] ** 2 - 2 * x[:, 0]], axis=1)


@pytest.mark.parametrize("robust", [False, True])
def test_a_quadratic_field_and_its_slopes_are_found_exactly(robust: bool) -> None:
    at = np.array([[0.4, 0.5, 0.6]])
    fit = local_fit(X, quadratic(X), at, 30, robust=robust)
    assert fit.values == pytest.approx(quadratic(at), abs=1e-6)
    assert fit.slopes[0] == pytest.approx(np.array([[0.6, 0, 0.4], [-2, 1, 0]]), abs=1e-5)


def test_a_robust_fit_passes_by_a_wrong_neighbour() -> None:
    wrong = quadratic(X)
    at = X[:1]
    nearest = np.argsort(np.linalg.norm(X - at, axis=1))[3]
    wrong[nearest] += 10
    off = [abs(local_fit(X, wrong, at, 24, 1, robust=r).values - quadratic(at)).max()
           for r in (True, False)]  # fmt: skip
    assert off[0] < 0.1 < off[1]


def test_the_noise_is_what_was_added_and_residuals_are_less() -> None:
    sd = np.array([0.1, 0.4])
    u = quadratic(X) + sd * np.random.default_rng(1).standard_normal((800, 2))
    off, found = noise(X, u)
    assert found == pytest.approx(sd, rel=0.1)
    assert (np.sqrt((off**2).mean(axis=0)) < 0.9 * sd).all()


def test_others_leave_the_place_itself_out() -> None:
    u = np.zeros((800, 1))
    u[5] = 1
    assert local_fit(X, u, X[5:6], 20, 1, others=True).values == pytest.approx(0, abs=1e-9)
    assert local_fit(X, u, X[5:6], 20, 1).values > 0.02


def test_noise_asks_for_more_neighbours_and_structure_for_fewer() -> None:
    rng = np.random.default_rng(7)
    rows = np.flatnonzero((np.abs(X - 0.5) < 0.3).all(axis=1))
    quiet = np.sin(9 * X[:, [0]]) + 0.001 * rng.standard_normal((800, 1))
    loud = quadratic(X) + rng.standard_normal((800, 2))
    assert best_neighbours(X, quiet, rows, (20, 60, 180)) == 20
    assert best_neighbours(X, loud, rows, (20, 60, 180)) == 180
