"""Sensors of a twin: noise goes where it is declared to go."""

import numpy as np
import pytest

from experiments.fluid_phantom.sensors import OutlineSensor

# private: _segmented: called alone, case by case.


def test_an_outline_scatters_along_its_normal() -> None:
    """Of a circle the noise moves radii by sd, and no polar angle."""
    angle = np.linspace(0.0, 2 * np.pi, 2000, endpoint=False)
    circle = 0.01 * np.stack([np.cos(angle), np.sin(angle)], axis=1)

    def seen(sd: float) -> np.ndarray:
        sensor = OutlineSensor(np.eye(4), 400, sd, "block")
        return sensor._segmented(circle, np.random.default_rng(3))

    quiet, noisy = seen(0.0), seen(1e-4)
    assert np.linalg.norm(quiet, axis=1) == pytest.approx(np.full(400, 0.01), rel=1e-5)
    radius = np.linalg.norm(noisy, axis=1)
    assert (radius - 0.01).std() == pytest.approx(1e-4, rel=0.1)
    moved = noisy - quiet
    across = moved[:, 0] * quiet[:, 1] - moved[:, 1] * quiet[:, 0]
    assert np.abs(across).max() < 0.01 * 0.01 * np.abs(radius - 0.01).max()


def test_at_a_corner_the_normal_is_that_of_the_neighbouring_points() -> None:
    """Of a square, points within a step of a corner move across both sides, the others one."""
    square = 0.01 * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])

    def seen(sd: float) -> np.ndarray:
        return OutlineSensor(np.eye(4), 40, sd, "block")._segmented(
            square, np.random.default_rng(3)
        )

    moved = np.abs(seen(1e-4) - seen(0.0))
    both = moved.min(axis=1) > 0.1 * moved.max(axis=1)
    assert 4 <= both.sum() <= 8  # on either side of each corner
    assert moved.min(axis=1).astype(bool).sum() <= 8
