"""Files by other programs: what is read, which time counts, and what is refused by name."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import CompressionType, IndexType
from mcap_samples import T0, markers_json, sample_recording, signal_json, write_foreign

from validate.errors import RecordingError
from validate.recording.mcap.read import read_recording
from validate.recording.mcap.write import write_recording
from validate.recording.preflight import Inspection

M, S, C = "validate.Markers", "validate.Signal", "validate.Contour"
STEP = 10_000_000  # ns


def _markers(count: int = 3) -> list[tuple[str, str, int, Any]]:
    return [("/m", M, T0 + i * STEP, markers_json(T0 + i * STEP)) for i in range(count)]


def _signal(count: int = 3, **changes: Any) -> list[tuple[str, str, int, Any]]:
    return [("/s", S, T0 + i * STEP, signal_json(T0 + i * STEP, **changes)) for i in range(count)]


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"enable_data_crcs": True},
        {"compression": CompressionType.LZ4},
        {"compression": CompressionType.NONE},
        {"use_chunking": False},
        {"repeat_schemas": False, "repeat_channels": False},  # KeyError in the seeking reader
        {"index_types": IndexType.NONE},
        {
            "repeat_schemas": False,
            "repeat_channels": False,
            "index_types": IndexType.NONE,
            "use_statistics": False,
            "use_summary_offsets": False,
        },
    ],
    ids=["default", "data crc", "lz4", "plain", "unchunked", "not repeated", "no index", "none"],
)
def test_every_layout_of_a_file_is_read(tmp_path: Path, options: dict[str, Any]) -> None:
    got = read_recording(write_foreign(tmp_path / "f.mcap", _markers() + _signal(), **options))
    markers = got.markers["/m"]
    assert got.name == "f"
    assert got.t0_ns == T0
    assert markers.t.tolist() == [0.0, 0.01, 0.02]
    assert np.array_equal(markers.x[1], [[0, 2.5, 4], [1, 3, np.nan]], equal_nan=True)
    assert got.signals["/s"].y.tolist() == [[1.5]] * 3
    crc = options.get("enable_data_crcs", False)
    assert got.source.integrity == ("verified" if crc else "integrity not provable: no data CRC")


def test_time_is_the_stamp_never_publish_or_log(tmp_path: Path) -> None:
    messages = [("/m", M, T0 + 5 * STEP * i, markers_json(T0 + STEP * i)) for i in range(3)]
    got = read_recording(write_foreign(tmp_path / "f.mcap", messages, publish={1: T0 + 7 * STEP}))
    assert got.markers["/m"].t.tolist() == [0.0, 0.01, 0.02]
    assert got.clock["/m"].stamp_minus_publish == pytest.approx(0.08)
    assert got.clock["/m"].publish_minus_log == pytest.approx(0.02)


def test_without_stamps_publish_time_counts(tmp_path: Path) -> None:
    messages = [("/m", M, T0 + 5 * STEP * i, markers_json(None)) for i in range(2)]
    publish = {0: T0 - STEP, 1: T0 + STEP}
    got = read_recording(write_foreign(tmp_path / "f.mcap", messages, publish=publish))
    assert got.t0_ns == T0 - STEP
    assert got.markers["/m"].t.tolist() == [0.0, 0.02]
    assert got.clock["/m"].stamp_minus_publish is None


def test_names_in_another_order_are_sorted_by_name(tmp_path: Path) -> None:
    swapped = markers_json(T0 + STEP, names=["b", "a"], x=[1, 0], y=[3, 2.5], z=[None, 4])
    messages = [*_markers(1), ("/m", M, T0 + STEP, swapped)]
    x = read_recording(write_foreign(tmp_path / "f.mcap", messages)).markers["/m"].x
    assert np.array_equal(x[0], x[1], equal_nan=True)


def test_topics_of_others_and_mirrors_are_left_alone(tmp_path: Path) -> None:
    messages = [*_markers(2), ("/camera", "foxglove.CompressedImage", T0, b"\x00\xff")]
    got = read_recording(write_foreign(tmp_path / "f.mcap", messages))
    assert (list(got.markers), list(got.clock)) == (["/m"], ["/m"])


def test_metadata_of_one_name_are_numbered(tmp_path: Path) -> None:
    from mcap.writer import Writer

    path = tmp_path / "f.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        for value in "xyz":
            writer.add_metadata("cal", {"k": value})
        schema = writer.register_schema(S, "jsonschema", b"{}")
        channel = writer.register_channel("/s", "json", schema)
        message = b'{"frame":"w","unit":"N","values":[1],"sd":0}'
        writer.add_message(channel, log_time=1, publish_time=1, data=message)
        writer.finish()
    records = read_recording(path).metadata
    assert {n: r["k"] for n, r in records.items()} == {"cal": "x", "cal#2": "y", "cal#3": "z"}


def _at(i: int, **changes: Any) -> list[tuple[str, str, int, Any]]:
    """Three marker messages, the one at i changed."""
    messages = _markers()
    topic, schema, ns, message = messages[i]
    messages[i] = (topic, schema, ns, {**message, **changes})
    return messages


def _raw(data: bytes) -> list[tuple[str, str, int, Any]]:
    return [("/m", M, T0, data)]


def _stamp(ns: int) -> dict[str, int]:
    return {"sec": ns // 10**9, "nsec": ns % 10**9}


def _without(name: str) -> list[tuple[str, str, int, Any]]:
    message = markers_json(T0)
    del message[name]
    return [("/m", M, T0, message)]


CONTOUR = {"stamp": _stamp(T0), "frame": "w", "x": [0, 1, 1], "y": [0, 0, 1], "sd": 0}


@pytest.mark.parametrize(
    ("messages", "message"),
    [
        (
            _at(2, stamp=_stamp(T0 + STEP // 2)),
            r"time runs backward at sample 2 \(0\.010000000 s -> 0\.005000000 s\), 1 times",
        ),
        (_without("sd"), r"'/m' message 0: field 'sd' is missing; found \['frame', 'names'"),
        (_without("names"), "field 'names' is missing"),
        (_at(1, x=[0]), r"'/m' message 1: lengths of x, y, z differ: \[1, 2, 2\]"),
        (_at(1, names=["a"]), "1 names for 2 points"),
        (_at(1, names=["a", "c"]), r"names change at message 1, not in both: \['b', 'c'\]"),
        (_at(1, names=["a", "a"]), "names change at message 1"),
        (
            _at(1, names=["a"], x=[0], y=[0], z=[0]),
            r"names change at message 1, not in both: \['b'\]",
        ),
        (_at(0, names=["a", 7]), "'names' is not a list of texts"),
        (_at(0, x="00"), "field 'x' is str, expected a list"),
        (_at(0, x=[0, "1"]), "field 'x' holds str, expected numbers"),
        (_at(0, y=[0, True]), "field 'y' holds bool, expected numbers"),
        (_at(0, sd=None), "field 'sd' holds NoneType"),
        ([("/m", M, T0, markers_json(T0, sd=-1))], "standard deviation -1.0"),
        (_at(1, sd=0.5), "sd changes at message 1, 0.001 -> 0.5"),
        (_at(1, frame="plate"), "frame changes at message 1, 'world' -> 'plate'"),
        (_at(0, frame=3), "field 'frame' is int, expected text"),
        (_at(1, z=None), r"message 1 holds \(2, 2\) numbers, the first \(2, 3\)"),
        (_at(0, x=[0, 10**400]), "field 'x' holds a number beyond float64"),
        (_at(0, stamp={"sec": 1}), "stamp sec 1, nsec None: not int64 nanoseconds"),
        (_at(0, stamp={"sec": 1, "nsec": 10**9}), "not int64 nanoseconds"),
        (_at(0, stamp={"sec": 10**10, "nsec": 0}), "not int64 nanoseconds"),
        (_at(0, stamp={"sec": 1.0, "nsec": 0}), "not int64 nanoseconds"),
        (_at(0, stamp=5), "not int64 nanoseconds"),
        ([*_markers(2), ("/m", M, T0, markers_json(None))], "2 of 3 messages have a stamp"),
        (_signal(1) + [("/s", S, T0 + 1, signal_json(T0 + 1, unit="mN"))], "unit changes at mess"),
        (
            _signal(1) + [("/s", S, T0 + 1, signal_json(T0 + 1, values=[1, 2]))],
            r"message 1 holds \(2,\) numbers, the first \(1,\)",
        ),
        (_signal(1, unit=""), "signal: no unit declared"),
        (_signal(1, values=[None]), "field 'values' holds NoneType, expected numbers"),
        ([("/\n", M, T0, b"")], r"'/\\n' message 0: not readable JSON"),
        ([("/c", C, T0, CONTOUR)], "no record 'pose//c' with T_frame_from_image, 16 numbers"),
        ([("/c", C, T0, CONTOUR | {"own_sd": 1e-4})], "field 'confidence' is missing"),
        (
            [("/c", C, T0, CONTOUR | {"own_sd": 1e-4, "confidence": 1.5})],
            r"confidence 1\.5: 0 or above, to 1",
        ),
        (_raw(b'{"x":[NaN]}'), "NaN is not a JSON number; write null"),
        (_raw(b'{"x":[-Infinity]}'), "-Infinity is not a JSON number"),
        (_raw(b'{"frame":"w","names":["a"],"x":[1e999],"y":[0],"z":[0],"sd":0}'), "beyond float64"),
        (_raw(b'{"sd":1,"sd":2}'), "a field occurs twice"),
        (_raw(b"[]"), "JSON list, expected an object"),
        (_raw(b"{"), "not readable JSON"),
        (_raw(b"\xff\xfe"), "not readable JSON"),
        (_raw(b'{"x":' + b"[" * 100_000), "not readable JSON"),
        (_raw(b'{"x":' + b"9" * 5000 + b"}"), "not readable JSON"),
        (_raw(b""), "not readable JSON"),
        ([("/i", "foxglove.Grid", T0, b"")], r"schemas found: \['foxglove.Grid'\]; see `validate"),
    ],
)
def test_what_contradicts_itself_is_named(
    tmp_path: Path, messages: list[tuple[str, str, int, Any]], message: str
) -> None:
    path = write_foreign(tmp_path / "f.mcap", messages)
    with pytest.raises(RecordingError, match=message) as caught:
        read_recording(path)
    assert str(caught.value).startswith("f.mcap: ")
    assert "\n" not in str(caught.value)


def test_a_topic_without_messages_is_refused(tmp_path: Path) -> None:
    path = write_foreign(tmp_path / "f.mcap", _markers(), empty_topics={"/empty": S})
    with pytest.raises(RecordingError, match="'/empty': zero messages"):
        read_recording(path)


def test_our_schema_in_another_encoding_is_refused(tmp_path: Path) -> None:
    path = write_foreign(tmp_path / "f.mcap", _markers(), encodings=("protobuf", "cbor"))
    with pytest.raises(RecordingError, match="Markers in 'protobuf/cbor', expected"):
        read_recording(path)


def test_one_message_too_large_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("validate.recording.mcap.schemas.MAX_MESSAGE", 50)
    path = write_foreign(tmp_path / "f.mcap", _signal())
    with pytest.raises(RecordingError, match=r"message of \d+ bytes, the limit is 50"):
        read_recording(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 2 3", r"shape \(3,\), expected \(16\)"),
        ("nan " * 16, "16 of 16 values not finite"),
        ("one " * 16, "could not convert string to float"),
    ],
)
def test_a_pose_that_is_none_is_refused(tmp_path: Path, text: str, message: str) -> None:
    metadata = {"pose//c": {"T_frame_from_image": text}}
    path = write_foreign(tmp_path / "f.mcap", [("/c", C, T0, CONTOUR)], metadata=metadata)
    with pytest.raises(RecordingError, match=message):
        read_recording(path)


def test_outlines_have_their_own_sd_all_or_none(tmp_path: Path) -> None:
    own = CONTOUR | {"own_sd": 1e-4, "confidence": 0.9}
    pose = {"pose//c": {"T_frame_from_image": " ".join(map(str, np.eye(4).ravel()))}}
    messages = [("/c", C, T0, own), ("/c", C, T0, own), ("/c", C, T0, CONTOUR)]
    path = write_foreign(tmp_path / "f.mcap", messages[:2], metadata=pose)
    assert read_recording(path).contour("/c").each == pytest.approx(np.array([[1e-4, 0.9]] * 2))
    path = write_foreign(tmp_path / "g.mcap", messages, metadata=pose)
    with pytest.raises(RecordingError, match="only some outlines have an sd"):
        read_recording(path)
    assert any("only some outlines" in d for d in Inspection.of(path).defects)


def test_a_format_of_the_future_is_refused(tmp_path: Path) -> None:
    metadata = {"validate.recording": {"format": "2", "name": "x"}}
    path = write_foreign(tmp_path / "f.mcap", _markers(), metadata=metadata)
    with pytest.raises(RecordingError, match="expected format 1 and a name"):
        read_recording(path)


def test_a_topic_on_two_channels_is_refused(tmp_path: Path) -> None:
    from mcap.writer import Writer

    path = tmp_path / "f.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema(M, "jsonschema", b"{}")
        for _ in range(2):
            channel = writer.register_channel("/m", "json", schema)
            writer.add_message(channel, log_time=1, publish_time=1, data=b"{}")
        writer.finish()
    with pytest.raises(RecordingError, match=r"topics on two channels: \['/m'\]"):
        read_recording(path)


def test_statistics_that_claim_more_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.mcap"
    write_recording(sample_recording(), path)
    monkeypatch.setattr("validate.recording.mcap.integrity.statistics_messages", lambda _: 99)
    with pytest.raises(RecordingError, match=r"claim 99 messages.*27; see"):
        read_recording(path)
