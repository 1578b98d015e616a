"""A file whose writer was ended: what is whole is said, and saved bit for bit."""

import io
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from command_line import here, refused
from mcap.reader import NonSeekingReader
from mcap_samples import T0, markers_json, signal_json, write_foreign

from validate.errors import RecordingError, UsageError
from validate.recording.mcap import read as module
from validate.recording.mcap.read import read_recording, recover
from validate.recording.preflight import Inspection

# private: _copy: called alone, case by case.

MS = 1_000_000
CUTS = 50


def _file(path: Path, **options: Any) -> bytes:
    messages: list[tuple[str, str, int, Any]] = []
    for i in range(30):
        at = T0 + i * MS
        messages.append(("/s", "validate.Signal", at, signal_json(at, values=[0.1 * i])))
        messages.append(("/m", "validate.Markers", at, markers_json(at)))
    return write_foreign(path, messages, enable_data_crcs=True, **options).read_bytes()


LAYOUTS: list[dict[str, Any]] = [{"chunk_size": 1000}, {"use_chunking": False}]


def _messages(path: Path) -> list[tuple[str, int, int, int, bytes]]:
    """By the reader of others, every CRC checked."""
    with path.open("rb") as stream:
        reader = NonSeekingReader(stream, validate_crcs=True)
        return [
            (c.topic, m.sequence, m.log_time, m.publish_time, m.data)
            for _, c, m in reader.iter_messages(log_time_order=False)
        ]


@pytest.mark.parametrize("options", LAYOUTS, ids=["chunks", "no chunks"])
def test_what_is_recovered_is_a_prefix_bit_for_bit(tmp_path: Path, options: dict[str, Any]) -> None:
    data, out = _file(tmp_path / "whole.mcap", **options), tmp_path / "out.mcap"
    every, found = _messages(tmp_path / "whole.mcap"), []
    for length in np.linspace(1, len(data) - 1, CUTS).astype(int).tolist():
        cut = tmp_path / "cut.mcap"
        cut.write_bytes(data[:length])
        try:
            lines = recover(cut, out).lines
        except RecordingError:
            found.append(0)
            continue
        kept = _messages(out)
        count = len(kept)
        assert kept == every[:count]
        seen, saved = Inspection.of(cut), Inspection.of(out)
        assert seen.messages == saved.messages == count
        assert f"{count} messages; the writer was stopped" in seen.defects[0]
        assert saved.source.integrity == "verified"
        assert all(line.endswith("no messages") for line in saved.defects)
        whole = int(lines[1].split("the first ")[1].split(" of ")[0])
        assert out.read_bytes()[:whole] == data[:whole]
        found.append(count)
    assert found == sorted(found)
    assert (found[0], found[-1]) == (0, len(every))
    assert len(set(found)) > 8


def _cut(folder: Path) -> Path:
    """The first half of a file of chunks."""
    data = _file(folder / "whole.mcap", chunk_size=1000)
    path = folder / "cut.mcap"
    path.write_bytes(data[: len(data) // 2])
    return path


def test_what_is_missing_is_told(tmp_path: Path) -> None:
    path = _cut(tmp_path)
    found = recover(path, tmp_path / "out.mcap")
    saved = _messages(tmp_path / "out.mcap")
    assert sum(found.counts.values()) == len(saved) < 60
    last = (saved[-1][2] - T0) / 1e9
    assert (
        f"{len(saved)} messages, {last:.6f} s from {T0} ns to {saved[-1][2]} ns" in found.lines[1]
    )
    assert "of a cut record at byte" in found.lines[2]
    assert "how many messages followed is not known" in found.lines[2]
    kept = read_recording(tmp_path / "out.mcap")
    assert len(kept.signals["/s"].t) == found.counts["/s"]
    assert [f"{k}: {v}" for k, v in kept.record("validate.recovered").items()] == [*found.lines]


def test_a_cut_summary_misses_no_message(tmp_path: Path) -> None:
    data = _file(tmp_path / "whole.mcap", chunk_size=1000)
    path = tmp_path / "cut.mcap"
    path.write_bytes(data[:-4])
    assert "only the summary is truncated" in recover(path, tmp_path / "out.mcap").lines[2]
    assert _messages(tmp_path / "out.mcap") == _messages(tmp_path / "whole.mcap")
    assert Inspection.of(path).defects[0].startswith("no end of the file, behind its data,")


def test_only_a_file_that_stops_short_is_recovered(tmp_path: Path) -> None:
    data, out = _file(tmp_path / "whole.mcap", chunk_size=1000), tmp_path / "out.mcap"
    with pytest.raises(UsageError, match="the file is complete"):
        recover(tmp_path / "whole.mcap", out)
    cut = _cut(tmp_path)
    with pytest.raises(UsageError, match="is the file to recover"):
        recover(cut, cut)
    flipped = bytearray(cut.read_bytes())
    flipped[len(flipped) // 4] ^= 1
    cut.write_bytes(flipped)
    for use in (lambda: recover(cut, out), lambda: Inspection.of(cut)):
        with pytest.raises(RecordingError, match="readable before it"):
            use()
    half = len(data) // 2
    cut.write_bytes(data[:half] + data[half + 40 :])  # a hole, not an end
    with pytest.raises(RecordingError):
        recover(cut, out)
    assert not out.exists()


def test_the_command_saves_and_a_run_still_refuses(tmp_path: Path) -> None:
    path, out = _cut(tmp_path), tmp_path / "out.mcap"
    with pytest.raises(RecordingError, match=r"--recover -o X\.mcap"):
        read_recording(path)
    assert "readable before it" in refused("import", str(path), "-o", str(out))
    assert not out.exists()
    code, said, _ = here("import", str(path), "--recover", "-o", str(out))
    assert code == 0
    assert "missing:" in said
    assert read_recording(out).signals["/s"].y[0, 0] == 0.0
    wrong = refused("import", str(path), "--recover", "-o", str(out), "--force", "--rate", "5")
    assert "only one FILE and -o" in wrong


def test_a_file_that_shrinks_while_it_is_copied_is_refused() -> None:
    cut = SimpleNamespace(data=100, crc=0)
    with pytest.raises(RecordingError, match=r"became shorter while.*60"):
        module._copy(io.BytesIO(bytes(40)), io.BytesIO(), cut, b"")
