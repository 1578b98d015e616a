"""Circles through points of which the wall shows a part."""

import numpy as np
import pytest

from validate.recording.outlines.outline import circle_points


def test_a_part_of_a_circle_gives_the_whole() -> None:
    angle = np.linspace(0.2, 2.2, 40)  # a third of it, so that its mean is not its centre
    centre, radius = np.array([0.02, 0.03]), 0.008
    found = circle_points(centre + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    assert found.mean(axis=0) == pytest.approx(centre, rel=1e-6)
    assert np.linalg.norm(found - centre, axis=1) == pytest.approx(np.full(len(found), radius))
