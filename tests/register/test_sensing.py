"""A sensor's gain, bias and delay, and a camera's pose: what was there, from what was read."""

from dataclasses import replace

import numpy as np
import pytest

from validate.errors import UsageError
from validate.parameters import with_values
from validate.recording.types import Markers
from validate.register.markers.markers import MarkerObservation
from validate.register.sensing import ForceSensing, PoseShift, Sensing
from validate.register.signals import SignalObservation
from validate.scene.geometries.box import box

T = np.linspace(0.0, 1.0, 11)


def cell(y: np.ndarray) -> SignalObservation:
    return SignalObservation("cell", "validates", T, y[:, None], "N", 0.2, "force", "stage.force")


def test_what_a_sensor_read_becomes_what_was_there() -> None:
    true = 3.0 * T
    read = 1.25 * true + 0.5
    found = ForceSensing(gain=1.25, bias=0.5).of(cell(read))
    assert found.y[:, 0] == pytest.approx(true, abs=1e-14)
    assert found.sd == pytest.approx(0.16)


def test_a_delay_is_taken_out_and_as_many_samples_stay() -> None:
    """A ramp read .05 s late is .15 N low; the last sample has none after it to look at."""
    found = Sensing(delay=0.05).of(cell(3.0 * (T - 0.05)))
    assert found.y[:-1, 0] == pytest.approx(3.0 * T[:-1], abs=1e-14)
    assert len(found.y) == len(T)


def test_defaults_change_nothing() -> None:
    seen = cell(np.sin(T))
    assert np.array_equal(ForceSensing().of(seen).y, seen.y)
    markers = tracked()
    assert PoseShift().of(markers) is markers


def test_a_sensor_that_reads_nothing_is_refused() -> None:
    for gain in (0.0, -1.0, float("nan")):
        with pytest.raises(UsageError, match="of a sensor: expected above 0"):
            Sensing(gain=gain)


def test_units_are_those_of_the_sensor() -> None:
    assert with_values(ForceSensing(), {"bias": "20mN", "delay": "3ms"}) == ForceSensing(
        delay=0.003, bias=0.02
    )
    assert with_values(PoseShift(), {"turn_z": "90deg"}).turn_z == pytest.approx(np.pi / 2)
    with pytest.raises(UsageError, match="expected N"):
        with_values(ForceSensing(), {"bias": "3mm"})


def tracked() -> MarkerObservation:
    names, side = ("a", "b", "c", "d"), 0.01
    rest = side * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    x = np.stack([rest, rest + [0.0, 0.0, 1e-3]])
    markers = Markers(np.array([0.0, 1.0]), names, x, 1e-5, "model")
    layout = dict(zip(names, rest, strict=True))
    return MarkerObservation.of(markers, layout, box((side,) * 3, (1, 1, 1)))


def test_a_pose_turns_displacements_and_shifts_positions() -> None:
    seen = tracked()
    turned = PoseShift(turn_x=np.pi / 2).of(seen)
    assert turned.x[1] - turned.x[0] == pytest.approx(np.tile([0.0, -1e-3, 0.0], (4, 1)))
    assert turned.x[0].mean(axis=0) == pytest.approx(seen.x[0].mean(axis=0))
    shifted = PoseShift(y=2e-3).of(seen)
    assert shifted.x - seen.x == pytest.approx(np.broadcast_to([0, 2e-3, 0], seen.x.shape))


def test_markers_are_read_between_samples_and_never_invented() -> None:
    seen = tracked()
    late = PoseShift(delay=0.5).of(seen)
    assert late.x[0] - seen.x[0] == pytest.approx(np.tile([0, 0, 0.5e-3], (4, 1)))


def test_markers_in_a_plane_have_no_pose() -> None:
    seen = tracked()
    flat = replace(seen, x=seen.x[..., :2], positions=seen.positions)
    with pytest.raises(UsageError, match="2 dimensions: a pose"):
        PoseShift(x=1e-3).of(flat)
    assert PoseShift().of(flat) is flat
