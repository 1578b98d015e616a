"""A damaged or forged file is one clear error, never a crash and never other values."""

import re
import struct
import tracemalloc
import zlib
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.writer import CompressionType
from mcap_samples import T0, markers_json, same_values, sample_recording, signal_json, write_foreign

from validate.errors import RecordingError
from validate.recording.mcap.read import read_recording
from validate.recording.mcap.records import MAX_RECORD, unpack
from validate.recording.mcap.write import write_recording
from validate.recording.preflight import Inspection
from validate.recording.types import Recording

MAGIC = b"\x89MCAP0\r\n"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("whole") / "a.mcap"
    write_recording(sample_recording(), path)
    return path.read_bytes()


def _read(data: bytes, path: Path) -> Recording | str:
    """The recording, or its error; any other exception fails the test."""
    path.write_bytes(data)
    try:
        return read_recording(path)
    except RecordingError as error:
        message = str(error)
    assert "\n" not in message
    assert path.name in message
    return message


def _flip(data: bytes, bit: int) -> bytes:
    flipped = bytearray(data)
    flipped[bit // 8] ^= 1 << bit % 8
    return bytes(flipped)


def _check_flips(data: bytes, count: int, path: Path) -> int:
    """Flip `count` bits, one at a time, spread over all bytes; returns how many were detected."""
    bits = np.linspace(0, 8 * len(data) - 1, count).astype(int)
    shifts = np.random.default_rng(3).integers(0, 8, size=count)
    detected = 0
    for bit, shift in zip(bits, shifts, strict=True):
        got = _read(_flip(data, int(bit) ^ int(shift)), path)
        if isinstance(got, str):
            detected += 1
        else:
            assert same_values(got, sample_recording())
    return detected


def test_300_bit_flips_change_no_value(whole: bytes, tmp_path: Path) -> None:
    assert _check_flips(whole, 300, tmp_path / "a.mcap") == 300


@pytest.mark.slow
def test_10_000_bit_flips_change_no_value(whole: bytes, tmp_path: Path) -> None:
    assert _check_flips(whole, 10_000, tmp_path / "a.mcap") == 10_000


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [{"enable_crcs": False}, {"use_chunking": False, "enable_crcs": False}],
    ids=["chunked", "unchunked"],
)
def test_bit_flips_without_crcs_never_crash(tmp_path: Path, options: dict[str, bool]) -> None:
    messages = [("/m", "validate.Markers", T0 + i, markers_json(T0 + i)) for i in range(4)]
    data = write_foreign(tmp_path / "f.mcap", messages, **options).read_bytes()
    bits = np.random.default_rng(5).integers(0, 8 * len(data), size=400)
    results = [_read(_flip(data, int(bit)), tmp_path / "f.mcap") for bit in bits]
    assert any(isinstance(r, Recording) for r in results)  # nothing protects such a file
    assert all(
        isinstance(r, str) or r.source.integrity == "integrity not provable: no data CRC"
        for r in results
    )


def test_a_cut_file_is_refused_at_every_length(whole: bytes, tmp_path: Path) -> None:
    for length in np.linspace(0, len(whole) - 1, 60).astype(int):
        got = _read(whole[:length], tmp_path / "cut.mcap")
        assert isinstance(got, str)
        assert re.search(r"chunks, \d+ messages", got)


def test_a_cut_file_says_what_can_be_read(tmp_path: Path) -> None:
    messages = [("/s", "validate.Signal", T0 + i, signal_json(T0 + i)) for i in range(9)]
    path = write_foreign(tmp_path / "f.mcap", messages, chunk_size=400)
    data = path.read_bytes()
    starts = _record_starts(data, 0x06)
    got = _read(data[: starts[2] + 20], path)
    assert isinstance(got, str)
    assert f"at byte {starts[2]} of {starts[2] + 20}" in got
    assert f"readable before it: 2 chunks, {2 * 9 // len(starts)} messages" in got


def _record_starts(data: bytes, wanted: int) -> list[int]:
    at, found = 8, []
    while at < len(data) - 8:
        opcode, length = struct.unpack_from("<BQ", data, at)
        if opcode == wanted:
            found.append(at)
        at += 9 + length
    return found


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "at byte 0 of 0: the file is empty"),
        (b"t [s],F [N]\n0,1\n", r"the first 8 bytes are not the MCAP magic \(74205b735d2c4620\)"),
        (bytes(1000), "the first 8 bytes are not the MCAP magic"),
        (MAGIC, "the file ends 9 bytes too early"),
        (MAGIC + MAGIC, "the file ends 1 bytes too early"),
        (MAGIC + bytes(9) + MAGIC, "the first record, and only the first, must be the header"),
    ],
    ids=["empty", "text", "zeros", "magic", "two magics", "no header"],
)
def test_what_is_no_mcap_is_named(tmp_path: Path, data: bytes, message: str) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(data)
    for use in (read_recording, Inspection.of):
        with pytest.raises(RecordingError, match=message):
            use(path)


def test_absent_files_and_folders_are_one_line(tmp_path: Path) -> None:
    for path in (tmp_path / "absent.mcap", tmp_path):
        with pytest.raises(RecordingError, match="cannot be read"):
            read_recording(path)


def test_bytes_after_the_end_are_refused(whole: bytes, tmp_path: Path) -> None:
    got = _read(whole + b"tail", tmp_path / "a.mcap")
    assert isinstance(got, str)
    assert "4 bytes after the closing magic" in got


def test_a_wrong_summary_crc_is_found(whole: bytes, tmp_path: Path) -> None:
    at = whole.index(b"/force", _record_starts(whole, 0x0F)[0])  # the channel repeated at the end
    got = _read(_flip(whole, 8 * at), tmp_path / "a.mcap")
    assert isinstance(got, str)
    assert "declared twice, differently" in got
    footer = _record_starts(whole, 0x02)[0]
    got = _read(_flip(whole, 8 * (footer + 9 + 8)), tmp_path / "a.mcap")
    assert isinstance(got, str)
    assert "summary CRC" in got


def test_a_wrong_chunk_crc_is_found_where_no_data_crc_is(tmp_path: Path) -> None:
    path, none = tmp_path / "f.mcap", CompressionType.NONE
    messages = [("/s", "validate.Signal", T0, signal_json(T0))]
    data = write_foreign(path, messages, compression=none).read_bytes()
    got = _read(data.replace(b"[1.5]", b"[1.6]"), path)
    assert isinstance(got, str)
    assert "chunk CRC" in got


def test_a_footer_that_points_elsewhere_is_refused(tmp_path: Path) -> None:
    footer = _record(0x02, struct.pack("<QQI", 5, 0, 0))
    got = _read(_file()[: -len(footer) - 8] + footer + MAGIC, tmp_path / "f.mcap")
    assert isinstance(got, str)
    assert "footer: summary at byte 5, found at 38" in got


def _record(opcode: int, content: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(content)) + content


def _file(*records: bytes) -> bytes:
    """A file of these data records, without CRCs and summary."""
    end = _record(0x0F, bytes(4)) + _record(0x02, bytes(20))
    return MAGIC + _record(0x01, bytes(8)) + b"".join(records) + end + MAGIC


def _chunk(size: int, data: bytes, compression: bytes = b"zstd") -> bytes:
    head = struct.pack("<QQQI", 0, 0, size, 0)
    name = struct.pack("<I", len(compression)) + compression
    return _record(0x06, head + name + struct.pack("<Q", len(data)) + data)


SCHEMA = _record(0x03, struct.pack("<HI1sII", 1, 1, b"S", 0, 0))
CHANNEL = _record(0x04, struct.pack("<HHI2sII", 1, 1, 2, b"/t", 0, 0))
MESSAGE = _record(0x05, struct.pack("<HIQQ", 1, 0, 5, 5))


def test_the_forged_parts_make_a_readable_file(tmp_path: Path) -> None:
    path = tmp_path / "f.mcap"
    path.write_bytes(_file(SCHEMA, CHANNEL, MESSAGE, _record(0x90, b"private")))
    got = Inspection.of(path)
    assert (got.messages, got.topics[0].first_ns) == (1, 5)
    assert got.defects == ("1 records of unknown kind",)


@pytest.mark.parametrize(
    ("records", "message"),
    [
        (
            [_chunk(2**62, b"x" * 20)],
            f"a chunk of {2**62} bytes unpacked, the limit is {MAX_RECORD}",
        ),
        ([_chunk(100, zstandard.compress(bytes(10**6)))], "a zstd frame of 1000000 bytes unpacked"),
        ([_chunk(100, lz4.frame.compress(bytes(10**6)), b"lz4")], "a chunk of 101 bytes unpacked"),
        ([_chunk(10, b"junk", b"zstd")], "not valid zstd"),
        ([_chunk(10, b"junkjunkjunk", b"lz4")], "not valid lz4"),
        ([_chunk(10, b"junk", b"")], "a chunk of 4 bytes unpacked, declared 10"),
        ([_chunk(4, b"junk", b"xz")], "chunk compression 'xz', readable: none, zstd, lz4"),
        ([_chunk(4, b"junk", b"")], "4 stray bytes at the end of a chunk"),
        ([struct.pack("<BQ", 5, 2**63)], f"a record declares {2**63} bytes where the file has"),
        ([_record(0x03, struct.pack("<HI", 1, 2**32 - 1))], "a field of 4294967295 bytes"),
        ([_record(0x0C, struct.pack("<I2sI", 2, b"\xff\xff", 0))], "not UTF-8"),
        ([CHANNEL], "'/t' uses schema 1, undeclared"),
        ([SCHEMA, MESSAGE], "a message of channel 1, undeclared"),
        ([SCHEMA, CHANNEL, _record(0x05, b"short")], "a message record of 5 bytes"),
        ([SCHEMA, SCHEMA.replace(b"S", b"Z")], "schema 1 declared twice, differently"),
        ([SCHEMA, CHANNEL, CHANNEL.replace(b"t", b"u")], "channel 1 declared twice, differently"),
        ([_record(0x03, bytes(14))], "a schema with id 0"),
        ([_record(0x01, bytes(8))], "only the first, must be the header"),
        ([_record(0x0F, bytes(4))], "a second end of the data section"),
        ([_record(0x0F, bytes(4)), MESSAGE], "a MESSAGE record after the end of the data"),
        ([_record(0x02, bytes(20))], "a footer without an end of the data section"),
        ([_chunk(len(_chunk(0, b"")), _chunk(0, b""), b"")], "a CHUNK record inside a chunk"),
        (
            [_record(0x0C, struct.pack("<IIIIII", 0, 16, 0, 0, 0, 0))],
            "key '' twice in one map",
        ),
        (
            [SCHEMA, CHANNEL, _record(0x05, struct.pack("<HIQQ", 1, 0, 2**64 - 1, 5))],
            f"log time {2**64 - 1} ns is beyond int64",
        ),
        (
            [_record(0x09, bytes(16) + struct.pack("<IIQ2sI", 0, 0, 2, b"ab", 1))],
            "attachment CRC 0x[0-9a-f]{8}, declared 0x00000001",
        ),
    ],
)
def test_forged_records_are_refused(tmp_path: Path, records: list[bytes], message: str) -> None:
    path = tmp_path / "f.mcap"
    path.write_bytes(_file(*records))
    with pytest.raises(RecordingError, match=message):
        Inspection.of(path)


def test_a_forged_size_takes_no_memory() -> None:
    packed = zstandard.compress(bytes(10**8))
    tracemalloc.start()
    for size in (2**62, MAX_RECORD + 1, 1000):
        with pytest.raises(RecordingError, match="bytes unpacked"):
            unpack("zstd", packed, size)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 100_000


def test_attachments_with_the_right_crc_pass(tmp_path: Path) -> None:
    body = bytes(16) + struct.pack("<IIQ2s", 0, 0, 2, b"ab")
    path = tmp_path / "f.mcap"
    path.write_bytes(_file(_record(0x09, body + struct.pack("<I", zlib.crc32(body)))))
    assert Inspection.of(path).attachments == 1


@pytest.mark.parametrize("limit", ["mcap.streams.MAX_NUMBERS", "mcap.integrity.MAX_MESSAGES"])
def test_totals_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, limit: str) -> None:
    monkeypatch.setattr(f"validate.recording.{limit}", 2)
    messages = [("/s", "validate.Signal", T0 + i, signal_json(T0 + i)) for i in range(4)]
    path = write_foreign(tmp_path / "f.mcap", messages)
    with pytest.raises(RecordingError, match=r"more than 2 .*; split the file"):
        read_recording(path)


def test_a_record_over_the_limit_is_refused(
    whole: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("validate.recording.mcap.integrity.MAX_RECORD", 100)
    got = _read(whole, tmp_path / "a.mcap")
    assert isinstance(got, str)
    assert "bytes, the limit is 100" in got


def test_a_chunk_that_is_a_bomb_is_refused_before_it_is_unpacked() -> None:
    """A megabyte of zeros is one: an image may be black."""
    size = 128 * 2**20
    packed = zstandard.compress(bytes(size))
    with pytest.raises(
        RecordingError, match=f"chunk of {size} bytes unpacked from {len(packed)}, "
    ):
        unpack("zstd", packed, size)
    assert unpack("zstd", zstandard.compress(bytes(2**20)), 2**20) == bytes(2**20)
