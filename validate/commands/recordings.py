"""`validate import` and `validate merge`, and what a recording holds in a few lines."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from validate.commands.arguments import complain, pairs
from validate.commands.display import say
from validate.errors import UsageError
from validate.files import member, members
from validate.identify.budget import averaged, labels_of
from validate.places import try_file
from validate.recording.clocks.alignment import declared_offset
from validate.recording.images.image import AS_IT_IS
from validate.recording.mcap.read import recover
from validate.recording.mcap.write import write_recording
from validate.recording.merge import merge
from validate.recording.motion_capture.poses import require_chain
from validate.recording.motion_capture.text_rows import ASSUMED, LEFT_OUT, ZEROS
from validate.recording.readers import (
    READERS,
    known_unread,
    named,
    read_recording,
    recognised,
    recognises,
)
from validate.recording.scales import odd_scales
from validate.recording.tables.workbook import ALL, every_specimen
from validate.recording.types import Recording

_NAMED = 6  # streams or fields that are named one by one


def import_files(
    files: tuple[Path, ...],
    kind: str | None,
    out: Path,
    mapping: tuple[str, ...],
    specimens: str | None,
    given: Mapping[str, Any],
) -> None:
    """Read foreign files, of the `kind` that they show where none is said, as a recording; several
    are repeats of one test of a testing machine."""
    try_file(out)
    said = pairs(mapping, "--map") | {k: str(v) for k, v in given.items() if v is not None}
    # The files, or of a folder that is no format of its own those in it, in their order
    found = list(files)
    if len(files) == 1 and files[0].is_dir() and not kind:
        known = known_unread(files[0]) or any(recognises(r, files[0]) for r in READERS)
        found = found if known else [member(file) for file in members(files[0])] or found
    logs: list[Recording] = []
    for file in found:
        # A file as its reader makes it, all its specimens where that is said, and what decided
        reader = named(kind) if kind else recognised(file)
        every = said.get("specimen") == ALL
        read = every_specimen(reader, file, said) if every else [reader.read(file, said)]
        why = "as given by --as" if kind else f"because {reader.sign}"
        say(f"{file.name}: read as {reader.name} ({reader.doc}), {why}", indent="  ")
        for recording in read:
            _tell(recording)
        logs += read
    if len(logs) == 1 and specimens is None:
        recording = logs[0]
    else:
        recording = averaged(logs, labels_of(specimens, logs), out.stem)
        _tell(recording)
    require_chain(recording)
    write_recording(recording, out)
    written(recording, out)
    for line in _besides(recording):
        complain(line)
    ask_back(recording)


def _tell(recording: Recording) -> None:
    """What was assumed or taken as not seen, where a scale is from, how deep images became 8 bits,
    by which lens they are straight, what is told of a stream, and events, of which none is one."""
    for key, text in recording.metadata.get(ASSUMED, {}).items():
        say(f"{key}: {text}", indent="  ")
    made = recording.metadata.get("provenance", {})
    for key in (ASSUMED, ZEROS, "scale", "levels", "lens", "events", *recording.streams):
        if made.get(key, AS_IT_IS) != AS_IT_IS:
            say(f"{key}: {made[key]}", indent="  ")


def recover_file(
    files: tuple[Path, ...],
    kind: str | None,
    out: Path,
    mapping: tuple[str, ...],
    given: Mapping[str, Any],
) -> None:
    """Save what of an MCAP file without an end is whole, and says what is missing."""
    more = mapping or any(v is not None for v in given.values())
    if kind not in (None, "mcap") or more or len(files) > 1:
        raise UsageError("--recover copies messages unchanged: it takes only one FILE and -o")
    try_file(out)
    found = recover(files[0], out)
    for line in found.lines:
        say(line, indent="  ")
    topics = ", ".join(f"{topic} ({count})" for topic, count in found.counts.items())
    say(f"{out}: {topics}; {out.stat().st_size / 1e3:.0f} kB", indent="  ")


def _besides(recording: Recording) -> list[str]:
    """What of the file did not become a stream."""
    left = [r[LEFT_OUT] for r in recording.metadata.values() if r.get(LEFT_OUT)]
    unread = [f"{topic}: {why}" for topic, why in recording.unread.items()]
    if len(unread) > _NAMED:
        unread = [f"{len(unread)} fields; the first: {unread[0]}; `validate inspect` lists them"]
    return [f"not read: {text}" for text in (*left, *unread)]


def merge_files(files: tuple[Path, ...], out: Path, shifts: tuple[str, ...]) -> None:
    """Write one recording with all streams, moved where the user says so."""
    try_file(out)
    merged = merge([read_recording(f) for f in files], out.stem)
    require_chain(merged)
    for topic, text in pairs(shifts, "--shift").items():
        seconds, _, sd = text.partition(":")
        try:
            by = float(seconds), float(sd or "nan")
        except ValueError:
            raise UsageError(f"--shift {topic}={text}: expected SECONDS or SECONDS:SD") from None
        merged = declared_offset(merged, topic, *by).shift(merged, topic)
    write_recording(merged, out)
    written(merged, out)
    if not shifts and len(files) > 1:
        complain(
            "all files are assumed to share one clock. If each recorder had its own clock, "
            "`validate align` measures the offset; --shift TOPIC=SECONDS sets a known one"
        )
    ask_back(merged)


def ask_back(recording: Recording) -> None:
    """A line on standard error for every scale of images or outlines that is beyond reason."""
    for line in odd_scales(recording):
        complain(line)


def written(recording: Recording, out: Path) -> None:
    """Says which streams a file got and how large it is."""
    size = out.stat().st_size / 1e3
    names = list(recording.streams)
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    say(f"{out}: {', '.join(names[:_NAMED])}{more}; {size:.0f} kB", indent="  ")


# --- summary of a recording as comment lines of a Python file ------------------------------------

_MOST = 7  # lines of what the recording holds: the file stays short
_LONGEST = 76  # characters of a text of the recording in a comment


def topics(recording: Recording) -> list[str]:
    return list(recording.streams)


def channels(recording: Recording) -> list[str]:
    lines = []
    for topic, s in recording.signals.items():
        lines.append(_line(topic, f"signal in {s.unit}, sd {s.sd:.3g}", s.t))
    for topic, m in recording.markers.items():
        lines.append(_line(topic, f"{len(m.names)} markers in m, sd {m.sd:.3g}", m.t))
    for topic, c in recording.contours.items():
        lines.append(_line(topic, f"outlines in m, sd {c.sd:.3g}", c.t))
    for topic, f in recording.frames.items():
        lines.append(_line(topic, f"images, {f.m_per_px[0]:.3g} m per pixel", f.t))
    for record, values in recording.metadata.items():
        lines.append(plain(f"record '{record}', {len(values)} entries"))
        lines += [plain(f"  {key}: {value}") for key, value in list(values.items())[:8]]
    more = len(lines) - _MOST
    said = [f"... and {more + 1} more lines: `validate inspect`"] if more > 0 else []
    return lines[: _MOST - len(said)] + said


def _line(topic: str, what: str, t: np.ndarray) -> str:
    duration = float(t[-1] - t[0])
    rate = f"{(len(t) - 1) / duration:.4g} Hz" if duration > 0 else "one instant"
    return plain(f"{topic}: {what}; {len(t)} in {duration:.4g} s, {rate}")


def plain(text: str) -> str:
    """On one line, printable, of bounded length, and without what ends a comment or docstring."""
    line = "".join(c if c.isprintable() else " " for c in text)
    indent = line[: len(line) - len(line.lstrip())]
    short = indent + " ".join(line.split())
    return short if len(short) <= _LONGEST else short[: _LONGEST - 3] + "..."


def beside(source: Path, path: Path) -> str:
    """Return a file's path from the folder of the experiment's file."""
    return Path(os.path.relpath(source.resolve(), path.resolve().parent)).as_posix()
