"""Gate and clock against chi-square and against draws of their own model."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse
from scipy.stats import chi2

from validate.arrays import Floats
from validate.estimate.consistency import nis_consistency
from validate.estimate.gating import Care, care_of
from validate.estimate.kalman.covariance import Dense
from validate.estimate.measurements import Measurements

DT, SD_T, SD = 0.01, 0.003, 1e-4
NAMES = ("a.x", "a.y", "b.x", "b.y")
SPEED = np.array([0.4, -0.1, 0.2, 0.3])  # m/s
# Two markers in a plane that drift: positions, then speeds, which hardly change.
DRIFT = Dense(
    np.block([[np.eye(4), DT * np.eye(4)], [np.zeros((4, 4)), np.eye(4)]]),
    np.diag([0.0] * 4 + [1e-8] * 4),
    np.hstack([np.eye(4), np.zeros((4, 4))]),
    np.full(4, SD**2),
    np.diag([1e-6] * 4 + [1e-4] * 4),
)


def care(gate: float | None = None, clock: float | None = None) -> Care | None:
    seen = Measurements(
        np.array([DT]), sparse.csr_array(np.eye(4)), np.zeros((1, 4)), np.full(4, SD), NAMES
    )
    return care_of(seen, gate, clock, DT)


def drifted(
    sd_t: float, believed: float, gate: float | None, seeds: int = 40, steps: int = 80
) -> tuple[Floats, Floats, int, int]:
    """NIS and its degrees over all seeds, looks tested and rejected: every look is late by a draw
    of `sd_t`, and the filter takes the clock to be off by `believed` s."""
    rng, own = np.random.default_rng(4), care(gate, believed)
    nis, dof, tested, rejected = [], [], 0, 0
    for _ in range(seeds):
        claim = DRIFT.start()
        truth = np.append(np.zeros(4), SPEED) + np.sqrt(np.diag(DRIFT.P0)) * rng.normal(size=8)
        x = np.append(np.zeros(4), SPEED)
        for _ in range(steps):
            truth = DRIFT.A @ truth + np.sqrt(np.diag(DRIFT.Q)) * rng.normal(size=8)
            z = truth[:4] + truth[4:] * sd_t * rng.normal() + SD * rng.normal(size=4)
            prior, claim = DRIFT.A @ x, DRIFT.predict(claim)
            assert own is not None
            gain, claim, found, _ = own.update(DRIFT, claim, z, prior[:4], (prior - x)[:4])
            x = prior if gain is None else prior + gain.G @ found.y[np.array(gain.seen)]
            nis.append(found.nis)
            dof.append(float(found.dof))
            if found.gated:
                tested, rejected = tested + found.gated.tested, rejected + found.gated.rejected
    return np.array(nis), np.array(dof), tested, rejected


@pytest.mark.slow
def test_what_is_measured_late_is_consistent_only_for_who_doubts_the_clock() -> None:
    nis, dof, _, _ = drifted(SD_T, SD_T, None)
    assert nis_consistency(nis, dof).holds
    nis, dof, _, _ = drifted(SD_T, 1e-12, None)
    assert nis_consistency(nis, dof).mean > 10


@pytest.mark.slow
def test_a_gate_rejects_the_share_of_good_looks_that_it_says() -> None:
    """Rejected looks among 6400 of a filter whose claims hold, by the binomial distribution. A
    tight gate rejects more (14 % at .9): what it misses of good looks leaves larger errors."""
    for gate in (0.99,):
        _, _, tested, rejected = drifted(SD_T, SD_T, gate)
        assert tested == 6400
        expected = (1 - gate) * tested
        assert abs(rejected - expected) < 4 * np.sqrt(expected)


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.5, 0.95, 0.9999]))
def test_a_markers_block_is_tested_as_if_no_other_were_there(seed: int, gate: float) -> None:
    """Just inside and just outside of the ellipse, under an S that correlates everything; one
    component less has a quantile of its own."""
    rng, own = np.random.default_rng(seed), care(gate)
    assert own is not None
    root = rng.normal(size=(4, 4)) + 2 * np.eye(4)
    S, z = root @ root.T, rng.normal(size=4)
    for i in ([0, 1], [1]):
        given_z = np.full(4, np.nan)
        squared = z[i] @ np.linalg.inv(S[np.ix_(i, i)]) @ z[i]
        for factor, passes in ((0.999, True), (1.001, False)):
            given_z[i] = factor * z[i] * np.sqrt(chi2.ppf(gate, len(i)) / squared)
            kept, found = own.passed(given_z, np.zeros(4), S)
            assert np.isfinite(kept[i]).all() == passes
            assert found is not None
            assert (found.tested, found.rejected) == (1, int(not passes))
            assert (found.far[0] > 0) == (not passes)


def test_an_outlier_takes_no_other_marker_along() -> None:
    own = care(0.999)
    assert own is not None
    S = np.full((4, 4), 0.9) + 0.1 * np.eye(4)
    kept, found = own.passed(np.array([100.0, 0.0, 1.0, 0.5]), np.zeros(4), S)
    assert np.isfinite(kept).tolist() == [False, False, True, True]
    assert found is not None
    assert found.far[0] == pytest.approx(np.sqrt(1e4 / (1 - 0.81)))


def test_without_gate_and_doubt_there_is_no_care() -> None:
    assert care() is None
    assert care(clock=0.0) is None
