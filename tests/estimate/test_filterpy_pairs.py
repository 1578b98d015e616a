"""filterpy as oracle and as method: equal results, and checks of array shapes."""

import copy
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from validate.errors import ComparisonError
from validate.estimate.filterpy import oracle as filterpy_oracle
from validate.estimate.filterpy.classes import drawing
from validate.estimate.filterpy.filters import (
    FILTERPY_FILTERS,
    FilterpyFilter,
    ensemble,
    kalman,
    require_shapes,
)
from validate.estimate.filterpy.oracle import OracleRow, oracle_table
from validate.estimate.kalman.formulas import (
    Gaussian,
    SigmaPoints,
    enkf_update,
    ensemble_gaussian,
    ukf_predict,
)
from validate.estimate.reduced.reduced_kf import LinearModel, ReducedKf
from validate.testing.pulled_cube import case

# private: _apart: replaced, to bring a case about.


@pytest.mark.parametrize("row", oracle_table(), ids=lambda r: r.pair)
def test_our_filters_are_filterpys_to_rounding(row: OracleRow) -> None:
    assert row.steps == 60
    assert row.largest < 1e-12


@pytest.mark.parametrize("pair", ["_kalman_pair", "_extended_pair", "_unscented_pair"])
def test_the_oracle_tells_the_largest_difference(
    monkeypatch: pytest.MonkeyPatch, pair: str
) -> None:
    apart = iter((1.0, 5.0, 3.0))
    monkeypatch.setattr(filterpy_oracle, "_apart", lambda ours, theirs: next(apart))
    assert getattr(filterpy_oracle, pair)(3, np.random.default_rng(0)).largest == 5.0


def test_a_copy_of_an_ensemble_walks_alone() -> None:
    one = np.eye(1)
    model = LinearModel(0.5 * one, one, one, 0.1 * one, 0.1 * one, np.array([1.0]), one)
    with drawing(np.random.default_rng(0).multivariate_normal):
        enkf = ensemble(model)
        before = enkf.sigmas.copy()
        other = copy.deepcopy(enkf)
        assert other.sigmas is not enkf.sigmas
        assert np.array_equal(other.sigmas, before)
        other.predict(np.array([100.0]))
        assert np.array_equal(enkf.sigmas, before)
        assert enkf.loads == pytest.approx([0.0])
    assert other.sigmas.mean() == pytest.approx(100.0, abs=2.0)


def test_a_filterpy_filter_equals_the_internal_filter_to_rounding() -> None:
    pulled = case()
    seen = pulled.measured(1, every=2)
    ours = pulled.march(ReducedKf(modes=5, settled=0.0).prepare(pulled.system, seen))
    # The unscented one subtracts G S G^T from P and has no form that keeps its digits.
    for name, rounding in (("KalmanFilter", 1e-9), ("UnscentedKalmanFilter", 1e-3)):
        run = pulled.march(FilterpyFilter(name).prepare(pulled.system, seen))
        assert np.abs(run.u - ours.u).max() < rounding * np.abs(ours.u).max()
        assert run.sd is not None
        assert ours.sd is not None
        assert np.abs(run.sd - ours.sd).max() < rounding * ours.sd.max()


def test_a_filterpy_filter_with_random_draws_repeats_and_restores_the_generator() -> None:
    pulled = case()
    enkf = FilterpyFilter("EnsembleKalmanFilter")
    before = np.random.get_state()[1].copy()  # type: ignore[union-attr,index]  # noqa: NPY002
    runs = [pulled.march(enkf.prepare(pulled.system, pulled.measured(1))) for _ in range(2)]
    assert np.array_equal(runs[0].u, runs[1].u)
    assert np.array_equal(before, np.random.get_state()[1])  # type: ignore[index]  # noqa: NPY002
    assert pulled.nrmse(runs[0]) < 0.1


def broken(name: str, value: Any) -> Callable[[LinearModel], Any]:
    def make(model: LinearModel) -> Any:
        kf = kalman(model)
        setattr(kf, name, value(model.size))
        return kf

    return make


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("x", lambda n: np.zeros((n, 1)), r"x: shape \(\d+, 1\), expected"),
        ("P", lambda n: np.eye(n - 1), r"P: shape .* expected"),
        (
            "P",
            lambda n: np.triu(np.ones((n, n))),
            "KalmanFilter.P: differs from its transpose",
        ),
        ("F", lambda n: np.eye(n + 1), r"F: shape .* expected"),
        ("R", lambda _: np.eye(2), r"R: shape \(2, 2\), expected \(3, 3\)"),
        ("H", lambda n: np.zeros((2, n)), r"H: shape .* expected"),
        ("Q", lambda n: np.full((n, n), np.nan), "Q: not finite"),
    ],
)
def test_a_filterpy_filter_of_wrong_shape_is_refused(name: str, value: Any, says: str) -> None:
    pulled = case()
    with pytest.raises(ComparisonError, match=says):
        FilterpyFilter(broken(name, value)).prepare(pulled.system, pulled.measured(1))


def test_unknown_filterpy_filters_and_other_objects_are_refused() -> None:
    pulled = case()
    with pytest.raises(ComparisonError, match=f"expected one of {', '.join(FILTERPY_FILTERS)}"):
        FilterpyFilter("Kalman").prepare(pulled.system, pulled.measured(1))
    with pytest.raises(ComparisonError, match=r"dict.x: shape None"):
        FilterpyFilter(lambda _: {}).prepare(pulled.system, pulled.measured(1))


def test_models_are_checked_at_the_door() -> None:
    one = np.eye(2)
    with pytest.raises(ComparisonError, match=r"Q: shape \(3, 3\), expected \(2, 2\)"):
        LinearModel(one, one, one, np.eye(3), one, np.zeros(2), one)
    with pytest.raises(ComparisonError, match="model P0: differs from its transpose"):
        LinearModel(one, one, one, one, one, np.zeros(2), np.array([[1.0, 1], [0, 1]]))


def test_the_sigma_points_own_beta_is_that_of_a_gaussian() -> None:
    """x^2 of a Gaussian about 0 has mean s^2 and variance 2 s^4, which beta = 2 gives exactly."""
    prior = Gaussian(np.zeros(1), np.array([[9.0]]))
    found = ukf_predict(prior, np.square, np.zeros((1, 1)), SigmaPoints(alpha=0.5))
    assert found.x == pytest.approx([9.0], rel=1e-14)
    assert pytest.approx(np.array([[2 * 81.0]]), rel=1e-13) == found.P


def test_an_ensemble_of_three_by_hand() -> None:
    """Members 1, 2, 6 (variance 7) see themselves with variance 7: halfway to what they draw."""
    members, seen = np.array([[1.0], [2.0], [6.0]]), np.array([4.0])
    assert ensemble_gaussian(members).x == pytest.approx([3.0])
    assert pytest.approx(np.array([[7.0]])) == ensemble_gaussian(members).P
    moved = enkf_update(members, seen, lambda x: x, np.array([[7.0]]), np.array([[0], [2], [-2]]))
    assert moved.ravel() == pytest.approx([2.5, 4.0, 4.0])


@pytest.mark.parametrize("name", ["predict", "update"])
def test_a_simulator_filter_without_a_method_of_a_filter_is_refused(name: str) -> None:
    one = np.eye(1)
    model = SimpleNamespace(size=1, H=one)
    methods = {m: (lambda *_: None) for m in ("predict", "update") if m != name}
    filter_ = SimpleNamespace(x=np.zeros(1), P=one, Q=one, R=one, F=one, H=one, **methods)
    with pytest.raises(ComparisonError, match=rf"SimpleNamespace has no `{name}`"):
        require_shapes(filter_, model)  # type: ignore[arg-type]
