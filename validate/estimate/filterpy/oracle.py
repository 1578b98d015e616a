"""Reference pairs of this package's filters and filterpy's: agreement to rounding."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.estimate.filterpy.classes import (
    EnsembleKalmanFilter,
    ExtendedKalmanFilter,
    MerweScaledSigmaPoints,
    UnscentedKalmanFilter,
    drawing,
)
from validate.estimate.filterpy.filters import kalman
from validate.estimate.kalman.formulas import (
    Gaussian,
    SigmaPoints,
    ekf_predict,
    ekf_update,
    enkf_predict,
    enkf_update,
    ensemble_gaussian,
    kf_predict,
    kf_update,
    ukf_predict,
    ukf_update,
)
from validate.estimate.reduced.reduced_kf import LinearModel


@dataclass(frozen=True)
class OracleRow:
    """Our filter beside filterpy's: the largest difference in any entry of x or P (of order 1)."""

    pair: str
    states: int
    steps: int
    largest: float


def oracle_table(steps: int = 60, seed: int = 1) -> tuple[OracleRow, ...]:
    """Every pair on a small system of its kind, every seventh measurement missing."""
    pairs = (_kalman_pair, _extended_pair, _unscented_pair, _ensemble_pair)
    return tuple(pair(steps, np.random.default_rng(seed)) for pair in pairs)


# A pendulum with damping, seen through the sine of its angle.
_STEP = 0.05
_Q, _R = np.diag([1e-4, 1e-3]), np.array([[1e-2]])
_START = Gaussian(np.array([0.6, 0.0]), np.diag([0.1, 0.2]))


def _f(x: Floats) -> Floats:
    return np.array([x[0] + _STEP * x[1], 0.98 * x[1] - _STEP * 9.81 * np.sin(x[0])])


def _f_jacobian(x: Floats) -> Floats:
    return np.array([[1.0, _STEP], [-_STEP * 9.81 * np.cos(x[0]), 0.98]])


def _h(x: Floats) -> Floats:
    return np.array([np.sin(x[0])])


def _h_jacobian(x: Floats) -> Floats:
    return np.array([[np.cos(x[0]), 0.0]])


def _measured(steps: int, rng: np.random.Generator, m: int) -> list[Floats | None]:
    return [None if k % 7 == 6 else rng.normal(0, 0.5, m) for k in range(steps)]


def _apart(ours: Gaussian, theirs: Any) -> float:
    """Largest difference in mean and covariance."""
    return float(max(np.abs(ours.x - theirs.x).max(), np.abs(ours.P - theirs.P).max()))


def _kalman_pair(steps: int, rng: np.random.Generator) -> OracleRow:
    n, m, l = 6, 3, 2
    F = 0.4 * rng.normal(size=(n, n))
    model = LinearModel(
        F,
        rng.normal(size=(n, l)),
        rng.normal(size=(m, n)),
        0.1 * np.eye(n),
        0.2 * np.eye(m),
        np.zeros(n),
        np.eye(n),
    )
    kf, ours, worst = kalman(model), Gaussian(model.x0, model.P0), 0.0
    for z in _measured(steps, rng, m):
        loads = rng.normal(size=l)
        kf.predict(u=loads)
        kf.update(z)
        ours = kf_predict(ours, model.F, model.Q, model.B @ loads)
        ours = ours if z is None else kf_update(ours, z, model.H, model.R).posterior
        worst = max(worst, _apart(ours, kf))
    return OracleRow("KalmanFilter", n, steps, worst)


def _extended_pair(steps: int, rng: np.random.Generator) -> OracleRow:
    ekf = ExtendedKalmanFilter(2, 1)
    ekf.x, ekf.P, ekf.Q, ekf.R = _START.x.copy(), _START.P.copy(), _Q, _R

    def predict_x(_: float = 0) -> None:
        ekf.x = _f(ekf.x)

    ekf.predict_x = predict_x  # its own is linear
    ours, worst = _START, 0.0
    for z in _measured(steps, rng, 1):
        ekf.F = _f_jacobian(ekf.x)
        ekf.predict()
        ekf.update(z, _h_jacobian, _h)
        ours = ekf_predict(ours, _f, _f_jacobian, _Q)
        ours = ours if z is None else ekf_update(ours, z, _h, _h_jacobian, _R).posterior
        worst = max(worst, _apart(ours, ekf))
    return OracleRow("ExtendedKalmanFilter", 2, steps, worst)


def _unscented_pair(steps: int, rng: np.random.Generator) -> OracleRow:
    sigma = SigmaPoints(0.5, 2.0, 1.0)
    points = MerweScaledSigmaPoints(2, sigma.alpha, sigma.beta, sigma.kappa)
    ukf = UnscentedKalmanFilter(2, 1, _STEP, _h, lambda x, _: _f(x), points)
    ukf.x, ukf.P, ukf.Q, ukf.R = _START.x.copy(), _START.P.copy(), _Q, _R
    ours, worst = _START, 0.0
    for z in _measured(steps, rng, 1):
        ukf.predict()
        ukf.update(z)
        ours = ukf_predict(ours, _f, _Q, sigma)
        ours = ours if z is None else ukf_update(ours, z, _h, _R, sigma).posterior
        worst = max(worst, _apart(ours, ukf))
    return OracleRow("UnscentedKalmanFilter", 2, steps, worst)


def _ensemble_pair(steps: int, rng: np.random.Generator) -> OracleRow:
    """Both filters get the same draws: a shared generator replaces filterpy's during the run."""
    N, draws = 20, _Draws(rng)
    with drawing(draws):
        enkf = EnsembleKalmanFilter(_START.x, _START.P, 1, _STEP, N, _h, lambda x, _: _f(x))
        enkf.Q, enkf.R = _Q, _R
        members, worst = draws.last.copy(), 0.0
        for z in _measured(steps, rng, 1):
            enkf.predict()
            members = enkf_predict(members, _f, draws.last)
            enkf.update(z)
            if z is not None:
                members = enkf_update(members, z, _h, _R, draws.last)
            worst = max(worst, float(np.abs(members - enkf.sigmas).max()))
            worst = max(worst, float(np.abs(ensemble_gaussian(members).x - enkf.x).max()))
    return OracleRow("EnsembleKalmanFilter", 2, steps, worst)


class _Draws:
    """Normal draws that are remembered."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng, self.last = rng, np.zeros((0, 0))

    def __call__(self, mean: Floats, cov: Floats, size: int) -> Floats:
        self.last = self.rng.multivariate_normal(mean, cov, size)
        return self.last.copy()
