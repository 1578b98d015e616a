"""An uncertain clock enters u_D through the speed of what is measured: analytic ramps."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from validate.arrays import Floats, Ints
from validate.errors import ComparisonError, RegistrationError
from validate.fem.assembly.locate import nearest_node_rows
from validate.recording.clocks.alignment import Offset
from validate.recording.types import Recording, Signal, Source
from validate.register.clocks import clock_sd, interpolated, slopes
from validate.register.markers.markers import MarkerObservation, Together
from validate.register.observation import EVERYTHING, Selection
from validate.register.outlines.outlines import Corner, OutlineObservation
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.geometries.box import box
from validate.solve.types import Trace

T = np.linspace(0.0, 2.0, 21)
SD_T = 0.01  # s
HOLD = Selection("1s", np.array([1.0]))


@dataclass(frozen=True)
class Still:
    """A run in which nothing moves."""

    traces: dict[str, Trace]
    method: str = "run"
    t: Floats = field(default_factory=lambda: T)
    at: Ints = field(default_factory=lambda: np.arange(21))
    u: Floats = field(default_factory=lambda: np.zeros((21, 8, 3)))


STILL = Still({f"a.{c}": Trace(np.zeros(21), "m") for c in "xyz"} | {"f": Trace(0 * T, "N")})


def recorded(sd: float = SD_T) -> Recording:
    """A force that rises by 5 N/s and a stage, the force's clock moved by an uncertain offset."""
    force = Signal(T, 5 * T[:, None], "N", 0.1, "cell")
    stage = Signal(T, 1e-3 * T[:, None], "m", 0.0, "stage")
    plain = Recording("ramp", Source("x", "", 0, "x"), 0, signals={"force": force, "stage": stage})
    return Offset(0.0, sd, "correlation", 21, 1.0).shift(plain, "force")


def test_a_ramps_clock_is_worth_its_speed() -> None:
    """By hand: 0.01 s of 5 N/s is 0.05 N that all samples share."""
    seen = SignalObservation.validating(recorded(), "force", "N", quantity="force", trace="f")
    for selection in (HOLD, EVERYTHING):
        (found,) = seen.deviations(STILL, selection)
        assert found.systematic == pytest.approx(0.05)
    (exact,) = replace(seen, sd_t=0.0).deviations(STILL, HOLD)
    assert exact.systematic == 0.0


def test_the_drives_clock_counts_in_every_stream_and_once() -> None:
    moved = Offset(0.0, 0.04, "correlation", 21, 1.0).shift(recorded(0.03), "stage")
    seen = Registered(
        (
            SignalObservation.driving(moved, "stage", "m"),
            SignalObservation.validating(moved, "force", "N", quantity="q", trace="f"),
        )
    )
    again = replace(seen, outside=1)
    (found,) = again.compared[0].deviations(STILL, again.selections[0])
    assert found.systematic == pytest.approx(0.05 * 5)


def test_markers_are_worth_their_velocity_along_each_axis() -> None:
    """Two markers that rise at 3 and 4 mm/s, the second seen only at the start."""
    mesh = box((1.0, 1.0, 1.0), (1, 1, 1))
    rest = mesh.nodes[:2]
    x = rest + np.multiply.outer(T, 1e-3 * np.array([[0, 0, 3], [0, 0, 4]]))
    x[12:, 1] = np.nan
    none: object = None
    seen = MarkerObservation(
        "seen", "validates", T, ("a", "b"), x, rest, nearest_node_rows(mesh, rest), 1e-4,
        np.zeros(2), none, sd_t=SD_T,  # type: ignore[arg-type]
    )  # fmt: skip
    (one,) = seen.deviations(STILL, HOLD)
    assert one.systematic == pytest.approx(SD_T * 3e-3 / np.sqrt(3))
    up, across = Together("up", (2,), ""), Together("across", (0, 1), "")
    both = replace(seen, together=(up, across))
    vertical, inplane = both.deviations(STILL, HOLD)
    assert vertical.systematic == pytest.approx(SD_T * np.sqrt((9 + 16) / 2) * 1e-3)
    assert inplane.systematic == pytest.approx(0, abs=1e-15)


class Growing(OutlineObservation):
    """An outline whose section in the run is the one at rest."""

    def simulated(self, u: Floats) -> Floats:
        return self.outlines[0]


def test_outlines_are_worth_the_speed_of_every_quantity() -> None:
    """A circle of 10 mm that grows by 2 mm/s and moves by 1 mm/s along x."""
    angle = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    outlines = tuple((0.010 + 2e-3 * t) * circle + [1e-3 * t, 0] for t in T)
    wall: object = None
    seen = Growing(
        "outline", "validates", T, outlines, np.eye(4), 1e-4, wall, 0.0,  # type: ignore[arg-type]
        (Corner("right", 0.0, ""),), SD_T,
    )  # fmt: skip
    found = {d.quantity: d.systematic for d in seen.deviations(STILL, HOLD)}
    assert found["contour.area"] == pytest.approx(SD_T * 2 * np.pi * 0.012 * 2e-3, rel=1e-3)
    assert found["contour.centroid"] == pytest.approx(SD_T * 1e-3 / np.sqrt(2), rel=1e-3)
    assert found["right"] == pytest.approx(SD_T * 3e-3, rel=1e-3)
    assert found["contour"] == pytest.approx(SD_T * np.sqrt(4.5) * 1e-3, rel=5e-3)
    exact = replace(seen, sd_t=0.0).deviations(STILL, HOLD)
    assert {d.systematic for d in exact} == {0.0}


def test_noise_does_not_pass_for_speed() -> None:
    """Finely sampled: over the clock's own doubt the slope of a still signal is below its noise."""
    t = np.arange(2000) / 1000.0
    y = np.random.default_rng(1).normal(size=(2000, 1))
    assert 0.1 * np.abs(slopes(t, y, np.arange(0, 2000, 50), 0.1)).max() < 0.6


def test_a_speed_that_cannot_be_told_is_an_error() -> None:
    once = SignalObservation(
        "f", "validates", T[:1], np.ones((1, 1)), "N", 0.1, "force", "f", sd_t=SD_T
    )
    with pytest.raises(ComparisonError, match=r"uncertain by 0\.01 s, and too few"):
        once.deviations(STILL, Selection("0", np.array([0.0])))


def test_an_unreadable_doubt_is_refused() -> None:
    recording = recorded()
    spoilt = {**recording.metadata, "clock_offset/force": {"sd": "nan"}}
    with pytest.raises(RegistrationError, match="sd 'nan' is not a time >= 0 s"):
        clock_sd(replace(recording, metadata=spoilt), "force")
    assert clock_sd(recording, "stage") == 0.0


def test_a_slope_needs_two_samples_that_were_seen() -> None:
    t = np.array([0.0, 0.1, 0.2])
    y = np.column_stack([3.0 * t, [np.nan, 0.3, np.nan], np.full(3, np.nan), [0.0, np.nan, 0.6]])
    found = slopes(t, y, np.array([1]), 0.1)[0]
    assert found[[0, 3]] == pytest.approx([3.0, 3.0])
    assert np.isnan(found[1:3]).all()


@pytest.mark.parametrize("said", ["soon", "", "-0.5", "inf"])
def test_a_clock_whose_sd_is_no_time_is_refused(said: str) -> None:
    recording = recorded()
    spoilt = {**recording.metadata, "clock_offset/force": {"sd": said}}
    with pytest.raises(RegistrationError, match=rf"sd '{said}' is not a time >= 0 s"):
        clock_sd(replace(recording, metadata=spoilt), "force")


def test_two_samples_are_read_only_at_their_own_times() -> None:
    """Two samples show no second difference, so nothing says how straight the way between is."""
    t, z = np.array([1.0, 3.0]), np.array([[5.0, np.nan], [7.0, 8.0]])
    shown, squared = interpolated(t, z, np.array([3.0, 2.0, 1.0, 4.0]))
    np.testing.assert_array_equal(
        shown, [[7.0, 8.0], [np.nan, np.nan], [5.0, np.nan], [np.nan, np.nan]]
    )
    assert squared.tolist() == [0.0, 0.0]
