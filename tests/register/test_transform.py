"""Similarity transforms and closed-form fits: exact recovery, an independent oracle, degeneracy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from validate.errors import RegistrationError
from validate.register import Similarity, fit_similarity
from validate.register.markers.transform import spread

CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3], [1, 2, 3]])


def rotation(seed, d):
    R = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    if d == 3:
        return R
    angle = np.arctan2(R[1, 0], R[0, 0])
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def points(seed, k, d):
    return np.random.default_rng(seed).uniform(-1, 1, (k, d))


SEEDS = st.integers(0, 2**32 - 1)
DIMENSIONS = st.sampled_from([2, 3])


def test_apply_is_scale_rotation_shift_by_hand():
    quarter = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]  # x to y, y to -x
    T = Similarity(quarter, [10, 20, 30], 2.0)
    np.testing.assert_allclose(T.apply([[1, 0, 0], [0, 1, 5]]), [[10, 22, 30], [8, 20, 40]])
    np.testing.assert_allclose(T.matrix @ [1, 0, 0, 1], [10, 22, 30, 1])


@settings(max_examples=50)
@given(seed=SEEDS, d=DIMENSIONS, s=st.floats(0.1, 10))
def test_the_inverse_leads_back(seed, d, s):
    a = Similarity(rotation(seed, d), points(seed, 1, d)[0], s)
    x = points(seed + 2, 5, d)
    np.testing.assert_allclose(a.inverse().apply(a.apply(x)), x, atol=1e-12)


@given(seed=SEEDS, d=DIMENSIONS, k=st.integers(5, 50))
def test_rigid_fit_recovers_the_transform_exactly(seed, d, k):
    truth = Similarity(rotation(seed, d), points(seed + 1, 1, d)[0])
    x = points(seed + 2, k, d)
    found = Similarity.rigid(x, truth.apply(x))
    np.testing.assert_allclose(found.matrix, truth.matrix, atol=1e-12)
    assert found.s == 1.0


@given(seed=SEEDS, d=DIMENSIONS, s=st.floats(0.1, 10))
def test_similarity_fit_recovers_scale_too(seed, d, s):
    truth = Similarity(rotation(seed, d), points(seed + 1, 1, d)[0], s)
    x = points(seed + 2, 12, d)
    np.testing.assert_allclose(fit_similarity(x, truth.apply(x)).matrix, truth.matrix, atol=1e-11)


@pytest.mark.parametrize("seed", range(20))
def test_rigid_fit_agrees_with_scipy_on_noisy_weighted_points(seed):
    rng = np.random.default_rng(seed)
    x, w = rng.normal(size=(15, 3)), rng.uniform(0.1, 2, 15)
    y = x @ rotation(seed, 3).T + rng.normal(0, 0.1, x.shape)
    a, b = np.average(x, axis=0, weights=w), np.average(y, axis=0, weights=w)
    oracle, _ = Rotation.align_vectors(y - b, x - a, weights=w)
    found = Similarity.rigid(x, y, w)
    np.testing.assert_allclose(found.R, oracle.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(found.t, b - oracle.apply(a), atol=1e-12)


@pytest.mark.parametrize("mirror", [1, -1])
def test_scale_minimises_the_residual(mirror):
    rng = np.random.default_rng(3)
    x = rng.normal(size=(20, 3))
    y = 1.3 * (x * [1, 1, mirror]) @ rotation(3, 3).T + rng.normal(0, 0.1, x.shape)
    best = fit_similarity(x, y)

    def cost(s):
        centred = s * (x - x.mean(axis=0)) @ best.R.T + y.mean(axis=0)
        return ((centred - y) ** 2).sum()

    assert cost(best.s) < min(cost(best.s * 1.001), cost(best.s * 0.999))


def test_a_point_of_weight_zero_does_not_count():
    truth = Similarity(rotation(4, 3), [0.1, 0.2, 0.3])
    y = truth.apply(CORNERS)
    y[4] += 7
    found = Similarity.rigid(CORNERS, y, [1, 1, 1, 1, 0])
    np.testing.assert_allclose(found.matrix, truth.matrix, atol=1e-12)


@pytest.mark.parametrize("flat", [False, True])
def test_mirrored_points_still_give_a_proper_rotation(flat):
    x = CORNERS * [1, 1, 0] if flat else CORNERS
    found = Similarity.rigid(x, x * [-1, 1, 1])
    assert np.linalg.det(found.R) == pytest.approx(1, abs=1e-12)
    residual = np.abs(found.apply(x) - x * [-1, 1, 1]).max()
    assert (residual < 1e-12) == flat  # a flat set fits its mirror image exactly, turned over


def test_spread_by_hand():
    x = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 2, 0], [0, -2, 0]])
    np.testing.assert_allclose(spread(x), [np.sqrt(2), np.sqrt(0.5), 0], atol=1e-15)


LINE = np.linspace(0, 1, 6)[:, None] * [0.01, 0.02, 0.03] + 0.1


@pytest.mark.parametrize(
    ("x", "said"),
    [
        (CORNERS[:2], "source points: 2 points, a fit in 3-D needs 3"),
        (CORNERS[:1, :2], "source points: 1 points, a fit in 2-D needs 2"),
        (np.full((5, 3), 0.3), "source points: 5 coincident points"),
        (np.zeros((5, 2)), "source points: 5 coincident points"),
        (LINE, "source points: 6 collinear points .spread 12.8, "),
        (CORNERS.T, r"source points: shape \(3, 5\)"),
        (np.where(CORNERS == 3, np.nan, CORNERS), "2 of 15 values not finite"),
    ],
)
def test_degenerate_sources_are_refused(x, said):
    with pytest.raises(RegistrationError, match=said):
        Similarity.rigid(x, x)


def test_degenerate_targets_are_refused():
    with pytest.raises(RegistrationError, match="target points: 5 coincident"):
        Similarity.rigid(CORNERS, np.ones((5, 3)))
    with pytest.raises(RegistrationError, match=r"target points \[m\]: shape \(4, 3\)"):
        Similarity.rigid(CORNERS, CORNERS[:4])


@pytest.mark.parametrize("w", [[1, 1, 0, 0, 0], [0, 0, 0, 0, 0]])
def test_weights_that_leave_too_few_points_are_refused(w):
    with pytest.raises(RegistrationError, match="a fit in 3-D needs 3"):
        Similarity.rigid(CORNERS, CORNERS, w)


def test_negative_weights_are_refused():
    with pytest.raises(RegistrationError, match="weights: 1 below 0, smallest -2"):
        Similarity.rigid(CORNERS, CORNERS, [1, 1, 1, 1, -2])


def test_two_points_on_a_plane_are_enough():
    x = np.array([[0.0, 0], [1, 0]])
    np.testing.assert_allclose(
        Similarity.rigid(x, [[0, 0], [0, 1]]).R, [[0, -1], [1, 0]], atol=1e-15
    )


@pytest.mark.parametrize(
    ("R", "s", "said"),
    [
        (np.diag([1, 1, -1]), 1, r"det -1\.000"),
        ([[1, 0.1, 0], [0, 1, 0], [0, 0, 1]], 1, r"\|R\^T R - I\| 1\.0e-01"),
        (np.eye(3), 0, "scale s: 0"),
        (np.eye(3), np.nan, "scale s: nan"),
        (np.eye(2), 1, r"rotation R: shape \(2, 2\)"),
    ],
)
def test_what_is_no_similarity_is_refused(R, s, said):
    with pytest.raises(RegistrationError, match=said):
        Similarity(R, [0, 0, 0], s)


def test_four_dimensions_are_refused():
    with pytest.raises(RegistrationError, match="4 coordinates"):
        Similarity(np.eye(4), np.zeros(4))


def test_arrays_are_read_only():
    T = Similarity.rigid(CORNERS, CORNERS)
    with pytest.raises(ValueError, match="read-only"):
        T.R[0, 0] = 2
