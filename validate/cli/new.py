"""`validate new`: an experiment file filled with what a recording holds.

Texts of the recording are data: they enter the file as Python literals or in comments without line
ends, never as code.
"""

import os
import re
import sys
from pathlib import Path
from string import Template

import numpy as np

from validate.cli.arguments import complain
from validate.cli.display import say
from validate.cli.recordings import ask_back
from validate.errors import UsageError
from validate.identify.modulus import require_compression
from validate.places import try_folder, write_whole
from validate.recording.readers import read_recording
from validate.recording.types import Recording, Signal
from validate.replay.compression import stated_sizes

TEMPLATES = {"force": "new_force.py.txt", "inclusion": "new_inclusion.py.txt"}
_MOST_CHANNELS = 7  # lines of what the recording holds: the file stays short
_LARGEST = 20_000  # bytes of such a file
_LONGEST = 76  # characters of a text of the recording in a comment


def new(name: str, source: Path, out: Path | None) -> None:
    """Writes `out` (default experiments/NAME.py); refuses names that no module may have."""
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or name in {*sys.stdlib_module_names, "validate"}:
        raise UsageError(f"experiment '{name}': a name of a-z, 0-9, _ that no Python module has")
    path = out or Path("experiments") / f"{name}.py"
    if path.name != f"{name}.py":
        raise UsageError(f"-o {path}: an experiment's file is called as it is, {name}.py")
    if path.exists():
        raise UsageError(f"{path} exists and is left alone; give another NAME or -o")
    try_folder(path, _LARGEST)
    recording = read_recording(source)
    ask_back(recording)
    text = written(name, recording, _beside(source, path))
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, text)
    for topic in _unused(recording):
        complain(f"'{topic}' is not used by the experiment that was written")
    say(f"{path}: edit it, then `validate run {_called(name, path)}`", indent="  ")


def written(name: str, recording: Recording, source: str) -> str:
    """The experiment file's text; `source` is the recording's path from the file's folder."""
    kind = _kind(recording)
    fields = _force(recording) if kind == "force" else _block(recording)
    template = Template((Path(__file__).parent / TEMPLATES[kind]).read_text("utf-8"))
    title = f"{_plain(recording.name)}: measured against linear FEM"
    return template.substitute(
        fields,
        name=repr(name),
        title=title.replace("\\", "/").replace('"', "'"),
        title_text=repr(title),
        source=_plain(Path(source).name).replace("\\", "/").replace('"', "'"),
        source_text=repr(_plain(Path(source).name)),
        recording=repr(source),
        channels="\n".join(f"#   {line}".rstrip() for line in _channels(recording)),
    )


def _kind(recording: Recording) -> str:
    units = {topic: s.unit for topic, s in recording.signals.items()}
    if units.get("displacement") == "m" and units.get("force") == "N":
        require_compression(recording)
        return "force"
    known = {"marker_layout", "inclusion"} <= recording.metadata.keys()
    if recording.contours and recording.markers and "m" in units.values() and known:
        return "inclusion"
    raise UsageError(
        f"{recording.name} holds {_topics(recording)} and records {sorted(recording.metadata)}; "
        "an experiment is written from signals 'displacement' (m) and 'force' (N), or from "
        "outlines, a stage (m) and markers with records 'inclusion' and 'marker_layout'"
    )


def _unused(recording: Recording) -> list[str]:
    """Topics that the written experiment looks at in nothing; images give outlines."""
    if _kind(recording) == "force":
        used = {"displacement", "force"}
    else:
        outline, contours = next(iter(recording.contours.items()))
        used = {outline, contours.images, next(iter(recording.markers)), _stage(recording)[0]}
        used |= set(_scalars(recording))
    return [topic for topic in _topics(recording) if topic not in used]


def _topics(recording: Recording) -> list[str]:
    streams = (recording.signals, recording.markers, recording.contours, recording.frames)
    return [topic for kind in streams for topic in kind]


# --- what the recording says ---------------------------------------------------------------------


def _channels(recording: Recording) -> list[str]:
    lines = []
    for topic, s in recording.signals.items():
        lines.append(_line(topic, f"signal in {s.unit}, sd {s.sd:.3g}", s.t))
    for topic, m in recording.markers.items():
        lines.append(_line(topic, f"{len(m.names)} markers in m, sd {m.sd:.3g}", m.t))
    for topic, c in recording.contours.items():
        lines.append(_line(topic, f"outlines in m, sd {c.sd:.3g}", c.t))
    for topic, f in recording.frames.items():
        lines.append(_line(topic, f"images, {f.m_per_px[0]:.3g} m a pixel", f.t))
    for record, values in recording.metadata.items():
        lines.append(_plain(f"record '{record}', {len(values)} entries"))
        lines += [_plain(f"  {key}: {value}") for key, value in list(values.items())[:8]]
    more = len(lines) - _MOST_CHANNELS
    said = [f"... and {more + 1} more lines: `validate inspect`"] if more > 0 else []
    return lines[: _MOST_CHANNELS - len(said)] + said


def _line(topic: str, what: str, t: np.ndarray) -> str:
    duration = float(t[-1] - t[0])
    rate = f"{(len(t) - 1) / duration:.4g} Hz" if duration > 0 else "one moment"
    return _plain(f"{topic}: {what}; {len(t)} in {duration:.4g} s, {rate}")


def _plain(text: str) -> str:
    """On one line, printable, of bounded length, and without what ends a comment or docstring."""
    line = "".join(c if c.isprintable() else " " for c in text)
    indent = line[: len(line) - len(line.lstrip())]
    short = indent + " ".join(line.split())
    return short if len(short) <= _LONGEST else short[: _LONGEST - 3] + "..."


def _force(recording: Recording) -> dict[str, str]:
    stated = stated_sizes(recording)
    height = stated.get("specimen.height")
    moved = recording.signal("displacement", "m").y[:, 0]
    force = recording.signal("force", "N").y[:, 0]
    limit, inside, judged = 0.10, np.full(len(force), True), "the largest force recorded"
    if height is not None:
        limit = min(limit, 0.9 * float(np.ptp(moved)) / height)
        inside = np.abs(moved - moved[0]) <= limit * height
        judged = "the force at the strain limit"
    by_area = "diameter_m" not in recording.metadata.get("specimen", {})
    return {
        "diameter": _size(stated.get("specimen.diameter"), by_area=by_area),
        "height": _size(height),
        "fit_from": f"{0.05 * limit:.3g}",
        "fit_to": f"{0.5 * limit:.3g}",
        "limit": f"{limit:.3g}",
        "accept": f"{0.1 * float(np.ptp(force[inside])):.3g}",
        "judged": judged,
    }


def _size(stated: float | None, *, by_area: bool = False) -> str:
    """A value and its comment; what the recording does not say is left open."""
    if stated is None:
        return "None,  # m, not in the recording: measure it, write it here"
    return f"{stated:.6g},  # m, recorded: " + (
        "of the header's area" if by_area else "in the header"
    )


def _block(recording: Recording) -> dict[str, str]:
    outline, contours = next(iter(recording.contours.items()))
    topic = next(iter(recording.markers))
    layout = recording.record("marker_layout")
    stage_topic, stage = _stage(recording)
    places = np.array([[float(x) for x in v.split()] for v in layout.values()])
    reached = np.interp(contours.t, stage.t, stage.y[:, 0])
    loads = tuple(sorted({round(float(x), 4) for x in reached if abs(x) > 1e-4}))
    tracker = next((k for k, record in recording.metadata.items() if "up" in record), "pen")
    named = {"stage": stage_topic, "outline": outline, "markers": topic, "tracker": tracker}
    streams = [f"{key}={value!r}" for key, value in named.items() if key != value]
    streams.append(f"signals={_scalars(recording)!r}")
    return {
        "highest": f"{float(places[:, 1].max()):.6g}",
        "side_x": f"{_side(places[:, 0]):.6g}",
        "side_z": f"{_side(places[:, 2]):.6g}",
        "loads": repr(loads),
        "streams": ", ".join(streams),
    }


def _stage(recording: Recording) -> tuple[str, Signal]:
    lengths = {t: s for t, s in recording.signals.items() if s.unit == "m"}
    topic = "stage" if "stage" in lengths else next(iter(lengths))
    return topic, lengths[topic]


def _side(x: np.ndarray) -> float:
    """A block whose margins on both sides are alike, to 5 mm."""
    return round(float(x.min() + x.max()) / 5e-3) * 5e-3


def _scalars(recording: Recording) -> tuple[str, ...]:
    """Topics of the first force and the first pressure."""
    found = {s.unit: topic for topic, s in reversed(list(recording.signals.items()))}
    return tuple(found[unit] for unit in ("N", "Pa") if unit in found)


def _beside(source: Path, path: Path) -> str:
    """The recording's path from the experiment's folder."""
    return Path(os.path.relpath(source.resolve(), path.resolve().parent)).as_posix()


def _called(name: str, path: Path) -> str:
    return name if path.resolve().parent == Path("experiments").resolve() else str(path)
