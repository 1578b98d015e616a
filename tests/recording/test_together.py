"""Clocks of several files of one test: the drift between two of them, and what it changes."""

import numpy as np
import pytest

from validate.errors import RecordingError
from validate.recording import merge as module
from validate.recording.clocks.alignment import Offset
from validate.recording.merge import ClockDrift, drift_of, stretched, stretched_signal, with_drift
from validate.recording.types import Recording, Signal

# private: _TURNS: a limit or list of the code, which the test must meet exactly.
# private: _left: replaced, to bring a case about.

T = np.arange(0, 20, 0.01)
NO_OFFSET = Offset(0.0, 0.001, "correlation", len(T), 1.0)


def motion(t: np.ndarray) -> np.ndarray:
    return np.asarray(sum(np.exp(-(((t - c) / 0.6) ** 2)) for c in (2.0, 5.0, 9.0, 13.0, 18.0)))


def signal(t: np.ndarray, y: np.ndarray) -> Signal:
    noise = np.random.default_rng(3).normal(0, 1e-4, len(t))
    return Signal(t, (y + noise)[:, None], "N", 1e-4, "")


@pytest.mark.parametrize("rate", [2e-4, -2e-4])
def test_a_drift_has_the_sign_of_what_must_be_added(rate: float) -> None:
    """Stamps of a clock that is right in the middle and must be stretched by `rate`."""
    middle = (T[0] + T[-1]) / 2
    stamps = middle + (T - middle) / (1 + rate)
    stream = signal(stamps, motion(T))
    drift = drift_of(signal(T, motion(T)), stream, NO_OFFSET)
    assert drift.rate == pytest.approx(rate, abs=4 * drift.sd)
    assert drift.seen
    assert drift.apart == pytest.approx(abs(drift.rate) * np.ptp(stamps), rel=1e-12)
    right = stretched_signal(stream, ClockDrift(rate, 0.0, middle, 20.0))
    assert right.t == pytest.approx(T, abs=1e-12)


@pytest.mark.parametrize("rate", [1e-3, -1e-3])
def test_a_recording_is_stretched_about_the_middle(rate: float) -> None:
    found = Recording("r", "measured", 0, signals={"f": signal(T, T)})
    moved = stretched(found, ClockDrift(rate, 0.0, 10.0, 20.0)).signals["f"]
    assert moved.t[[0, 1000]] == pytest.approx([-10 * rate, 10.0], abs=1e-12)
    assert moved.t[-1] == pytest.approx(T[-1] + rate * (T[-1] - 10), abs=1e-12)


@pytest.mark.parametrize(
    ("rate", "sd", "expected"), [(-4e-3, 1e-3, 0.05), (4e-3, 1e-3, 0.05), (2.9e-3, 1e-3, 0.03)]
)
def test_a_drift_that_stays_adds_a_ramp_of_its_height(
    rate: float, sd: float, expected: float
) -> None:
    """0.04 s over root 12 in the square, and 0.03 s; a drift below three sd adds nothing."""
    offset = Offset(1.0, 0.03, "correlation", 5, 1.0)
    drift = ClockDrift(rate, sd, 5.0, 10.0 * np.sqrt(12))
    assert with_drift(offset, drift).sd == pytest.approx(expected, rel=1e-12)
    assert with_drift(offset, None) == offset


def test_a_drift_that_does_not_settle_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_left", lambda *_: (1.0, 1.0))
    with pytest.raises(
        RecordingError, match=f"the drift does not converge within {module._TURNS} it"
    ):
        drift_of(signal(T, motion(T)), signal(T, motion(T)), NO_OFFSET)


def test_a_topic_of_two_files_is_refused() -> None:
    one = Recording("r", "measured", 0, signals={"f": signal(T, T)})  # type: ignore[arg-type]
    module.require_other_topics([one])
    with pytest.raises(RecordingError, match=r"more than one file has \['f'\]: import"):
        module.require_other_topics([one, one])
