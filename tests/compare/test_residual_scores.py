"""Residuals and scores: hand-computed cases, signs, and nothing compared in silence."""

from dataclasses import replace

import numpy as np
import pytest
from phantoms import CAPSULE, COARSE_GRID, phantom_mesh, phantom_responses

from validate.arrays import Floats, rms
from validate.compare.residual import Residual, rest_residuals, stacked, unanswered
from validate.compare.score import (
    METRICS,
    bias,
    max_length,
    mean_length,
    run_scores,
    scores_of,
)
from validate.errors import ComparisonError
from validate.fem.assembly.locate import nearest_node_rows
from validate.register.markers.markers import MarkerObservation, Together
from validate.register.observation import Selection
from validate.register.outlines.outlines import Corner, OutlineObservation
from validate.register.outlines.sections import SurfaceSampler
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.solve.fluid.cavities import ExactPressure
from validate.solve.march import march
from validate.solve.types import Outcome, Run

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
    by_hand = [np.sqrt(50 / 3), 10 / 3, 5.0, np.sqrt(1 + 1 / 9)]
    assert [s.value for s in scores] == pytest.approx(by_hand, rel=1e-15)
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
    with pytest.raises(ComparisonError, match="contour@9mm: 0 matched points"):
        residual(np.zeros((0, 2)))


@pytest.mark.parametrize("bad", [np.array([[np.nan]]), np.array([[np.inf]]), np.zeros(3)])
def test_residual_of_anything_but_finite_rows_is_refused(bad: np.ndarray) -> None:
    with pytest.raises(ComparisonError, match="residual contour@9mm"):
        residual(bad)


@pytest.fixture(scope="module")
def run() -> Run:
    stepper = ExactPressure().on(phantom_responses(COARSE_GRID))
    return march("exact", stepper, T, np.array([[0.0], [0.004], [0.009]]), np.arange(3), 0.5)


GATHERED = (
    Together("marker.inplane", (0, 2), "in the plane"),
    Together("marker.vertical", (1,), "across it"),
)
CORNER = Corner("contour.top_left", np.deg2rad(225.0), "a corner")


def holds_of(t: Floats) -> tuple[Selection, ...]:
    words = "one sample at the load step"
    at = zip(("0mm", "4mm", "9mm"), t, strict=True)
    return tuple(Selection(label, np.array([instant]), words) for label, instant in at)


@pytest.fixture(scope="module")
def registered(run: Run) -> Registered:
    """What this very run would be measured as: every residual must be zero."""
    mesh = phantom_mesh(COARSE_GRID)
    y = np.array([[0.0], [4e-3], [9e-3]])
    stage = SignalObservation("stage", "drives", T, y, "m", 0.0)
    top = mesh.facet_nodes("y1")[[3, 20, 41]]
    rest = mesh.nodes[top]
    markers = MarkerObservation(
        "markers", "validates", T, ("a", "b", "c"), rest + run.u[:, top], rest,
        nearest_node_rows(mesh, rest), 1e-4, np.full(3, 3e-4), None, GATHERED,  # type: ignore[arg-type]
    )  # fmt: skip
    wall = SurfaceSampler.of_cavity(mesh, "cavity", CAPSULE)
    outline = OutlineObservation(
        "outline", "validates", T, (), POSE, 1.5e-4, wall, 0.0, (CORNER,)
    )  # fmt: skip
    outline = replace(outline, outlines=tuple(outline.simulated(u) for u in run.u))
    signals = tuple(
        SignalObservation(
            quantity, "validates", T, run.traces[trace].y[:, None], unit, sd, quantity, trace
        )
        for quantity, trace, unit, sd in (
            ("force.plate", "stage.force", "N", 0.02),
            ("pressure", "cyst.pressure", "Pa", 10.0),
        )
    )
    rest_hold, *holds = holds_of(T)
    return Registered((stage, outline, markers, *signals), tuple(holds), rest_hold)


def changed(registered: Registered, kind: type, **values: object) -> Registered:
    """The recording with every compared observation of a kind changed."""
    kept = tuple(
        replace(o, **values) if isinstance(o, kind) and o.role != "drives" else o
        for o in registered.observations
    )
    return replace(registered, observations=kept)


def by_name(registered: Registered, run: Run) -> dict[str, Residual]:
    return {r.name: r for r in Residual.of(registered, run)}


def test_a_run_against_itself_leaves_nothing(registered: Registered, run: Run) -> None:
    found = by_name(registered, run)
    quantities = [
        "contour", "contour.material", "contour.top_left", "contour.area", "contour.centroid",
        "marker.inplane", "marker.vertical", "force.plate", "pressure", "volume.relative_error",
    ]  # fmt: skip
    assert sorted(found) == sorted(f"{q}@{d}" for q in quantities for d in ("4mm", "9mm"))
    for r in found.values():
        assert np.abs(r.values).max() < 1e-13, r.name
    (outline,) = registered.of(OutlineObservation)
    assert found["contour@9mm"].count == len(outline.outlines[2])
    assert found["contour.material@9mm"].values.shape == (36, 2)
    assert found["marker.inplane@9mm"].values.shape == (3, 2)
    assert found["marker.inplane@9mm"].systematic == pytest.approx(3e-4 / np.sqrt(3))


def test_residuals_are_simulated_less_measured(registered: Registered, run: Run) -> None:
    """Every measurement is moved by a known amount; the residual is its negative."""
    ((outline,), (markers,)) = (registered.of(k) for k in (OutlineObservation, MarkerObservation))
    outlines = list(outline.outlines)
    outlines[2] = outlines[2] + [0.0, 1e-3]
    moved = changed(registered, MarkerObservation, x=markers.x + np.array([1e-3, 2e-3, 3e-3]))
    moved = changed(moved, OutlineObservation, outlines=tuple(outlines))
    shifted = tuple(
        replace(o, y=o.y + 7.0) if o.name in ("force.plate", "pressure") else o
        for o in moved.observations
    )
    found = by_name(replace(moved, observations=shifted), run)
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
    (markers,) = registered.of(MarkerObservation)
    x = markers.x.copy()
    x[2, 1, 0] = np.nan
    found = by_name(changed(registered, MarkerObservation, x=x), run)
    assert found["marker.inplane@9mm"].count == 2
    assert found["marker.inplane@4mm"].count == 3
    x[2] = np.nan
    with pytest.raises(ComparisonError, match=r"marker\.inplane@9mm: 0 matched points"):
        Residual.of(changed(registered, MarkerObservation, x=x), run)


def test_a_run_that_ended_early_leaves_no_residual(registered: Registered, run: Run) -> None:
    """It has no error over the whole, so its checks have nothing and fail."""
    assert len(Residual.of(registered, run)) == 20
    assert Residual.of(registered, replace(run, outcome=Outcome("diverged", 2, "told so"))) == ()
    assert Residual.of(registered, replace(run, t=run.t[:2])) == ()


def test_a_hold_without_an_output_frame_is_refused(registered: Registered, run: Run) -> None:
    few = replace(run, at=run.at[:2], u=run.u[:2])
    with pytest.raises(ComparisonError, match="exact: 2 output frames, none at '9mm'"):
        Residual.of(registered, few)


def test_a_signal_without_its_trace_is_told_and_not_compared(
    registered: Registered, run: Run
) -> None:
    """A scheme without pressures still has all other scores; its checks of pressure fail."""
    traces = {k: v for k, v in run.traces.items() if k != "cyst.pressure"}
    dry = replace(run, traces=traces)
    assert by_name(registered, run).keys() - by_name(registered, dry).keys() == {
        "pressure@4mm", "pressure@9mm",
    }  # fmt: skip
    assert unanswered(registered, run) == ()
    (told,) = unanswered(registered, dry)
    assert told.startswith("pressure: pressure compared with nothing, because no probe or trace")


def test_a_signal_in_another_unit_than_its_trace_is_refused(
    registered: Registered, run: Run
) -> None:
    units = changed(registered, SignalObservation, unit="kPa")
    with pytest.raises(ComparisonError, match=r"exact.*'stage.force'.* in kPa"):
        Residual.of(units, run)


def test_nothing_near_in_time_is_zero_matches(registered: Registered, run: Run) -> None:
    with pytest.raises(ComparisonError, match="0 matched samples; check the clocks"):
        Residual.of(changed(registered, SignalObservation, t=T + 100.0), run)


def test_rest_residuals_are_outline_and_markers_at_rest(registered: Registered, run: Run) -> None:
    names = [r.name for r in rest_residuals(registered, run)]
    assert names == ["contour@0mm", "marker.inplane@0mm", "marker.vertical@0mm"]
    assert rest_residuals(replace(registered, rest=None), run) == ()


def test_cost_of_a_run(run: Run) -> None:
    scores = {s.name: s for s in run_scores(run)}
    assert run.step_s is not None
    assert scores["setup"].value == 0.5
    assert scores["step.p50"].value == run.step_s.p50
    assert scores["step.p99"].count == 3
    assert scores["updates.max"].value == run.traces["updates"].y.max() > 0
    untimed = run_scores(replace(run, step_s=None))
    assert [s.name for s in untimed] == ["setup", "updates.max"]


@pytest.mark.parametrize(
    ("parts", "expected"), [((3, 4, 5), 12), ((None, None), None), ((3, None), 11), ((None, 3), 11)]
)
def test_degrees_of_freedom_of_repeats_are_added(
    parts: tuple[int | None, ...], expected: int | None
) -> None:
    """Of 8 values each; None says that all of them are independent."""
    each = [replace(residual(np.full((8, 1), float(i))), freedom=n) for i, n in enumerate(parts)]
    joined = stacked(each)["contour@9mm"]
    assert joined.freedom == expected
    assert joined.values[:, 0].tolist() == [float(i) for i in range(len(parts)) for _ in range(8)]


def test_repeats_keep_their_measured_values_only_where_all_have_them() -> None:
    one = residual(np.ones((2, 1)))
    known = replace(one, reference=np.array([[3.0], [4.0]]), simulated=1.0, measured=2.0)
    both = stacked([known, known])[one.name]
    assert both.reference is not None
    assert both.reference[:, 0].tolist() == [3.0, 4.0, 3.0, 4.0]
    assert (both.simulated, both.measured) == (None, None)
    assert stacked([known, one])[one.name].reference is None
    assert stacked([one, known])[one.name].reference is None


def test_arrays_in_another_order_give_the_same_digits() -> None:
    """A stored residual comes back row by row, whatever view it was cut from."""
    turned = np.random.default_rng(3).normal(size=(3, 400)).T
    one, other = (
        Residual("tip", "all", x, 0.0, 0.0, "m", "of a test", reference=x)
        for x in (turned, turned.copy(order="C"))
    )
    assert one.reference is not None
    assert other.reference is not None
    assert one.values.sum() == other.values.sum()
    assert one.reference.sum() == other.reference.sum()
    assert not one.reference.flags.writeable
    assert turned.flags.writeable
