"""Contract of a reader: a checked recording, or a one-line error that names the file."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from validate.recording.mcap.read import read_recording
from validate.recording.mcap.write import write_recording
from validate.recording.motion_capture.text_rows import LEFT_OUT
from validate.recording.reader import Options, Reader, digest
from validate.recording.types import Recording
from validate.testing.pulled_cube import refusal, require

_CUT = 3  # bytes cut off an end: a record, a number and a chunk are incomplete without them


@dataclass(frozen=True)
class ReaderSample:
    """A reader with a file that it reads: `make` writes it to a path, `options` hold what it does
    not say.

    `linewise`: of a truncated file the complete lines are read, and the rest is reported.
    """

    reader: Reader
    make: Callable[[Path], None]
    options: Options = field(default_factory=dict)
    linewise: bool = False

    def made(self, folder: Path) -> Path:
        """Write the file into a folder and return its path."""
        path = folder / "sample"
        self.make(path)
        return path

    def refused(self, path: Path, options: Mapping[str, str] | None = None) -> str:
        """Return the one line with which the reader refuses a path."""
        given = self.options if options is None else options
        return refusal(lambda: self.reader.read(path, given))


def gives_a_recording_that_can_be_written(sample: ReaderSample, folder: Path) -> None:
    """Streams with a clock from 0 s; written to MCAP and read again they are the same."""
    path = sample.made(folder)
    got = sample.reader.read(path, sample.options)
    require(isinstance(got, Recording), f"{type(got).__name__}: expected a Recording")
    require(got.streams, "a recording without streams")
    without = got.streams.keys() ^ got.clock.keys()
    require(not without, f"streams without a clock, or clocks without a stream: {sorted(without)}")
    first = min(stream.t[0] for stream in got.streams.values())
    require(first == 0, f"the first sample is at {first:g} s: expected 0")
    require(got.source.path == path.name, f"source '{got.source.path}': expected the file's name")
    require(got.source.integrity, "the source does not say what its bytes prove")
    write_recording(got, folder / "again.mcap")
    same = digest(read_recording(folder / "again.mcap")) == digest(got)
    require(same, "written to MCAP and read again the recording differs")


def recognises_its_files_only(sample: ReaderSample, folder: Path) -> None:
    """Its file, whatever its name; no absent path, and no folder in place of a file."""
    path = sample.made(folder)
    require(sample.reader.recognises(path), "its own file is not recognised")
    require(not sample.reader.recognises(folder / "absent"), "an absent file is recognised")
    other = _other_kind(path, folder)
    require(not sample.reader.recognises(other), "a folder in place of a file is recognised")


def specifies_itself(sample: ReaderSample, folder: Path) -> None:
    """Name, description, signature and options in words; extensions with a dot."""
    reader = sample.reader
    require(reader.name and reader.doc and reader.sign, "name, doc and sign must not be empty")
    odd = [extension for extension in reader.extensions if not extension.startswith(".")]
    require(not odd, f"extensions {odd}: expected a dot first")
    silent = [option.name for option in reader.options if not option.doc]
    require(not silent, f"options without a description: {silent}")


def refuses_an_absent_file_and_another_kind(sample: ReaderSample, folder: Path) -> None:
    """One line with the name of what was given."""
    path = sample.made(folder)
    absent = sample.refused(folder / "absent")
    require("absent" in absent, f"the error does not name the file: {absent}")
    other = sample.refused(_other_kind(path, folder))
    require("other" in other, f"the error does not name the file: {other}")


def refuses_an_unknown_option(sample: ReaderSample, folder: Path) -> None:
    """One line with the key."""
    line = sample.refused(sample.made(folder), {**sample.options, "frobnicate": ""})
    require("--map frobnicate=...: no such key" in line, f"the error does not name the key: {line}")


def refuses_an_empty_file(sample: ReaderSample, folder: Path) -> None:
    """One line with its name."""
    _refuses(sample, folder, lambda whole: b"")


def refuses_random_bytes(sample: ReaderSample, folder: Path) -> None:
    """One line with the file's name; the bytes are those of a fixed seed."""
    _refuses(sample, folder, lambda whole: np.random.default_rng(len(whole)).bytes(len(whole)))


def refuses_a_truncated_file(sample: ReaderSample, folder: Path) -> None:
    """One line with its name; or, `linewise`, the complete lines and a report of the rest."""
    if not sample.linewise:
        _refuses(sample, folder, lambda whole: whole[:-_CUT])
        return
    path = sample.made(folder)
    path.write_bytes(path.read_bytes()[:-_CUT])
    left_out = sample.reader.read(path, sample.options).metadata["provenance"].get(LEFT_OUT, "")
    require("cut" in left_out, "the line that is cut is not reported")


def _refuses(sample: ReaderSample, folder: Path, damage: Callable[[bytes], bytes]) -> None:
    path = sample.made(folder)
    for file in sorted(path.iterdir()) if path.is_dir() else [path]:
        whole = file.read_bytes()
        file.write_bytes(damage(whole))
        line = sample.refused(path)
        require(file.name in line, f"the error does not name the file: {line}")
        file.write_bytes(whole)


def _other_kind(path: Path, folder: Path) -> Path:
    """A folder in place of a file, or a file in place of a folder."""
    other = folder / "other"
    if path.is_dir():
        other.write_bytes(b"a file")
    else:
        other.mkdir(exist_ok=True)
    return other


#: Checks of (sample, an empty folder).
reader_contract: tuple[Callable[[ReaderSample, Path], None], ...] = (
    gives_a_recording_that_can_be_written,
    recognises_its_files_only,
    specifies_itself,
    refuses_an_absent_file_and_another_kind,
    refuses_an_unknown_option,
    refuses_an_empty_file,
    refuses_a_truncated_file,
    refuses_random_bytes,
)
