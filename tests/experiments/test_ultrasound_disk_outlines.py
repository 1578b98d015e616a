"""Outlines of a round body: diameters, what differs between images, and what all of them share."""

import numpy as np
import pytest

from experiments.ultrasound_disk.round_outlines import ENDS, RoundOutlines
from validate.arrays import Floats
from validate.recording.types import Contours, Frames
from validate.register.observation import EVERYTHING
from validate.scene.meshless import RigidBody
from validate.solve.static.without_mechanics import RigidMotion

ANGLES = np.linspace(0, 2 * np.pi, 60, endpoint=False)
CIRCLE = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)
T = np.arange(3.0)


def seen(radii: Floats, scale: float = 1.0) -> RoundOutlines:
    outlines = tuple(1e-2 + r * CIRCLE for r in radii)
    contours = Contours(T, outlines, 1e-4, np.eye(4), "image")
    images = (np.zeros((16, 16), np.uint8),) * len(T)
    return RoundOutlines("diameter", "validates", contours,
                         Frames(T, images, (1e-3, 1e-3), np.eye(4), "image"), scale)  # fmt: skip


def test_diameters_scatter_and_share_their_wall() -> None:
    found = seen(np.array([4e-3, 5e-3, 6e-3]), 1.1)
    np.testing.assert_allclose(found.diameters, [8.8e-3, 11e-3, 13.2e-3], rtol=1e-9)
    assert found.scatter == pytest.approx(2.2e-3)
    assert found.wall == pytest.approx(2 * 1.1 * 1e-4)


def test_a_rigid_disk_is_held_against_every_image() -> None:
    body = RigidBody(ENDS, np.array([[-4.5e-3, 0, 0], [4.5e-3, 0, 0]]))
    run = RigidMotion().solve(body, T, np.zeros((3, 6)))
    (off,) = seen(np.array([4e-3, 5e-3, 6e-3])).deviations(run, EVERYTHING)
    np.testing.assert_allclose(off.values[:, 0], [1e-3, -1e-3, -3e-3], atol=1e-9)
    assert (off.sd, off.systematic) == (pytest.approx(2e-3), pytest.approx(2e-4))
    assert off.t is not None
    assert off.t.tolist() == T.tolist()
