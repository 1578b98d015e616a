"""Recordings made by others, each beside what must be found in it."""

import json
from collections import Counter
from pathlib import Path

import pytest

from validate.errors import RecordingError
from validate.recording.mcap.decoders import messages_in
from validate.recording.mcap.read import read_recording
from validate.recording.preflight import Inspection

ROS2 = {
    "talker": 20,
    "cdr_test_0": 7,
    "multiple_files_0": 1324,
    "topics_and_services": 13,
    "wrong_rmw_test_0": 7,
}


def _expected(path: Path) -> list[tuple[str, dict[str, object]]]:
    records = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))["records"]
    return [(r["type"], dict(r["fields"])) for r in records]


def _check(got: Inspection, expected: list[tuple[str, dict[str, object]]]) -> None:
    kinds = Counter(kind for kind, _ in expected)
    assert (got.messages, got.attachments) == (kinds["Message"], kinds["Attachment"])
    assert len(got.metadata) == kinds["Metadata"]
    assert [got.library, got.profile] == [expected[0][1]["library"], expected[0][1]["profile"]]
    channels = {str(f["topic"]) for kind, f in expected if kind == "Channel"}
    assert {t.name for t in got.topics} == channels
    for kind, fields in expected:
        if kind == "Message":
            assert str(got.topics[0].first_ns) == fields["publish_time"]
        if kind == "DataEnd":
            assert (got.source.integrity == "verified") == (fields["data_section_crc"] != "0")


def test_every_conformance_file_holds_what_its_json_says(shared_data: Path) -> None:
    files = sorted((shared_data / "mcap" / "conformance").rglob("*.mcap"))
    assert len(files) == 174
    total = 0
    for path in files:
        got = Inspection.of(path)
        _check(got, _expected(path))
        json.dumps(got.to_dict(), allow_nan=False)
        total += got.messages
    assert total > 100


def test_no_conformance_file_holds_a_topic_of_ours(shared_data: Path) -> None:
    for path in (shared_data / "mcap" / "conformance").rglob("*.mcap"):
        with pytest.raises(RecordingError, match="no topic with markers, signals"):
            read_recording(path)


@pytest.mark.parametrize(("name", "count"), ROS2.items())
def test_ros2_recordings_are_listed_whole(shared_data: Path, name: str, count: int) -> None:
    got = Inspection.of(shared_data / "mcap" / "ros2" / f"{name}.mcap")
    assert got.messages == sum(t.count for t in got.topics) == count
    assert got.profile == "ros2"
    assert {t.kind for t in got.topics} == {"foreign"}
    assert got.source.integrity == "integrity not provable: no data CRC"


def test_what_rosbag2_always_writes_is_no_defect(shared_data: Path) -> None:
    """Channels without messages, and its record once for every split."""
    got = Inspection.of(shared_data / "mcap" / "ros2" / "topics_and_services.mcap")
    assert sum(t.count == 0 for t in got.topics) == 3
    assert got.metadata == ("rosbag2", "rosbag2")
    assert not [d for d in got.defects if d.endswith("no messages") or "rosbag2" in d]


def test_a_dds_recording_is_listed(shared_data: Path) -> None:
    got = Inspection.of(shared_data / "mcap" / "dds" / "configuration_type.mcap")
    assert (got.messages, got.attachments, got.metadata) == (12, 1, ("version",))
    assert got.facts == ("attachment dynamic_types: no media type, 685 bytes",)
    assert {t.name: t.count for t in got.topics} == {
        "/ddsrecorder/status": 2,
        "configuration_topic": 10,
    }
    assert {t.schema_encoding for t in got.topics} == {"omgidl"}


def test_what_ros2_recordings_say_is_read(shared_data: Path, capfd: pytest.CaptureFixture) -> None:
    folder = shared_data / "mcap" / "ros2"

    def said(name: str, topic: str) -> list[dict]:
        return [m["message"] for m in messages_in(folder / f"{name}.mcap", topic, 2000)]

    assert said("talker", "/topic") == [{"data": f"Hello, world! {i}"} for i in range(10)]
    assert said("multiple_files_0", "/chatter") == [{"data": "test"}] * 1324
    first = said("cdr_test_0", "/array_topic")[0]
    assert first["bool_values"] == [True, False, True]
    assert len(said("topics_and_services", "/parameter_events")) == 7
    for name, topic in (
        ("wrong_rmw_test_0", "/test_topic"),
        ("topics_and_services", "/add_two_ints/_service_event"),
        ("../dds/configuration_type", "configuration_topic"),
    ):
        with pytest.raises(RecordingError, match=r"no decoder for|cannot be parsed"):
            said(name, topic)
    assert capfd.readouterr() == ("", "")


def test_no_recording_of_others_is_left_out(shared_data: Path) -> None:
    names = {p.stem for p in (shared_data / "mcap").rglob("*.mcap") if "conformance" not in p.parts}
    assert names == {*ROS2, "configuration_type"}
