"""What a recording's motion is: frequency, direction, start, rest, gaps, class of method."""

import re

import numpy as np
import pytest

from validate.arrays import Floats
from validate.errors import ComparisonError
from validate.identify.recorded_motion import RecordedMotion, recorded_motion
from validate.pipeline.run.case_solution import between
from validate.recording.types import Contours, Recording, Signal, Source
from validate.report.sections.motion_words import motion_lines, motion_words

T = np.arange(401) / 200.0
ALONG = np.array([0.6, 0.0, 0.8])


def shown(y: Floats, t: Floats = T, sd: float = 1e-5) -> RecordedMotion:
    """Of a marker that moves by y along ALONG, and one that moves by a tenth of it."""
    noise = np.random.default_rng(4).normal(0, sd, (2, len(t), 3))
    x = y[:, None] * ALONG
    return recorded_motion(t, {"far": x + noise[0], "near": 0.1 * x + noise[1]}, sd)


def released(start: float, f: float = 2.8, damping: float = 0.03) -> Floats:
    """5 mm on the way to rest, let go at `start` s."""
    w, tau = 2 * np.pi * f, T - start
    d, wd = damping * w, w * np.sqrt(1 - damping**2)
    y = 1 - np.exp(-d * tau) * (np.cos(wd * tau) + d / wd * np.sin(wd * tau))
    return 5e-3 * np.where(tau < 0, 0.0, y)


def test_a_swing_is_found_with_its_start_and_its_mode() -> None:
    found = shown(released(0.25))
    assert (found.marker, found.axis) == ("far", "z")
    np.testing.assert_allclose(found.direction, ALONG, atol=0.01)
    assert found.starts == pytest.approx(0.25, abs=2e-3)
    assert found.frequency == pytest.approx(2.8, abs=found.resolution)
    assert found.ringing is not None
    assert found.ringing.damping == pytest.approx(0.03, rel=0.05)
    assert found.rate == pytest.approx(200)
    assert found.rests_from is None
    assert "2.8" in motion_words(found)


@pytest.mark.parametrize(("first", "matters"), [(2.8, True), (8.0, True), (30.0, False)])
def test_inertia_matters_from_a_third_of_the_first_mode(first: float, matters: bool) -> None:
    assert shown(released(0.25)).inertia_matters(first) is matters


def test_a_slow_ramp_that_stops_is_statics() -> None:
    ramp = 5e-3 * np.clip((T - 0.3) / 1.0, 0, 1)
    found = shown(ramp)
    assert not found.inertia_matters(15.0)
    assert not found.inertia_matters(None)
    assert found.rests_from == pytest.approx(1.3, abs=0.02)
    assert found.drift == pytest.approx(5e-3, abs=1e-4)


def test_outlines_and_signals_move_too() -> None:
    """A square that goes up by 2 mm, and a force that rises by 3 N; what stands still has no
    line."""
    y = np.clip((T - 0.5) / 1.0, 0, 1)
    corners = np.array([[0.0, 0.0], [0.01, 0.0], [0.01, 0.01], [0.0, 0.01]])
    outlines = tuple(corners + (0.0, 2e-3 * up) for up in y)
    source = Source("x", "", 0, "x")
    held = Signal(T, np.ones((len(T), 1)), "Pa", 0.0, "s")
    found = Recording("r", source, 0, contours={"film": Contours(T, outlines, 0.0, np.eye(4), "b")},
                      signals={"pull": Signal(T, 3 * y[:, None], "N", 0.0, "s"), "held": held},
                      )  # fmt: skip
    lines = motion_lines(found)
    assert len(lines) == 2
    assert "2.00 mm peak to peak along (" in lines[0]
    assert "motion of pull: 'pull' changes most, 3.00 N peak to peak, changing steadily" in lines[1]
    for line in lines:
        assert re.search(r"at rest until 0.5\d* s, at rest from 1.[45]\d* s to the end", line), line


def test_gaps_and_missing_samples_are_counted() -> None:
    t = np.delete(T, slice(100, 120))
    y = np.delete(released(0.25), slice(100, 120))
    y[50:60] = np.nan
    found = shown(y, t)
    assert (found.gaps, found.gap) == (2, pytest.approx(0.105))
    assert found.missing == pytest.approx(10 / len(t))


def test_noise_alone_is_no_inertia_and_stillness_no_motion() -> None:
    assert not shown(np.zeros_like(T)).inertia_matters(1.0)
    with pytest.raises(ComparisonError, match="the recording has no motion"):
        recorded_motion(T, {"a": np.zeros((len(T), 3))})


def test_few_samples_have_no_spectrum() -> None:
    found = recorded_motion(np.arange(4.0), {"a": np.arange(4.0)[:, None] * ALONG}, 1e-5)
    assert (found.frequency, found.above(0.1)) == (0.0, 0.0)


def test_loads_that_act_at_once_do_not_rise_in_shorter_steps() -> None:
    t, inputs = np.array([0.1, 0.2]), np.array([[4.0], [4.0]])
    at, rising = between(t, inputs, 2)
    _, sudden = between(t, inputs, 2, sudden=True)
    np.testing.assert_allclose(at, [0.05, 0.1, 0.15, 0.2])
    assert rising[:, 0].tolist() == [2.0, 4.0, 4.0, 4.0]
    assert sudden[:, 0].tolist() == [4.0, 4.0, 4.0, 4.0]


@pytest.mark.parametrize(("rate", "noise"), [(20.0, 1e-5), (400.0, 1e-5)])
def test_a_coarse_film_keeps_its_declared_noise(rate: float, noise: float) -> None:
    """Seven samples a period: differences of neighbours are the motion, not its noise."""
    t = np.arange(0, 3, 1 / rate)
    moved = {"tip": 5e-3 * np.sin(2 * np.pi * 2.8 * t)[:, None]}
    found = recorded_motion(t, moved, noise)
    assert found.noise == pytest.approx(noise, rel=0.01)
    if rate < 28:
        assert recorded_motion(t, moved).noise > 10 * noise
