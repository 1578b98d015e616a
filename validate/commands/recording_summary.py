"""Summary of a recording as comment lines of a Python file."""

import os
from pathlib import Path

import numpy as np

from validate.recording.types import Recording

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
