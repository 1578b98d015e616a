"""Measurements: shapes at the door, and the steps on which they land."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import sparse

from validate.errors import ComparisonError, SceneError
from validate.estimate.kalman.displacement_filter import load_shapes
from validate.estimate.kalman.formulas import best_gain, innovation
from validate.estimate.measurements import Measurements, on_steps
from validate.estimate.reduced.load_scale import LoadScale
from validate.fem.assembly.locate import Rows
from validate.fem.system import build
from validate.register.markers.markers import MarkerObservation
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.testing.pulled_cube import DT, PAPER, case, cube


def test_measurements_land_on_the_nearest_step() -> None:
    seen = case().measured(1, every=5)
    jittered = replace(seen, t=seen.t + 0.009 * DT * np.array([1, -1] * 6))
    table = jittered.timetable(DT)
    assert sorted(table.z) == list(range(5, 61, 5))
    assert table.at(6) is None
    assert np.array_equal(table.z[10], seen.z[1])


def test_rows_without_a_value_and_rest_are_left_out() -> None:
    seen = case().measured(1, every=5)
    z = seen.z.copy()
    z[2], z[3, 1] = np.nan, np.nan
    table = replace(seen, z=z, t=seen.t - seen.t[0]).timetable(DT)
    assert table.at_rest == 1
    assert 0 not in table.z
    assert 10 not in table.z
    assert np.isnan(table.z[15]).tolist() == [False, True, False]


def test_a_step_that_does_not_meet_the_times_is_refused_with_one_that_does() -> None:
    seen = case().measured(1, every=5)
    with pytest.raises(ComparisonError, match=r"0\.33 steps of 0\.003 s.*dt = 0\.0025 s"):
        seen.timetable(0.003)
    assert len(seen.timetable(0.0025).z) == 12
    irregular = replace(seen, t=np.sort(np.random.default_rng(0).uniform(0.01, 1, 12)))
    with pytest.raises(ComparisonError, match="no step matches all of them"):
        irregular.timetable(DT)


def test_two_measurements_in_a_step_are_refused() -> None:
    seen = case().measured(1)
    with pytest.raises(
        ComparisonError,
        match=r"60 measurements.*1 steps of 0\.01 s",
    ):
        replace(seen, t=0.01 + 1e-6 * np.arange(60)).timetable(0.01)


def test_jittered_looks_are_interpolated_and_their_error_counted() -> None:
    """A ramp is exact; of c t^2 the error is c (s - a)(b - s), by hand."""
    rng = np.random.default_rng(3)
    steps = 0.01 * np.arange(1, 101)
    t = 0.03 * np.arange(33) + rng.uniform(0.0, 0.004, 33)
    z = np.stack([2e-3 * t, 5e-3 * t**2, np.where(t < 0.5, t, np.nan)], axis=1)
    s, found, sd = on_steps(t, z, np.full(3, 1e-6), steps)
    assert np.allclose(s / 0.01, np.rint(s / 0.01))
    assert len(s) >= 30
    assert found[:, 0] == pytest.approx(2e-3 * s)
    off = found[:, 1] - 5e-3 * s**2
    assert np.abs(off).max() > 1e-7
    assert sd[0] == pytest.approx(1e-6, rel=1e-6)
    assert sd[1] == pytest.approx(np.sqrt(1e-12 + (off**2).mean()), rel=1e-6)
    assert np.isnan(found[s > 0.5, 2]).all()
    H = sparse.csr_array(sparse.eye_array(3))
    assert len(Measurements(s, H, found, sd, ("a", "b", "c")).timetable(0.01).z) >= 30


def test_a_jittering_camera_is_taken() -> None:
    points = np.array([[0.001, 0.002, 0.003]])
    x = points + 1e-4 * np.arange(12)[:, None, None] ** 2
    even = observed(("a",), points, x)
    (markers,) = even.of(MarkerObservation)
    late = markers.t + np.random.default_rng(2).uniform(0.0, 0.02, 12)
    jittered = replace(even, observations=(*even.drives, replace(markers, t=late)))
    found = Measurements.taken(jittered, case().system.scene.mesh)
    assert len(found.timetable(0.1).z) >= 10
    assert (found.sd > 2e-5).all()


def test_looks_that_a_smaller_step_meets_are_left_to_the_filters_advice() -> None:
    t = 0.025 * np.arange(1, 20)
    z, sd = np.ones((19, 1)), np.ones(1)
    assert on_steps(t, z, sd, 0.01 * np.arange(1, 60))[0] is t
    on_time = 0.03 * np.arange(1, 20)
    assert on_steps(on_time, z, sd, 0.01 * np.arange(1, 60))[0] is on_time


def observed(names: tuple[str, ...], points: np.ndarray, x: np.ndarray) -> Registered:  # type: ignore[type-arg]
    """Markers at `points` of the small cube, seen at `x` (nt, k, 3), without a registration."""
    mesh = case().system.scene.mesh
    t = 0.1 * np.arange(len(x))
    rows = Rows.barycentric(mesh, points)
    fit: Any = None
    tre = np.zeros(len(names))
    markers = MarkerObservation("seen", "validates", t, names, x, points, rows, 2e-5, tre, fit)
    return Registered((stage(t), markers))


def stage(t: np.ndarray) -> SignalObservation:  # type: ignore[type-arg]
    return SignalObservation("stage", "drives", t, np.zeros((len(t), 1)), "m", 1e-6)


def test_markers_become_measurements_of_displacements() -> None:
    """A linear field is read exactly; a marker that is not seen is missing in all components."""
    mesh = case().system.scene.mesh
    points = np.array([[0.001, 0.002, 0.003], [0.0035, 0.0005, 0.002]])
    A = np.array([[0.1, 0.2, 0.0], [0.0, 0.1, 0.3], [0.2, 0.0, 0.1]])
    x = np.array([points, points + points @ A, points + points @ A])
    x[2, 0] = np.nan
    found = Measurements.taken(observed(("a", "b"), points, x), mesh)
    assert found.names == ("a.x", "a.y", "a.z", "b.x", "b.y", "b.z")
    assert found.sd.tolist() == [2e-5] * 6
    assert found.z[1] == pytest.approx(found.H @ (mesh.nodes @ A).ravel(), abs=1e-15)
    assert np.isnan(found.z[2]).tolist() == [True] * 3 + [False] * 3
    with pytest.raises(ComparisonError, match="rows of 27 nodes on a mesh of 200"):
        Measurements.taken(observed(("a", "b"), points, x), cube(shape=PAPER).scene.mesh)
    with pytest.raises(ComparisonError, match="no markers"):
        Measurements.taken(Registered((stage(np.arange(3.0)),)), mesh)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"sd": np.zeros(3)}, "sd 0 m: it must be positive"),
        ({"names": ("a",)}, "1 names for 3 measured"),
        ({"t": np.ones(60)}, "times do not increase"),
        ({"z": np.zeros((3, 60))}, r"z \[m\]: shape \(3, 60\), expected \(60, 3\)"),
        ({"z": np.full((60, 3), np.inf)}, "not finite"),
    ],
)
def test_wrong_measurements_are_refused(change: dict, says: str) -> None:  # type: ignore[type-arg]
    with pytest.raises(ComparisonError, match=says):
        replace(case().measured(1), **change)


def test_an_innovation_by_hand() -> None:
    """y = (2, -, 3), S of the seen pair [[2, 1], [1, 2]]: y S^-1 y = (8 - 12 + 18) / 3."""
    S = np.array([[2.0, 9, 1], [9, 50, 9], [1, 9, 2]])
    gain = best_gain(np.eye(3), S, (True, False, True))
    found = innovation(np.array([3.0, np.nan, 4.0]), np.ones(3), gain)
    assert found.y.tolist() == [2, 0, 3]
    assert found.nis == pytest.approx(14 / 3)
    assert found.dof == 2
    assert found.sd == pytest.approx([np.sqrt(2), 0, np.sqrt(2)])


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda m: replace(m, t=m.t[:0], z=m.z[:0]), "0 times of 3 components: nothing measured"),
        (lambda m: replace(m, names=m.names[:2]), "2 names for 3 measured components"),
        (
            lambda m: replace(m, t=m.t[::-1].copy()),
            "measurement times do not increase; sort the rec",
        ),
        (lambda m: replace(m, sd=0 * m.sd), "measurement sd 0 m: it must be positive"),
        (lambda m: m.of("top", "knee"), "marker 'knee' was not measured; there are top"),
        (
            lambda m: m.moving(np.zeros(0, int)),
            "every measured component is held or driven, so there is noth",
        ),
    ],
)
def test_measurements_that_teach_a_filter_nothing_are_refused(call: Any, says: str) -> None:
    with pytest.raises(ComparisonError, match=says):
        call(case().measured(1, every=5))


def test_a_shape_of_a_load_that_moves_nothing_measured_cannot_be_estimated() -> None:
    system = cube()
    H = np.zeros((1, len(system.free)))
    with pytest.raises(SceneError, match="a load moves no measured component, so"):
        load_shapes(system, H)
    H[0, -1] = 2.0
    assert (H @ load_shapes(system, H)).tolist() == [[pytest.approx(1.0)]]


def test_one_shape_is_for_one_load() -> None:
    scene = cube().scene
    two = build(replace(scene, loads=(*scene.loads, replace(scene.loads[0], name="side"))))
    with pytest.raises(SceneError, match="2 loads: one shape needs exactly one"):
        LoadScale().prepare(two, case().measured(1, every=5))
