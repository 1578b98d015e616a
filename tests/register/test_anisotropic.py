"""Markers whose noise differs between directions: the weighted fit and its covariance."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from validate.errors import RegistrationError
from validate.recording.types import Markers
from validate.register.markers import transform
from validate.register.markers.markers import MarkerObservation
from validate.register.markers.measures import target_covariance
from validate.register.markers.quality import MarkerFit
from validate.register.markers.transform import (
    Similarity,
    covariance_of,
    fit_weighted,
    weighted_covariance,
)
from validate.scene.geometries.box import box

# private: _MOST: replaced by a small number: a short test.

RNG = np.random.default_rng(5)
Y = RNG.uniform(-0.03, 0.03, (12, 3))
TRUE = Similarity(Rotation.from_rotvec([0.4, -0.9, 1.7]).as_matrix(), np.array([0.1, -0.2, 0.05]))
X = TRUE.inverse().apply(Y)
DEEP = np.array([1e-4, 1e-4, 2e-3])  # m: a camera sees depth badly


def test_exact_points_are_met_and_equal_noise_is_the_plain_fit() -> None:
    start = Similarity(TRUE.R @ Rotation.from_rotvec([0.1, 0.05, -0.1]).as_matrix(), TRUE.t + 0.01)
    found = fit_weighted(X, Y, covariance_of(DEEP), start)
    np.testing.assert_allclose(found.matrix, TRUE.matrix, atol=1e-12)
    noisy = X + RNG.normal(0, 1e-3, X.shape)
    plain = Similarity.rigid(noisy, Y)
    same = fit_weighted(noisy, Y, covariance_of(np.full(3, 1e-3)), start)
    np.testing.assert_allclose(same.matrix, plain.matrix, atol=1e-11)


@pytest.mark.slow
def test_the_covariance_is_that_of_many_draws_and_less_than_the_plain_fits() -> None:
    rng, C = np.random.default_rng(7), covariance_of(DEEP)
    at = np.array([[0.0, 0.0, 0.05]])
    weighted, plain = [], []
    for _ in range(800):
        x = X + rng.normal(0, 1, X.shape) * DEEP
        start = Similarity.rigid(x, Y)
        plain.append((start.apply(TRUE.inverse().apply(at)) - at)[0])
        weighted.append((fit_weighted(x, Y, C, start).apply(TRUE.inverse().apply(at)) - at)[0])
    predicted = weighted_covariance(at, Y, C, TRUE)[0]
    seen = np.cov(np.array(weighted).T)
    np.testing.assert_allclose(np.diag(seen), np.diag(predicted), rtol=0.15)
    assert np.trace(seen) < 0.8 * np.trace(np.cov(np.array(plain).T))


def test_equal_noise_has_fitzpatricks_covariance() -> None:
    C, at = covariance_of(np.full(3, 1e-3)), np.array([[0.02, 0.0, 0.06]])
    expected = target_covariance(at, Y, 1e-3 * np.sqrt(3))
    np.testing.assert_allclose(weighted_covariance(at, Y, C, TRUE), expected, rtol=1e-9, atol=1e-18)


@pytest.mark.parametrize(
    ("sd", "says"),
    [(np.ones(2), "expected one sd, three"), (np.array([1e-3, 0, 1e-3]), "not positive"),
     (np.triu(np.ones((3, 3))), "expected one sd")],
)  # fmt: skip
def test_noise_that_is_no_covariance_is_refused(sd: np.ndarray, says: str) -> None:  # type: ignore[type-arg]
    with pytest.raises(RegistrationError, match=says):
        covariance_of(sd)


def test_markers_seen_badly_in_depth_are_compared_with_their_own_noise() -> None:
    """The camera's depth is the scene's x here: that component alone is blunt."""
    mesh = box((0.06, 0.06, 0.06), (2, 2, 2))
    turn = Similarity(np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]), np.zeros(3))
    rest = Y + 0.03
    x = turn.inverse().apply(rest) + np.random.default_rng(2).normal(0, 1, (12, 3)) * DEEP
    names = tuple(f"m{i}" for i in range(12))
    markers = Markers(np.array([0.0]), names, x[None], 1e-4, "camera")
    layout = dict(zip(names, rest, strict=True))
    seen = MarkerObservation.of(markers, layout, mesh, how=MarkerFit(sd=tuple(DEEP)))
    assert seen.axis_sd == pytest.approx((2e-3, 1e-4, 1e-4), rel=0.01)
    assert (seen.along([1, 2]), seen.along([0])) == pytest.approx((1e-4, 2e-3), rel=0.01)
    assert seen.sd == pytest.approx(np.sqrt((4e-6 + 2e-8) / 3))
    fit = seen.registration.transform
    own = weighted_covariance(rest, rest, covariance_of(DEEP), fit)
    assert seen.tre == pytest.approx(np.sqrt(np.trace(own, axis1=1, axis2=2)))
    with pytest.raises(RegistrationError, match=r"by direction.*'similarity'"):
        MarkerObservation.of(markers, layout, mesh, how=MarkerFit("similarity", tuple(DEEP)))
    assert MarkerObservation.of(markers, layout, mesh, how=MarkerFit(sd=(2e-3,))).sd == 2e-3


def test_points_that_already_fit_are_not_turned() -> None:
    points = np.random.default_rng(3).normal(size=(5, 3))
    start = Similarity(np.eye(3), np.zeros(3))
    found = fit_weighted(points, points, np.diag([1.0, 4.0, 9.0]), start)
    assert (np.eye(3) == found.R).all()
    assert (found.t == 0).all()


def test_a_fit_that_does_not_settle_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transform, "_MOST", 1)
    points = np.random.default_rng(3).normal(size=(5, 3))
    turn = Rotation.from_rotvec([0.3, 0.2, 0.1]).as_matrix()
    with pytest.raises(RegistrationError, match="did not converge in 1 steps: check"):
        fit_weighted(points, points @ turn.T, np.eye(3), Similarity(np.eye(3), np.zeros(3)))
