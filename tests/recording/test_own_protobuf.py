"""Our own messages in Protobuf: read back bit for bit, and refused as their JSON form is."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from validate.errors import RecordingError
from validate.recording.mcap.protobuf_messages import protobuf_message, protobuf_schema
from validate.recording.mcap.read import read_recording
from validate.recording.mcap.schemas import (
    CONTOUR,
    MARKERS,
    SIGNAL,
    Json,
    contour_message,
    markers_message,
    signal_message,
)
from validate.recording.mcap.write import WrittenChannel, WrittenMessage, write_channels
from validate.recording.preflight import Inspection
from validate.recording.types import Recording

POSE = {"pose/a": {"T_frame_from_image": " ".join(map(str, np.eye(4).ravel().tolist()))}}
FLOATS = st.floats(allow_nan=False, allow_infinity=False)


def written(path: Path, schema: str, *contents: Json) -> Path:
    channel = WrittenChannel("a", protobuf_schema(schema))
    messages = [
        WrittenMessage("a", 10 * i, protobuf_message(schema, content))
        for i, content in enumerate(contents)
    ]
    write_channels(path, [channel], messages, POSE if schema == CONTOUR else {})
    return path


def back(path: Path) -> Recording:
    assert Inspection.of(path).defects == ()
    return read_recording(path)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=20)
@given(arrays(np.float64, (3, 2), elements=FLOATS))
def test_a_signal_returns_bit_for_bit(tmp_path: Path, y: np.ndarray) -> None:
    contents = [signal_message(10 * i, "lab", "N", row, 0.5) for i, row in enumerate(y)]
    found = back(written(tmp_path / "s.mcap", SIGNAL, *contents)).signals["a"]
    assert np.array_equal(found.y, y)
    assert (found.unit, found.sd, found.frame) == ("N", 0.5, "lab")


@pytest.mark.parametrize("axes", [2, 3])
def test_markers_return_with_those_not_seen(tmp_path: Path, axes: int) -> None:
    x = np.arange(6.0 * axes).reshape(2, 3, axes) / 7
    x[1, 2] = np.nan
    contents = [markers_message(10 * i, "lab", "abc", at, 1e-4) for i, at in enumerate(x)]
    found = back(written(tmp_path / "m.mcap", MARKERS, *contents)).markers["a"]
    assert np.array_equal(found.x, x, equal_nan=True)
    assert found.names == ("a", "b", "c")


def test_an_outline_returns_with_its_pose(tmp_path: Path) -> None:
    outline = np.array([[0.0, 0.1], [0.3, 0.1], [0.2, 1 / 3]])
    found = back(written(tmp_path / "c.mcap", CONTOUR, contour_message(0, "lab", outline, 1e-4)))
    assert np.array_equal(found.contours["a"].outlines[0], outline)
    assert np.array_equal(found.contours["a"].pose, np.eye(4))


def test_a_number_that_is_none_is_refused(tmp_path: Path) -> None:
    content = signal_message(0, "lab", "N", np.array([np.nan]), 0.0)
    path = written(tmp_path / "s.mcap", SIGNAL, content)
    with pytest.raises(RecordingError, match="'a' message 0: field 'values' holds NaN"):
        read_recording(path)


def test_a_message_that_is_no_protobuf_is_refused(tmp_path: Path) -> None:
    channel = WrittenChannel("a", protobuf_schema(SIGNAL))
    write_channels(tmp_path / "s.mcap", [channel], [WrittenMessage("a", 0, b"\xff\xff")], {})
    with pytest.raises(RecordingError, match="'a' message 0: damaged"):
        read_recording(tmp_path / "s.mcap")
    assert any("damaged" in d for d in Inspection.of(tmp_path / "s.mcap").defects)
