"""Channels of any schema: whole, in order of time, one definition a name, or refused."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader

from validate.errors import RecordingError
from validate.recording.mcap.schemas import to_bytes
from validate.recording.mcap.write import (
    LAST_NS,
    WrittenChannel,
    WrittenMessage,
    json_schema,
    write_channels,
)
from validate.recording.preflight import Inspection

NUMBER = WrittenChannel("/a", json_schema("own.Number", {"type": "object"}), {"unit": "N"})
TEXT = WrittenChannel("/b", json_schema("own.Text", {"type": "object"}))
MESSAGES = [
    WrittenMessage("/a", 5, to_bytes({"v": 0.1})),
    WrittenMessage("/b", 5, to_bytes({"text": "zwölf"})),
    WrittenMessage("/a", 7, to_bytes({"v": 1e-300})),
]


def read(path: Path) -> list[tuple[str, int, int, bytes]]:
    with path.open("rb") as stream:
        found = make_reader(stream, validate_crcs=True).iter_messages(log_time_order=False)
        return [(c.topic, m.log_time, m.sequence, m.data) for _, c, m in found]


def test_all_returns(tmp_path: Path) -> None:
    path = tmp_path / "made.mcap"
    write_channels(path, [NUMBER, TEXT], MESSAGES, {"about": {"k": "v"}})
    assert read(path) == [
        ("/a", 5, 0, b'{"v":0.1}'),
        ("/b", 5, 0, b'{"text":"zw\\u00f6lf"}'),
        ("/a", 7, 1, b'{"v":1e-300}'),
    ]
    seen = Inspection.of(path)
    assert seen.defects == ()
    assert seen.source.integrity == "verified"
    assert seen.metadata == ("about",)
    assert [(t.name, t.schema, t.count) for t in seen.topics] == [
        ("/a", "own.Number", 2), ("/b", "own.Text", 1)
    ]  # fmt: skip


def test_equal_bytes(tmp_path: Path) -> None:
    for name in ("one", "two"):
        write_channels(tmp_path / name, [NUMBER, TEXT], MESSAGES, {})
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()


def test_one_flipped_bit_is_found(tmp_path: Path) -> None:
    path = tmp_path / "made.mcap"
    write_channels(path, [NUMBER, TEXT], MESSAGES, {"about": {"k": "v"}})
    whole = path.read_bytes()
    for at in range(8, len(whole) // 2, 7):  # data section
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 4]) + whole[at + 1 :])
        with pytest.raises(RecordingError):
            Inspection.of(path)


@given(st.lists(st.integers(0, LAST_NS), max_size=20).map(sorted))
def test_any_times_in_order(tmp_path_factory: pytest.TempPathFactory, times: list[int]) -> None:
    path = tmp_path_factory.mktemp("times") / "made.mcap"
    write_channels(path, [NUMBER], [WrittenMessage("/a", t, b"{}") for t in times], {})
    assert [ns for _, ns, _, _ in read(path)] == times


@pytest.mark.parametrize(
    ("channels", "messages", "words"),
    [
        ([NUMBER, NUMBER], [], "used twice: ['/a']"),
        ([NUMBER, WrittenChannel("/c", json_schema("own.Number", {}))], [], "'/c' differs"),
        ([TEXT], MESSAGES, "topic '/a' is not one of ['/b']"),
        ([NUMBER, TEXT], MESSAGES[::-1], "'/b' at 5 ns, expected 7"),
        ([NUMBER], [WrittenMessage("/a", -1, b"{}")], "at -1 ns, expected 0"),
        ([NUMBER], [WrittenMessage("/a", LAST_NS + 1, b"{}")], "in order of time"),
    ],
)
def test_refused_and_the_old_file_kept(
    tmp_path: Path, channels: list[WrittenChannel], messages: list[WrittenMessage], words: str
) -> None:
    path = tmp_path / "made.mcap"
    path.write_text("old")
    with pytest.raises(RecordingError) as raised:
        write_channels(path, channels, messages, {})
    assert words in str(raised.value)
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [("made.mcap", "old")]


def test_no_folder(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="cannot be written"):
        write_channels(tmp_path / "absent" / "made.mcap", [NUMBER], [], {})


def test_nan_is_a_bug() -> None:
    with pytest.raises(ValueError, match="JSON"):
        to_bytes({"v": float("nan")})
