"""Residuals and scores: hand-computed cases, signs, and nothing compared in silence."""

from dataclasses import replace

import numpy as np
import pytest
from phantoms import CAPSULE, COARSE_GRID, phantom_mesh, phantom_responses
from validate.register.observe import (
    Hold,
    MarkerObservation,
    OutlineObservation,
    Registered,
    SignalObservation,
)

from validate.arrays import rms
from validate.compare.residual import Residual, rest_residuals, static_residuals
from validate.compare.score import (
    METRICS,
    bias,
    max_length,
    mean_length,
    run_scores,
    scores_of,
)
from validate.errors import ComparisonError
from validate.fem.locate import nearest_node_rows
from validate.recording.types import Signal
from validate.register.plane import cavity_sampler
from validate.solve.fluid import ExactPressure
from validate.solve.march import march
from validate.solve.types import Run

THREE = np.array([[3.0, 4.0], [0.0, 0.0], [0.0, -5.0]])
LINE = np.array([[1.0], [-2.0], [4.0]])
T = np.arange(3.0)
POSE = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0.0225], [0, 1, 0, 0], [0, 0, 0, 1]])


def residual(values: np.ndarray, quantity: str = "contour", **more: float) -> Residual:
    return Residual(quantity, "9mm", values, 0.1, 0.0, "m", "what it is", **more)


# Statistics


@pytest.mark.parametrize(
    ("statistic", "plane", "line"),
    [
        (rms, np.sqrt(50 / 3), np.sqrt(7.0)),
        (mean_length, 10 / 3, 7 / 3),
        (max_length, 5.0, 4.0),
        (bias, np.sqrt(1 + 1 / 9), 1.0),
    ],
)
def test_statistics_of_three_points(statistic, plane: float, line: float) -> None:  # type: ignore[no-untyped-def]
    assert statistic(THREE) == pytest.approx(plane, rel=1e-15)
    assert statistic(LINE) == pytest.approx(line, rel=1e-15)


def test_bias_keeps_its_sign_in_one_dimension() -> None:
    assert bias(-LINE) == -1.0


@pytest.mark.parametrize("metric", METRICS, ids=lambda m: m[0])
def test_every_metric_of_zero_is_zero_and_scales(metric) -> None:  # type: ignore[no-untyped-def]
    statistic = metric[1]
    assert statistic(np.zeros((3, 2))) == 0
    assert statistic(1e-3 * THREE) == pytest.approx(1e-3 * statistic(THREE), rel=1e-14)
    assert statistic(THREE[[2, 0, 1]]) == pytest.approx(statistic(THREE), rel=1e-14)


def test_scores_carry_unit_count_and_definition() -> None:
    scores = scores_of(residual(THREE), "measured")
    assert [s.name for s in scores] == [f"contour.{m}@9mm" for m in ("rms", "mean", "max", "bias")]
    assert [s.value for s in scores] == [m(THREE) for _, m, _ in METRICS]
    assert {(s.unit, s.count, s.against) for s in scores} == {("m", 3, "measured")}
    assert scores[0].definition == "what it is; root mean square over the points"


def test_scores_of_a_scalar_keep_its_sign_and_both_values() -> None:
    one = residual(np.array([[-2.0]]), "pressure", simulated=5.0, measured=7.0)
    assert {s.name: s.value for s in scores_of(one, "measured")} == {
        "pressure@9mm": -2.0,
        "pressure.simulated@9mm": 5.0,
        "pressure.measured@9mm": 7.0,
    }
    bare = scores_of(residual(np.array([[-2.0]])), "measured")
    assert [s.name for s in bare] == ["contour@9mm"]


# Residuals


def test_residual_of_nothing_is_refused() -> None:
    with pytest.raises(ComparisonError, match="contour@9mm: 0 matched samples"):
        residual(np.zeros((0, 2)))


@pytest.mark.parametrize("bad", [np.array([[np.nan]]), np.array([[np.inf]]), np.zeros(3)])
def test_residual_of_anything_but_finite_rows_is_refused(bad: np.ndarray) -> None:
    with pytest.raises(ComparisonError, match="residual contour@9mm"):
        residual(bad)


@pytest.fixture(scope="module")
def run() -> Run:
    stepper = ExactPressure().on(phantom_responses(COARSE_GRID))
    return march("exact", stepper, T, np.array([[0.0], [0.004], [0.009]]), np.arange(3), 0.5)


@pytest.fixture(scope="module")
def registered(run: Run) -> Registered:
    """What this very run would be measured as: every residual must be zero."""
    mesh = phantom_mesh(COARSE_GRID)
    stage = Signal(T, np.array([[0.0], [4e-3], [9e-3]]), "m", 0.0, "phantom")
    holds = tuple(Hold(f"{d:g}mm", 1e-3 * d, t) for d, t in zip((0, 4, 9), T, strict=True))
    top = mesh.facet_nodes("y1")[[3, 20, 41]]
    rest = mesh.nodes[top]
    x = rest + run.u[:, top]
    rows = nearest_node_rows(mesh, rest)
    markers = MarkerObservation(T, ("a", "b", "c"), x, rest, rows, 1e-4, np.full(3, 3e-4), None)  # type: ignore[arg-type]
    wall = cavity_sampler(mesh, "cavity", CAPSULE)
    outline = OutlineObservation(T, (), POSE, 1.5e-4, wall)
    outline = replace(outline, outlines=tuple(outline.simulated(u) for u in run.u))
    signals = tuple(
        SignalObservation(quantity, trace, T, run.traces[trace].y, unit, sd)
        for quantity, trace, unit, sd in (
            ("force.plate", "stage.force", "N", 0.02),
            ("pressure", "cyst.pressure", "Pa", 10.0),
        )
    )
    return Registered(stage, holds, markers, outline, signals)


def test_a_run_against_itself_leaves_nothing(registered: Registered, run: Run) -> None:
    found = {r.name: r for r in static_residuals(registered, run)}
    quantities = [
        "contour", "contour.material", "contour.top_left", "contour.area", "contour.centroid",
        "marker.inplane", "marker.vertical", "force.plate", "pressure", "volume.relative_error",
    ]  # fmt: skip
    assert sorted(found) == sorted(f"{q}@{d}" for q in quantities for d in ("4mm", "9mm"))
    for r in found.values():
        assert np.abs(r.values).max() < 1e-13, r.name
    assert found["contour@9mm"].count == len(registered.outline.outlines[2])  # type: ignore[union-attr]
    assert found["contour.material@9mm"].values.shape == (36, 2)
    assert found["marker.inplane@9mm"].values.shape == (3, 2)
    assert found["marker.inplane@9mm"].systematic == pytest.approx(3e-4 / np.sqrt(3))


def test_residuals_are_simulated_less_measured(registered: Registered, run: Run) -> None:
    """Every measurement is moved by a known amount; the residual is its negative."""
    assert registered.markers is not None
    assert registered.outline is not None
    x = registered.markers.x + np.array([1e-3, 2e-3, 3e-3])
    outlines = list(registered.outline.outlines)
    outlines[2] = outlines[2] + [0.0, 1e-3]
    signals = tuple(replace(s, y=s.y + 7.0) for s in registered.signals)
    moved = Registered(
        registered.stage,
        registered.holds,
        replace(registered.markers, x=x),
        replace(registered.outline, outlines=tuple(outlines)),
        signals,
    )
    found = {r.name: r for r in static_residuals(moved, run)}
    assert found["marker.inplane@9mm"].values == pytest.approx(np.tile([-1e-3, -3e-3], (3, 1)))
    assert found["marker.vertical@9mm"].values == pytest.approx(np.full((3, 1), -2e-3))
    assert found["pressure@9mm"].values[0, 0] == pytest.approx(-7.0)
    assert found["force.plate@9mm"].measured == pytest.approx(
        found["force.plate@9mm"].simulated + 7.0  # type: ignore[operator]
    )
    assert found["contour.centroid@9mm"].values == pytest.approx(np.array([[0, -1e-3]]), abs=1e-12)
    assert found["contour.area@9mm"].values[0, 0] == pytest.approx(0.0, abs=1e-15)
    assert found["contour.material@9mm"].values == pytest.approx(
        np.tile([0, -1e-3], (36, 1)), abs=1e-12
    )
    distances = found["contour@9mm"].values[:, 0]
    assert distances.max() == pytest.approx(1e-3, rel=0.05)
    assert distances.min() == pytest.approx(-1e-3, rel=0.05)


def test_markers_not_seen_are_counted_out(registered: Registered, run: Run) -> None:
    assert registered.markers is not None
    x = registered.markers.x.copy()
    x[2, 1, 0] = np.nan
    partly = replace(registered, markers=replace(registered.markers, x=x))
    found = {r.name: r for r in static_residuals(partly, run)}
    assert found["marker.inplane@9mm"].count == 2
    assert found["marker.inplane@4mm"].count == 3
    x[2] = np.nan
    partly = replace(registered, markers=replace(registered.markers, x=x))
    with pytest.raises(ComparisonError, match=r"marker\.inplane@9mm: 0 matched samples"):
        static_residuals(partly, run)


def test_run_that_ended_early_cannot_be_compared(registered: Registered, run: Run) -> None:
    short = replace(run, at=run.at[:2], u=run.u[:2])
    with pytest.raises(ComparisonError, match="exact: 2 output frames for 3 loads; the run ended"):
        static_residuals(registered, short)


@pytest.mark.parametrize("change", [{"trace": "nose.pressure"}, {"unit": "kPa"}])
def test_signal_without_its_trace_is_refused(
    registered: Registered, run: Run, change: dict[str, str]
) -> None:
    signals = (replace(registered.signals[1], **change),)  # type: ignore[arg-type]
    with pytest.raises(ComparisonError, match=r"exact: no trace '.*' in"):
        static_residuals(replace(registered, signals=signals), run)


def test_nothing_near_in_time_is_zero_matches(registered: Registered, run: Run) -> None:
    late = tuple(replace(s, t=s.t + 100.0) for s in registered.signals)
    with pytest.raises(ComparisonError, match="0 matched samples; check the clocks"):
        static_residuals(replace(registered, signals=late), run)


def test_rest_residuals_are_outline_and_markers_at_rest(registered: Registered, run: Run) -> None:
    names = [r.name for r in rest_residuals(registered, run)]
    assert names == ["contour@0mm", "marker.inplane@0mm", "marker.vertical@0mm"]


def test_cost_of_a_run(run: Run) -> None:
    scores = {s.name: s for s in run_scores(run)}
    assert run.step_s is not None
    assert scores["setup"].value == 0.5
    assert scores["step.p50"].value == run.step_s.p50
    assert scores["step.p99"].count == 3
    assert scores["updates.max"].value == run.traces["updates"].y.max() > 0
    untimed = run_scores(replace(run, step_s=None))
    assert [s.name for s in untimed] == ["setup", "updates.max"]
