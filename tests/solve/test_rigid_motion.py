"""A rigid body: its points are where its pose puts them."""

import numpy as np
import pytest

from validate.errors import SceneError
from validate.scene.material import Material
from validate.scene.meshless import MaterialPoint, RigidBody
from validate.solve.march import run_scheme
from validate.solve.static.quasi_static import QuasiStatic
from validate.solve.static.without_mechanics import RigidMotion

BODY = RigidBody(("a", "b"), np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0]]))


def test_a_quarter_turn_and_a_shift() -> None:
    poses = np.array([[0, 0, 0, 0, 0, 0], [0, 0, np.pi / 2, 5.0, 6.0, 7.0]])
    run = RigidMotion().solve(BODY, np.array([0.0, 1.0]), poses)
    at = [[run.traces[f"{n}.{c}"].y for c in "xyz"] for n in "ab"]
    np.testing.assert_allclose(at[0], [[1, 5], [0, 7], [0, 7]], atol=1e-12)
    np.testing.assert_allclose(at[1], [[0, 3], [2, 6], [0, 7]], atol=1e-12)
    assert run.finished
    assert run.traces["a.x"].unit == "m"


def test_what_deforms_is_refused_and_what_needs_to_refuses_a_rigid_body() -> None:
    t, poses = np.zeros(1), np.zeros((1, 6))
    with pytest.raises(SceneError, match="RigidMotion places a RigidBody"):
        RigidMotion().solve(MaterialPoint(Material(1e3, 0.3), "uniaxial"), t, poses)
    with pytest.raises(SceneError, match="use RigidMotion"):
        run_scheme("x", QuasiStatic(), BODY, t, poses, np.array([0]))


def test_points_are_checked() -> None:
    with pytest.raises(SceneError, match="2 names, 1 different"):
        RigidBody(("a", "a"), np.zeros((2, 3)))
    with pytest.raises(SceneError, match="expected"):
        RigidBody(("a",), np.zeros((2, 3)))
