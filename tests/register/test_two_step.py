"""The two-step fit of paper 000: plane, then rotation (and scale) in the plane."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from validate.errors import RegistrationError
from validate.register import Similarity, fit_two_step
from validate.register.markers.transform import fit_plane

UP = np.array([0.0, 0.0, 1.0])


def flat(seed, k=20):
    return np.random.default_rng(seed).uniform(-1, 1, (k, 3)) * [1, 0.7, 0]


def some_pose(seed, s=1.0):
    rng = np.random.default_rng(seed)
    return Similarity(Rotation.random(rng=rng).as_matrix(), rng.uniform(-1, 1, 3), s)


@given(seed=st.integers(0, 2**32 - 1), with_up=st.booleans())
def test_agrees_with_rigid_on_exact_planar_points(seed, with_up):
    T = some_pose(seed)
    x, y = flat(seed), T.apply(flat(seed))
    found = fit_two_step(x, y, up=(UP, T.R @ UP) if with_up else None)
    np.testing.assert_allclose(found.matrix, Similarity.rigid(x, y).matrix, atol=1e-12)
    np.testing.assert_allclose(found.matrix, T.matrix, atol=1e-12)


@pytest.mark.parametrize("scale", [True, False])
def test_scale_is_fitted_only_when_asked_for(scale):
    T = some_pose(1, 1.2)
    found = fit_two_step(flat(1), T.apply(flat(1)), scale=scale)
    assert found.s == pytest.approx(1.2 if scale else 1.0, abs=1e-12)
    np.testing.assert_allclose(found.R, T.R, atol=1e-12)


def test_scale_in_the_plane_is_the_least_squares_one():
    rng = np.random.default_rng(5)
    x = flat(5)
    y = x + rng.normal(0, 0.05, x.shape) * [1, 1, 0]
    a, b = (p[:, :2] - p[:, :2].mean(axis=0) for p in (x, y))
    rows = np.vstack([np.c_[a[:, 0], -a[:, 1]], np.c_[a[:, 1], a[:, 0]]])
    factor, *_ = np.linalg.lstsq(rows, np.r_[b[:, 0], b[:, 1]])  # (s cos, s sin)
    found = fit_two_step(x, y, up=(UP, UP), scale=True)
    assert found.s == pytest.approx(np.hypot(*factor), abs=1e-12)
    assert np.arctan2(found.R[1, 0], found.R[0, 0]) == pytest.approx(
        np.arctan2(factor[1], factor[0]), abs=1e-12
    )


def test_noise_keeps_it_near_rigid_but_not_equal():
    rng = np.random.default_rng(6)
    x = flat(6) + rng.normal(0, 0.01, (20, 3))
    y = flat(6)
    apart = np.abs(fit_two_step(x, y).apply(x) - Similarity.rigid(x, y).apply(x)).max()
    assert 1e-6 < apart < 2e-3  # second order in the noise


def test_the_declared_side_decides_and_a_mirror_within_the_plane_shows():
    x = flat(7)
    mirrored = x * [-1, 1, 1]
    turned = fit_two_step(x, mirrored)
    np.testing.assert_allclose(turned.apply(x), mirrored, atol=1e-12)  # exact, on its back
    assert (turned.R @ UP)[2] == pytest.approx(-1)
    kept = fit_two_step(x, mirrored, up=(UP, UP))
    assert (kept.R @ UP)[2] == pytest.approx(1)
    assert np.abs(kept.apply(x) - mirrored).max() > 0.5


def test_plane_by_hand():
    plane = fit_plane([[0, 0, 5], [2, 0, 5], [2, 1, 5], [0, 1, 5]], up=[0.3, 0, -1])
    np.testing.assert_allclose(plane.centre, [1, 0.5, 5])
    np.testing.assert_allclose(plane.axes[:, 2], [0, 0, -1], atol=1e-15)
    assert np.linalg.det(plane.axes) == pytest.approx(1)


def test_plane_is_the_total_least_squares_one():
    rng = np.random.default_rng(8)
    x = flat(8) + rng.normal(0, 0.05, (20, 3))
    plane = fit_plane(x)

    def off(n):
        return (((x - plane.centre) @ (n / np.linalg.norm(n))) ** 2).sum()

    best = off(plane.axes[:, 2])
    assert all(best < off(plane.axes[:, 2] + 0.01 * rng.normal(size=3)) for _ in range(50))


@pytest.mark.parametrize(
    ("x", "up", "said"),
    [
        (np.vstack([np.eye(3), -np.eye(3)]), None, "not a plane .spread 577, 577, 577 mm"),
        (flat(1) * [1, 0, 1], None, "20 collinear points"),
        (flat(1)[:2], None, "2 points, a fit in 3-D needs 3"),
        (flat(1)[:, :2], None, r"shape \(20, 2\)"),
        (flat(1), [1, 0, 0], "`up` lies in the marker plane"),
        (flat(1), [0, 0, 0], "`up` lies in the marker plane"),
    ],
)
def test_sets_without_a_plane_are_refused(x, up, said):
    with pytest.raises(RegistrationError, match=said):
        fit_plane(x, up=up)


def test_an_angle_that_is_not_determined_is_refused():
    square = np.array([[1.0, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])
    with pytest.raises(RegistrationError, match="in-plane angle of 4 points"):
        fit_two_step(square, square[[0, 3, 2, 1]], up=(UP, UP))  # a^H b = 0: a pure mirror
