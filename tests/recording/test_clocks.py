"""Clocks against hand-counted times."""

import numpy as np
import pytest

from validate.errors import RecordingError
from validate.recording.types import clock_of


def _ns(*ms: int) -> np.ndarray:
    return np.array(ms, dtype=np.int64) * 1_000_000


def test_a_regular_clock_has_only_a_rate() -> None:
    t = _ns(0, 10, 20, 30)
    clock = clock_of("/m", t, t, t)
    assert (clock.topic, clock.count, clock.duration) == ("/m", 4, 0.03)
    assert clock.rate_hz == pytest.approx(100.0, rel=1e-15)
    assert (clock.gaps, clock.longest_gap, clock.duplicates, clock.backward) == (0, 0.0, 0, 0)
    assert (clock.stamp_minus_publish, clock.publish_minus_log) == (0.0, 0.0)


def test_gaps_are_over_three_median_steps() -> None:
    t = _ns(0, 10, 20, 50, 60, 91, 101, 141)  # steps 10 10 30 10 31 10 40: 30 is not over 3 x 10
    clock = clock_of("/m", t, t, t)
    assert (clock.gaps, clock.longest_gap) == (2, 0.04)


def test_duplicates_and_steps_backward_are_counted_and_hide_no_gap() -> None:
    t = _ns(0, 0, 0, 0, 10, 10, 10, 20, 15, 25, 25, 65)
    clock = clock_of("/m", t, t, t)
    assert (clock.duplicates, clock.backward) == (6, 1)
    assert (clock.gaps, clock.longest_gap, clock.duration) == (1, 0.04, 0.065)


def test_stamp_publish_and_log_are_compared_pairwise() -> None:
    clock = clock_of("/m", _ns(0, 10, 20), _ns(1, 10, 18), _ns(1, 15, 18))
    assert (clock.stamp_minus_publish, clock.publish_minus_log) == (0.002, 0.005)
    assert clock.duration == 0.02


def test_without_stamps_publish_time_counts_not_log_time() -> None:
    clock = clock_of("/m", None, _ns(0, 10), _ns(5, 500))
    assert (clock.duration, clock.stamp_minus_publish) == (0.01, None)
    assert clock.publish_minus_log == 0.49


@pytest.mark.parametrize("t", [_ns(5), _ns(5, 5, 5)])
def test_no_time_passed_is_no_rate(t: np.ndarray) -> None:
    clock = clock_of("/m", t, t, t)
    assert (clock.rate_hz, clock.duration, clock.gaps) == (None, 0.0, 0)


def test_nanoseconds_since_1970_lose_nothing() -> None:
    t = np.array([1_700_000_000_000_000_001, 1_700_000_000_000_000_003], dtype=np.int64)
    assert clock_of("/m", t, t, t).duration == 2e-9


def test_nothing_to_measure_is_an_error() -> None:
    for stamps, publish in ((_ns(), _ns()), (_ns(1), _ns(1, 2))):
        with pytest.raises(RecordingError, match=r"'/m': .* stamps, publish and log times"):
            clock_of("/m", stamps, publish, publish)
