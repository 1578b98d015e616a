"""Contents of recordings by others, record by record: against what their makers say must be read,
against the reader of MCAP's makers, and against another decoder of ROS 2."""

import json
from collections.abc import Iterable
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mcap.reader import NonSeekingReader
from mcap.records import Attachment as TheirAttachment
from mcap.records import Channel as TheirChannel
from mcap.records import Message as TheirMessage
from mcap.records import Metadata as TheirMetadata
from mcap.records import Schema as TheirSchema
from mcap.stream_reader import StreamReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from validate.errors import RecordingError
from validate.installation import install_command
from validate.recording.mcap import decoders, known_messages, third_party_channels
from validate.recording.mcap.decoders import decoder_of
from validate.recording.mcap.integrity import verify
from validate.recording.mcap.records import (
    HEAD,
    Channel,
    Message,
    Metadata,
    Schema,
    Verified,
    messages_of,
    opened,
    records_in,
)
from validate.recording.mcap.schemas import by_name

# private: _guarded, _packed, _points: called alone, case by case.

ReportAdditions = tuple[str, dict[str, Any]]
NO_FIELD = ("__msgtype__", "structure_needs_at_least_one_member")
COMPARED = ("Schema", "Channel", "Message", "Attachment", "Metadata")


def ours(path: Path) -> tuple[list[ReportAdditions], Verified]:
    """What this reader finds, in the words of the suite; bytes as numbers."""
    with opened(path) as stream:
        verified = verify(stream, path)
        found = [_schema(s) for s in verified.schemas.values()]
        found += [_channel(c) for c in verified.channels.values()]
        found += [
            ("Message", {"channel_id": m.channel_id, "sequence": m.sequence, "log_time": m.log_ns,
                         "publish_time": m.publish_ns, "data": list(m.data)})
            for m in messages_of(stream, verified, verified.channels.keys())
        ]  # fmt: skip
        for a in verified.attachments:
            stream.seek(a.at)
            found.append(("Attachment", {
                "log_time": a.log_ns, "create_time": a.created_ns, "name": a.name,
                "media_type": a.media_type, "data": list(stream.read(a.size))}))  # fmt: skip
        found += [("Metadata", {"name": m.name, "metadata": dict(m.values)})
                  for m in verified.metadata]  # fmt: skip
    return found, verified


def _schema(s: Any) -> ReportAdditions:
    return "Schema", {"id": s.id, "name": s.name, "encoding": s.encoding, "data": list(s.data)}


def _channel(c: Any) -> ReportAdditions:
    encoding = c.message_encoding if isinstance(c, TheirChannel) else c.encoding
    return "Channel", {"id": c.id, "schema_id": c.schema_id, "topic": c.topic,
                       "message_encoding": encoding, "metadata": dict(c.metadata)}  # fmt: skip


def as_text(told: Iterable[ReportAdditions]) -> list[str]:
    """In one order, numbers as texts as the suite writes them, repeated declarations once."""
    lines = [json.dumps([kind, _texts(held)], sort_keys=True) for kind, held in told]
    once = {line for line in lines if not line.startswith('["Message"')}
    return sorted([*once, *(line for line in lines if line.startswith('["Message"'))])


def _texts(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _texts(v) for k, v in value.items()}
    return [_texts(v) for v in value] if isinstance(value, list) else str(value)


def test_every_record_of_the_conformance_suite_is_what_its_json_says(shared_data: Path) -> None:
    compared = 0
    for path in sorted((shared_data / "mcap" / "conformance").rglob("*.mcap")):
        records = json.loads(path.with_suffix(".json").read_text())["records"]
        said = [(r["type"], dict(r["fields"])) for r in records]
        wanted = as_text(one for one in said if one[0] in COMPARED)
        found, verified = ours(path)
        assert as_text(found) == wanted, path.name
        compared += len(wanted)
        for kind, counts in said:
            if kind == "Statistics":
                assert str(verified.claimed_messages) == counts["message_count"]
                assert str(len(verified.attachments)) == counts["attachment_count"]
                assert str(verified.chunks) == counts["chunk_count"]
    assert compared == 154 + 14 + 2 * 154  # messages, attachments, a schema and channel each


def theirs(path: Path) -> list[ReportAdditions]:
    """The same by the reader of MCAP's makers, front to back."""
    found: list[ReportAdditions] = []
    with path.open("rb") as stream:
        for r in StreamReader(stream).records:
            if isinstance(r, TheirSchema):
                found.append(_schema(r))
            elif isinstance(r, TheirChannel):
                found.append(_channel(r))
            elif isinstance(r, TheirMessage):
                found.append(("Message", {
                    "channel_id": r.channel_id, "sequence": r.sequence, "log_time": r.log_time,
                    "publish_time": r.publish_time, "data": list(r.data)}))  # fmt: skip
            elif isinstance(r, TheirAttachment):
                found.append(("Attachment", {
                    "log_time": r.log_time, "create_time": r.create_time, "name": r.name,
                    "media_type": r.media_type, "data": list(r.data)}))  # fmt: skip
            elif isinstance(r, TheirMetadata):
                found.append(("Metadata", {"name": r.name, "metadata": dict(r.metadata)}))
    return found


def recordings(shared_data: Path) -> list[Path]:
    found = [
        *(shared_data / "mcap/ros2").glob("*.mcap"),
        *(shared_data / "mcap/dds").glob("*.mcap"),
    ]
    assert len(found) == 6
    return sorted(found)


def test_recordings_of_rosbag2_and_dds_hold_what_their_makers_reader_finds(
    shared_data: Path,
) -> None:
    kinds = set()
    for path in recordings(shared_data):
        wanted = theirs(path)
        kinds |= {kind for kind, _ in wanted}
        assert as_text(ours(path)[0]) == as_text(wanted), path.name
    assert kinds == set(COMPARED)


def plain(value: Any) -> Any:
    """A message of either decoder as lists, texts and numbers; the other decoder shows constants,
    the byte that stands for an empty message, and octets (`byte` of ROS 2) as signed."""
    if is_dataclass(value):
        value = {f.name: getattr(value, f.name) for f in fields(value)}
    if isinstance(value, dict):
        named = {k: plain(v) for k, v in value.items() if k not in NO_FIELD and not k.isupper()}
        return {k: (np.array(v) % 256).tolist() if "byte_" in k else v for k, v in named.items()}
    if isinstance(value, (bytes, bytearray, memoryview, np.ndarray)):
        return [plain(v) for v in np.asarray(value if not isinstance(value, bytes) else
                                             list(value)).tolist()]  # fmt: skip
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    return value


@pytest.mark.slow
def test_messages_of_ros2_are_what_another_decoder_finds(shared_data: Path) -> None:
    compared = refused = 0
    for path in recordings(shared_data):
        with opened(path) as stream:
            verified = verify(stream, path)
            for m in messages_of(stream, verified, verified.channels.keys()):
                channel = verified.channels[m.channel_id]
                schema = verified.schemas[channel.schema_id]
                decode = decoder_of(schema, channel)
                if isinstance(decode, str):
                    refused += 1
                    continue
                store = get_typestore(Stores.EMPTY)
                store.register(get_types_from_msg(schema.data.decode(), schema.name))
                assert plain(decode(m.data)) == plain(store.deserialize_cdr(m.data, schema.name))
                compared += 1
    # omgidl 12, a service that rosbags cannot parse either 6, encoding 'wrong_format' 7
    assert (compared, refused) == (20 + 7 + 1324 + 7, 12 + 6 + 7)


def test_messages_come_in_the_order_of_their_file(shared_data: Path) -> None:
    path = shared_data / "mcap/ros2/talker.mcap"
    with path.open("rb") as stream:
        read = NonSeekingReader(stream).iter_messages(log_time_order=False)
        wanted = [(c.topic, m.log_time) for _, c, m in read]
    with opened(path) as stream:
        verified = verify(stream, path)
        found = messages_of(stream, verified, verified.channels.keys())
        assert [(verified.channels[m.channel_id].topic, m.log_ns) for m in found] == wanted


@pytest.mark.parametrize("at", ["data", "sequence", "publish_time"])
def test_one_wrong_field_is_seen(at: str, shared_data: Path) -> None:
    """The comparison above can fail."""
    found, _ = ours(next((shared_data / "mcap/conformance/OneMessage").glob("*.mcap")))
    other = [(k, {**f, at: [0]} if k == "Message" else f) for k, f in found]
    assert as_text(found) != as_text(other)


NO_SCHEMA = Schema(1, "x/msg/X", "ros2msg", b"")


def test_encodings_that_nothing_here_decodes_report_it(monkeypatch: pytest.MonkeyPatch) -> None:
    channel = Channel(1, 1, "/x", "cdr", {})
    assert decoder_of(None, channel) == "no decoder for '/cdr'"
    library = "mcap_ros2.decoder.DecoderFactory"
    monkeypatch.setattr(library, refusing(ImportError("no", name="mcap_ros2")))
    assert decoder_of(NO_SCHEMA, channel) == (
        f"the library 'mcap_ros2' that reads it is not installed; {install_command()}"
    )
    monkeypatch.setattr(library, refusing(SyntaxError("line 3\n of it")))
    assert decoder_of(NO_SCHEMA, channel) == "its schema cannot be parsed (line 3 of it)"


def refusing(error: Exception) -> Any:
    def refuse(*_: object) -> None:
        raise error

    return refuse


def test_a_library_without_a_decoder_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    nothing = SimpleNamespace(decoder_for=lambda *_: None)
    monkeypatch.setattr("mcap_ros2.decoder.DecoderFactory", lambda: nothing)
    monkeypatch.setattr("mcap_protobuf.decoder.DecoderFactory", lambda: nothing)
    said = decoder_of(NO_SCHEMA, Channel(1, 1, "/x", "cdr", {}))
    assert said == "its schema cannot be parsed (no ROS 2 message definition)"
    schema = Schema(1, "X", "protobuf", b"")
    said = decoder_of(schema, Channel(1, 1, "/x", "protobuf", {}))
    assert said == "its schema cannot be parsed (no Protobuf schema)"


def test_damaged_messages_are_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    known = RecordingError("a field of 3 bytes")
    for decode, says in (
        (refusing(known), "^a field of 3 bytes$"),
        (refusing(IndexError("out\nof range")), r"^damaged \(out of range\)$"),
        (lambda data: [1], "^list, expected an object with fields$"),
    ):
        with pytest.raises(RecordingError, match=says):
            decoders._guarded(decode)(b"xyz")
    monkeypatch.setattr(decoders, "MAX_MESSAGE", 2)
    with pytest.raises(RecordingError, match="a message of 3 bytes, the limit is 2"):
        decoders._guarded(dict)(b"xyz")


@pytest.mark.parametrize(
    ("value", "says"), [("A", r"not base64 \("), (3.5, r"not bytes \("), ([300], r"not bytes \(")]
)
def test_fields_that_are_no_bytes_are_refused(value: object, says: str) -> None:
    assert decoders.binary("AQI=") == decoders.binary([1, 2]) == decoders.binary(b"\1\2") == b"\1\2"
    with pytest.raises(RecordingError, match=says):
        decoders.binary(value)


def test_metadata_called_as_a_repeat_would_be_is_refused() -> None:
    twice = [Metadata("a", {"k": "1"}), Metadata("a", {"k": "2"})]
    assert by_name(twice) == {"a": {"k": "1"}, "a#2": {"k": "2"}}
    with pytest.raises(RecordingError, match="metadata 'a#2' occurs twice; rename one"):
        by_name([Metadata("a#2", {}), *twice])


def test_records_longer_than_their_chunk_and_short_messages_are_refused() -> None:
    stray = HEAD.pack(5, 0) + b"xx"
    with pytest.raises(RecordingError, match="2 stray bytes at the end of a chunk"):
        list(records_in(stray))
    with pytest.raises(RecordingError, match=r"a record of 9 bytes.*4"):
        list(records_in(HEAD.pack(5, 9) + bytes(4)))
    with pytest.raises(RecordingError, match=r"21 bytes.*least 22 needed"):
        Message.read(bytes(21), 0, 21)


@pytest.mark.parametrize(
    ("offsets", "stride", "says"),
    [
        ({"x": (0, 7), "y": (4, 7)}, 12, "a cloud without 'z' as a float"),
        ({"x": (0, 3)}, 12, "a cloud without 'x' as a float"),
        ({"x": (12, 7)}, 12, "a cloud without 'x' as a float"),
        ({"x": (10, 7)}, 12, "24 bytes for 2 points of 12; truncated"),
        ({"x": (0, 7)}, 13, "24 bytes for 2 points of 13; truncated"),
    ],
)
def test_clouds_that_are_cut_are_refused(
    offsets: dict[str, tuple[int, int]], stride: int, says: str
) -> None:
    with pytest.raises(RecordingError, match=says):
        known_messages._packed(bytes(24), offsets, stride, "<", 2)
    whole = np.arange(6, dtype=">f4").tobytes()
    at = {"x": (0, 7), "y": (4, 7), "z": (8, 7)}
    assert known_messages._packed(whole, at, 12, ">", 2).tolist() == [[0, 1, 2], [3, 4, 5]]


def test_too_many_points_and_numbers_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(known_messages, "MAX_POINTS", 1)
    with pytest.raises(RecordingError, match="2 points, the limit is 1"):
        known_messages._points(0, "lab", np.zeros((2, 3)))
    with pytest.raises(RecordingError, match="2 points, the limit is 1"):
        known_messages._packed(bytes(24), {}, 12, "<", 2)
    monkeypatch.setattr(third_party_channels, "MAX_NUMBERS", 5)
    gathered = {1: SimpleNamespace(add=lambda message: 3)}
    messages = [Message(1, 0, 0, 0, b"")] * 2
    third_party_channels.fill(gathered, messages[:1])  # type: ignore[arg-type]
    with pytest.raises(RecordingError, match="than 5 numbers"):
        third_party_channels.fill(gathered, messages)  # type: ignore[arg-type]
