"""The inspection of our own files and of files with every defect."""

import json
from dataclasses import FrozenInstanceError, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import here
from mcap.writer import IndexType
from mcap_samples import T0, markers_json, sample_recording, signal_json, write_foreign

from validate.recording.mcap.write import write_recording
from validate.recording.preflight import Inspection
from validate.recording.types import Frames

MS = 1_000_000


def _defects(path: Path, messages: list[tuple[str, str, int, Any]], **options: Any) -> list[str]:
    return list(Inspection.of(write_foreign(path / "f.mcap", messages, **options)).defects)


def test_a_sound_recording_has_topics_units_and_no_defects(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    write_recording(sample_recording(), path)
    got = Inspection.of(path)
    assert got.defects == ()
    assert (got.library, got.compressions, got.chunks, got.messages) == (
        "validate",
        ("zstd",),
        1,
        27,
    )
    assert got.source.integrity == "verified"
    assert got.metadata == ("validate.recording", "pose//outline", "calibration", "empty")
    table = {t.name: (t.kind, t.schema, t.unit, t.frame, t.count) for t in got.topics}
    assert table == {
        "/markers": ("markers", "validate.Markers", "m", "camera", 5),
        "/markers/foxglove": ("mirror", "foxglove.PosesInFrame", "", "", 5),
        "/plane": ("markers", "validate.Markers", "m", "plate", 4),
        "/plane/foxglove": ("mirror", "foxglove.PosesInFrame", "", "", 4),
        "/force": ("signal", "validate.Signal", "N", "plate", 7),
        "/outline": ("contours", "validate.Contour", "m", "camera", 2),
    }
    outline = got.topics[-1]
    assert (outline.first_ns, outline.last_ns) == (T0 + 10 * MS, T0 + 20 * MS)


@pytest.mark.parametrize("side", [0.1, 1e-4])
def test_a_pixel_beyond_reason_is_a_defect(tmp_path: Path, side: float) -> None:
    image = np.zeros((4, 5), np.uint8)
    frames = Frames(np.array([0.0]), (image,), (side, 1e-4), np.eye(4), "probe")
    write_recording(replace(sample_recording(), frames={"/us": frames}), tmp_path / "a.mcap")
    odd = "'/us': 0.1 x 0.0001 m per pixel is outside 1e-06 to 0.01 m"
    assert Inspection.of(tmp_path / "a.mcap").defects == ((odd,) if side == 0.1 else ())


def test_an_inspection_is_frozen_and_plain_json(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    write_recording(sample_recording(), path)
    got = Inspection.of(path)
    with pytest.raises(FrozenInstanceError):
        got.messages = 0  # type: ignore[misc]
    plain = json.loads(json.dumps(got.to_dict(), allow_nan=False))
    assert plain == got.to_dict()
    assert plain["topics"][0]["clock"]["rate_hz"] == pytest.approx(100.0)
    assert plain["source"]["bytes"] == path.stat().st_size


def _stamped(*ms: float) -> list[tuple[str, str, int, Any]]:
    return [("/s", "validate.Signal", T0 + int(t * MS), signal_json(T0 + int(t * MS))) for t in ms]


def test_every_defect_is_one_line(tmp_path: Path) -> None:
    assert _defects(tmp_path, _stamped(0, 10, 20, 30, 90)) == [
        "'/s': 1 gaps over 3 x the median step, longest 0.060000 s"
    ]
    assert _defects(tmp_path, _stamped(0, 10, 10, 20)) == [
        "'/s': 1 samples repeat the time before them"
    ]
    assert _defects(tmp_path, _stamped(0, 10, 5, 20)) == [
        "'/s': time runs backward at sample 2 (0.010000000 s -> 0.005000000 s), 1 times in all; "
        "write the messages in order of their stamps",
        "'/s': time runs backward 1 times",
        "'/s': log time runs backward 1 times",
    ]
    assert _defects(tmp_path, _stamped(0), empty_topics={"/t": "x"}) == ["'/t': no messages"]
    assert _defects(tmp_path, _stamped(0, 10), publish={1: T0 + 60 * MS}) == [
        "'/s': stamp and publish time differ by up to 0.050000 s",
        "'/s': publish and log time differ by up to 0.050000 s",
    ]


def test_small_differences_of_the_clocks_are_none(tmp_path: Path) -> None:
    assert _defects(tmp_path, _stamped(0, 10), publish={1: T0 + 19 * MS}) == []


def test_a_broken_topic_does_not_hide_the_others(tmp_path: Path) -> None:
    broken = [("/m", "validate.Markers", T0, markers_json(T0, x=[1]))]
    got = Inspection.of(write_foreign(tmp_path / "f.mcap", broken + _stamped(0, 10)))
    assert got.defects == ("'/m' message 0: lengths of x, y, z differ: [1, 2, 2]",)
    assert [(t.name, t.count, t.unit) for t in got.topics] == [("/m", 1, ""), ("/s", 2, "N")]


def test_a_limit_reached_is_a_defect(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("validate.recording.mcap.streams.MAX_NUMBERS", 2)
    assert _defects(tmp_path, _stamped(0, 10, 20, 30)) == [
        "more than 2 numbers, the limit; split the file"
    ]


def test_contradictions_of_the_summary_are_defects(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("validate.recording.mcap.integrity.statistics_messages", lambda _: 3)
    monkeypatch.setattr("validate.recording.mcap.integrity.chunk_index_place", lambda _: (1, 2))
    assert _defects(tmp_path, _stamped(0, 10)) == [
        "statistics claim 3 messages, 2 found",
        "2 chunks are indexed wrongly or not at all",
    ]


def test_a_file_without_an_index_is_no_defect(tmp_path: Path) -> None:
    assert _defects(tmp_path, _stamped(0, 10), index_types=IndexType.NONE) == []


def _cut(file: Path, share: float) -> str:
    """The path of the first `share` of a file, beside it."""
    data = file.read_bytes()
    path = file.with_name(f"cut{file.suffix}")
    path.write_bytes(data[: int(share * len(data))])
    return str(path)


@pytest.mark.parametrize("flags", [(), ("--json",)])
def test_the_exit_code_tells_of_defects(tmp_path: Path, flags: tuple[str, ...]) -> None:
    file = tmp_path / "a.mcap"
    for sums, integrity in ((False, "not provable"), (True, "verified")):
        write_foreign(file, _stamped(*range(100)), chunk_size=1000, enable_data_crcs=sums)
        code, out, _ = here("inspect", str(file), *flags)
        assert (code, integrity in " ".join(out.split())) == (0, True)
    code, out, _ = here("inspect", _cut(file, 0.6), *flags)
    assert (code, "messages; the writer was stopped" in " ".join(out.split())) == (1, True)
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 4
    file.write_bytes(data)
    code, out, error = here("inspect", str(file), *flags)
    assert (code, out) == (2, "")
    assert "CRC" in error


def test_the_exit_code_tells_of_defects_of_other_formats(tmp_path: Path) -> None:
    """No checksum is no defect; a last line that is cut, or a gap, is one."""
    rows = "".join(f"{t / 10:.1f},{t},2.00,3.00\n" for t in range(9))
    file = tmp_path / "a.csv"
    file.write_text(f"time (s),tip_x (mm),tip_y (mm),tip_z (mm)\n{rows}", "utf-8")
    code, out, _ = here("inspect", str(file))
    assert (code, "integrity not provable" in " ".join(out.split())) == (0, True)
    code, out, _ = here("inspect", _cut(file, 0.98), "--json")
    assert (code, json.loads(out)["defects"]) == (1, ["line 10, cut: its last number is '3'"])
    file.write_text(file.read_text("utf-8") + "9.0,9,2.00,3.00\n", "utf-8")
    code, out, _ = here("inspect", str(file), "--json")
    gap = "'markers': 1 gaps over 3 x the median step, longest 8.200000 s"
    assert (code, json.loads(out)["defects"]) == (1, [gap])
