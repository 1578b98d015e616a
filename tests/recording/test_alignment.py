"""Clock offsets: exact truths, uncertainties over seeds, refusals with numbers, shifts shown."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap_samples import sample_recording

from validate.errors import RecordingError
from validate.recording.clocks import alignment
from validate.recording.clocks.alignment import (
    Offset,
    _only_peak,
    declared_offset,
    matched,
    rebased,
    refined_lag,
)
from validate.recording.clocks.events import event_time, offset_by_event
from validate.recording.mcap.read import read_recording
from validate.recording.mcap.write import write_recording
from validate.recording.preflight import Inspection
from validate.recording.types import Signal

# private: _on_grid: called alone, case by case.
# private: _only_peak: correlations of a known shape.

SEEDS = 60
SEARCH = 1.5  # s


def motion(t: np.ndarray) -> np.ndarray:
    hump = 0.6 * np.exp(-(((t - 5) / 0.5) ** 2)) - 0.4 * np.exp(-(((t - 7.1) / 0.8) ** 2))
    return np.tanh((t - 3) / 0.6) + hump


def signal(t: np.ndarray, y: np.ndarray, noise: float = 0.0, seed: int = 0) -> Signal:
    rng = np.random.default_rng(seed)
    return Signal(t, (y + rng.normal(0, noise, len(t)))[:, None], "N", noise, "machine")


def pair(
    rates: tuple[float, float], offset: float, noise: float, seed: int
) -> tuple[Signal, Signal]:
    """Reference and stream, which starts late, ends early and has a gap of 0.6 s."""
    ours, theirs = np.arange(0, 10, 1 / rates[0]), np.arange(0.3, 9.5, 1 / rates[1])
    theirs = theirs[(theirs < 4) | (theirs > 4.6)]
    one = signal(ours, motion(ours), noise, seed)
    return one, signal(theirs, 3 * motion(theirs + offset) - 2, 3 * noise, seed + 1000)


RATES = [(100.0, 100.0), (100.0, 37.0), (40.0, 133.0), (20.0, 25.0)]


@pytest.mark.parametrize("rates", RATES)
@pytest.mark.parametrize("offset", [-0.7313, 0.0, 0.1237, 0.8004])
def test_correlation_finds_the_truth_to_a_tenth_of_a_sample(
    rates: tuple[float, float], offset: float
) -> None:
    found = Offset.by_correlation(*pair(rates, offset, 0.0, 0), SEARCH)
    assert abs(found.seconds - offset) * max(rates) < 0.02  # without noise
    noisy = Offset.by_correlation(*pair(rates, offset, 0.002, 1), SEARCH)
    assert abs(noisy.seconds - offset) * max(rates) < 0.1
    assert noisy.method == "correlation"


@pytest.mark.parametrize("rates", RATES)
@pytest.mark.slow
def test_the_uncertainty_of_a_correlation_is_calibrated(rates: tuple[float, float]) -> None:
    truths = np.random.default_rng(3).uniform(-0.8, 0.8, 3 * SEEDS)
    found = [
        Offset.by_correlation(*pair(rates, truth, 0.02, seed), SEARCH)
        for seed, truth in enumerate(truths)
    ]
    z = np.array([(f.seconds - t) / f.sd for f, t in zip(found, truths, strict=True)])
    assert 0.85 < np.sqrt(np.mean(z**2)) < 1.25  # chi-square of 180 alone: 0.90..1.10 at 95 %
    assert abs(np.mean(z)) < 0.3


def test_matched_samples_are_counted_without_gaps_and_ends() -> None:
    t = np.arange(0, 10, 0.01)
    gap = t[(t < 2) | (t > 3)]
    reference, stream = signal(gap, motion(gap)), signal(t, motion(t))
    found = matched(reference, stream, Offset(0.5, 0.0, "test", 0, 0.0))
    missing = 50 + 101  # beyond the end; in the gap, 1.5 .. 2.5 s of the stream
    assert abs(found.count - (1000 - missing)) <= 2
    assert found.coverage == pytest.approx(found.count / 1000)


@pytest.mark.parametrize("offset", [20.0, 6.0])
def test_too_small_an_overlap_is_refused_with_its_share(offset: float) -> None:
    reference, stream = pair((100.0, 100.0), 0.0, 0.0, 0)
    with pytest.raises(RecordingError, match=r"of 860 samples \(\d+ %\) .* 50 %"):
        matched(reference, stream, Offset(offset, 0.0, "test", 0, 0.0))
    late = replace(stream, t=stream.t + offset)
    with pytest.raises(RecordingError, match=r"overlap by .* % at most; at least 50 %"):
        Offset.by_correlation(reference, late, 1.0)


T = np.arange(0, 10, 0.01)
AMBIGUOUS = {
    "sine": (np.sin(2 * np.pi * T), "ambiguous: .*periodic"),
    "ramp": (T, "ambiguous: .*edge of the search"),
    "flat": (0 * T, "flat, its standard deviation 0 N"),
}


@pytest.mark.parametrize("noise", [0.0, 0.05])
@pytest.mark.parametrize("name", AMBIGUOUS)
def test_ambiguous_signals_are_refused(name: str, noise: float) -> None:
    y, says = AMBIGUOUS[name]
    says = says.replace(" 0 N", "") if noise else says
    with pytest.raises(RecordingError, match=says):
        Offset.by_correlation(signal(T, y, noise, 1), signal(T - 0.123, y, noise, 2), 2.5)


def test_the_other_lag_of_an_ambiguous_pair_is_named() -> None:
    """A sine of one second: the rival lies a whole number of periods from the best."""
    y = AMBIGUOUS["sine"][0]
    with pytest.raises(RecordingError, match="ambiguous") as told:
        Offset.by_correlation(signal(T, y, 0.05, 1), signal(T - 0.123, y, 0.05, 2), 2.5)
    best, other = (float(x) for x in re.findall(r" at ([-+][\d.]+) s", str(told.value)))
    periods = abs(best - other)
    assert round(periods) >= 1
    assert periods == pytest.approx(round(periods), abs=0.05)


def test_unrelated_signals_and_offsets_beyond_the_search_are_refused() -> None:
    bumps = [np.exp(-(((T - c) / 0.2) ** 2)) for c in (2.0, 3.0, 7.0)]
    one, other = signal(T, bumps[0] - 2 * bumps[1]), signal(T, motion(T) - bumps[2], 0.5, 4)
    with pytest.raises(RecordingError, match=r"correlate by|ambiguous"):
        Offset.by_correlation(one, other, 1.0)
    with pytest.raises(RecordingError, match="edge of the search"):
        Offset.by_correlation(*pair((100.0, 100.0), 0.8, 0.0, 0), 0.5)
    with pytest.raises(RecordingError, match="expected a range above 0"):
        Offset.by_correlation(*pair((100.0, 100.0), 0.8, 0.0, 0), 0.0)


def event(kind: str, t: np.ndarray) -> np.ndarray:
    return 5 * np.maximum(0, t - 3) if kind == "onset" else np.tanh((t - 5) / 0.08)


@pytest.mark.parametrize("kind", [pytest.param("onset", marks=pytest.mark.slow), "step"])
def test_a_marked_event_to_a_tenth_of_a_sample_with_its_uncertainty(kind: str) -> None:
    errors, sds = [], []
    for seed, truth in enumerate(np.random.default_rng(5).uniform(-0.8, 0.8, SEEDS)):
        t = np.arange(0, 10, 0.013)
        one = signal(T, event(kind, T), 0.005, seed)
        found = offset_by_event(one, signal(t, event(kind, t + truth), 0.005, seed + 500), kind)
        errors.append(found.seconds - truth)
        sds.append(found.sd)
    assert np.sqrt(np.mean(np.square(errors))) < 0.1 * 0.013
    assert 0.6 < np.sqrt(np.mean(np.square(np.array(errors) / sds))) < 1.3


def test_events_that_are_none_or_several_are_refused() -> None:
    with pytest.raises(RecordingError, match="no event: the signal changes by"):
        event_time(signal(T, 0 * T, 0.1), "onset")
    with pytest.raises(RecordingError, match=r"3 crossings .* single step"):
        event_time(signal(T, np.where((T > 3) & (T < 4), 1.0, 0.0) + (T > 6)), "step")
    with pytest.raises(RecordingError, match="at the edge"):
        event_time(signal(T, T), "onset")
    blip = np.where((T > 3) & (T < 4), 1.0, 0.0) + (T > 6)
    found, sd = event_time(signal(T, blip), "step", (5.0, 8.0))
    assert abs(found - 6.005) <= 0.0051
    assert sd == pytest.approx(0.01 / np.sqrt(12))


def test_a_shift_is_kept_shown_and_not_made_twice(tmp_path: Path) -> None:
    recording = sample_recording()
    offset = Offset(-0.0025, 1e-4, "correlation", 7, 1.0)
    moved = offset.shift(recording, "/force")
    path = tmp_path / "moved.mcap"
    write_recording(moved, path)
    read = read_recording(path)
    assert read.t0_ns == recording.t0_ns - 2_500_000  # /force begins first now
    assert np.allclose(read.signals["/force"].t, recording.signals["/force"].t, atol=2e-9)
    assert np.allclose(read.markers["/markers"].t, recording.markers["/markers"].t + 0.0025)
    assert read.record("clock_offset//force") == {
        "seconds": "-0.0025", "sd": "0.0001", "method": "correlation", "count": "7",
        "coverage": "1.0",
    }  # fmt: skip
    (line,) = Inspection.of(path).clock_offsets
    assert "/force" in line
    assert "seconds -0.0025" in line
    with pytest.raises(RecordingError, match=r"shifted by -0\.0025 s before"):
        offset.shift(moved, "/force")
    with pytest.raises(RecordingError, match="no stream 'force' to shift"):
        offset.shift(recording, "force")


def test_a_clock_without_date_never_runs_below_zero() -> None:
    recording = replace(sample_recording(), t0_ns=0)
    moved = Offset(-2.0, 0.1, "given by the user", 0, 0.0).shift(recording, "/force")
    assert moved.t0_ns == 0
    assert moved.signals["/force"].t[0] == 0
    assert moved.markers["/markers"].t[0] == pytest.approx(2.0)
    assert rebased(moved).t0_ns == 0


def test_a_share_that_is_just_met_is_enough() -> None:
    t = 0.1 * np.arange(10)
    reference, stream = signal(t, t), signal(t + 0.5, t)
    at = Offset(0.0, 0.001, "declared", 0, 0.0)
    assert matched(reference, stream, at, min_coverage=0.5).count == 5
    with pytest.raises(RecordingError, match=r"5 of 10 samples \(50 %\).*at least 51 %"):
        matched(reference, stream, at, min_coverage=0.51)


def test_a_declared_offset_is_counted_too() -> None:
    recording = sample_recording()
    found = declared_offset(recording, "/outline", 0.01, 0.001)
    assert (found.count, found.coverage) == (2, 1.0)
    with pytest.raises(RecordingError, match=r"0 of 2 samples \(0 %\)"):
        declared_offset(recording, "/outline", 5.0, 0.001)
    with pytest.raises(RecordingError, match="no other stream"):
        declared_offset(recording, "/nothing", 0.0, 0.0)


LAGS = np.array([-0.3, -0.2, -0.1, 0.0, 0.1, 0.2, 0.3])


@pytest.mark.parametrize(
    ("correlation", "expected"),
    [
        ([0, 0.9, 0, 0, 0, 0.78, 0], -0.2),  # 1 - 0.78^2 = 0.392 is above 2 (1 - 0.9^2) = 0.38
        ([0, 0.9, 0, 0, 0, -0.9, 0], -0.2),  # the opposite of a motion is no rival
        ([0, 0, 0.85, 0.9, 0.85, 0, 0], 0.0),  # one peak of three lags
        ([0, 0.9, 0, 0, 0, 0.79, 0], "0.900 at -0.2 s and 0.790 at +0.2 s, as in periodic"),
        ([0, 0.79, 0, 0, 0.89, 0.9, 0], "0.900 at +0.2 s and 0.790 at -0.2 s, as in periodic"),
        ([0, 0.8, 0.85, 0, 0.9, 0, 0], "0.900 at +0.1 s and 0.850 at -0.1 s, as in periodic"),
        ([0.79, 0, 0, 0.9, 0, 0, 0], "0.900 at +0 s reaches the edge"),
        (
            [0, 0, 0, 0.9, 0, 0, 0.79],
            r"\(-0.3..\+0.3 s\), as for ramps or for an offset beyond 0.3 s",
        ),
        ([0, 0.49, 0, 0, 0, 0, 0], "correlate by 0.49 at most .at -0.2 s.; at least 0.5"),
    ],
)
def test_a_lag_is_ambiguous_where_another_leaves_less_than_twice_unexplained(
    correlation: list[float], expected: float | str
) -> None:
    """The unexplained share of a lag is 1 - r^2; rivals lie below twice that of the best."""
    values = np.array(correlation, dtype=float)
    if isinstance(expected, float):
        assert _only_peak(LAGS, values, 0.3, 0.5) == expected
        return
    expected = expected if expected.startswith(r"\(") else expected.replace("+", r"\+")
    with pytest.raises(RecordingError, match=expected):
        _only_peak(LAGS, values, 0.3, 0.5)


def test_what_cannot_be_aligned_is_reported_with_its_numbers() -> None:
    wide = Signal(T, np.column_stack([T, T]), "N", 0.0, "machine")
    one = signal(T, motion(T))
    for stream in (wide, signal(T[:7], motion(T[:7]))):
        with pytest.raises(RecordingError, match=r"stream: (2 columns|7 samples)"):
            Offset.by_correlation(one, stream, 1.0)
    with pytest.raises(RecordingError, match=r"needs 1 column.*2"):
        event_time(wide, "onset")
    with pytest.raises(RecordingError, match=r"between 3 and 3.02 s; "):
        event_time(one, "onset", (3.0, 3.02))
    with pytest.raises(RecordingError, match="samples lie within the reference; 10"):
        refined_lag(one, one, 9.95)


def test_a_grid_of_too_many_samples_is_refused() -> None:
    long = Signal(np.array([0.0, 1.0, 2e4]), np.zeros((3, 1)), "N", 0.0, "machine")
    with pytest.raises(RecordingError, match=r"20000001 samples of 0.001 s.*2097152"):
        alignment._on_grid(long, 1e-3)


def test_streams_that_do_not_follow_each_other_have_no_best_offset() -> None:
    """The opposite of a motion: the slope of its correlation has the wrong sign."""
    with pytest.raises(RecordingError, match=r"no best offset near .0 s: the streams"):
        refined_lag(signal(T, motion(T)), signal(T, -motion(T)), 0.0)
