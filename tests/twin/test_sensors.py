"""Sensors of a twin: noise goes where it is declared to go."""

import numpy as np
import pytest

from validate.twin.sensors import OutlineSensor


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
    turned = np.sum(quiet * noisy, axis=1) / (np.linalg.norm(quiet, axis=1) * radius)
    assert turned == pytest.approx(np.ones(400), abs=1e-6)
