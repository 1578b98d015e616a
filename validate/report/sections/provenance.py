"""Provenance section: recordings, streams, clocks, parameters, environment."""

from collections.abc import Iterator

from validate.compare.exhibit import Entry, Exhibit, NumberTable, TableCell
from validate.compare.result import Result
from validate.numbers import text, with_unit
from validate.recording.motion_capture.text_rows import ASSUMED
from validate.recording.types import Recording
from validate.report.stored.environment import Made, environment, file_name, without_folder

_STREAMS = (
    "topic", "kind", "unit", "noise", "samples", "rate / Hz", "duration / s", "gaps",
    "longest gap / s", "duplicates",
)  # fmt: skip
_FEW = 12  # metadata entries that are shown unfolded


def recording(result: Result) -> Exhibit | None:
    """Files with hashes, streams with clocks, metadata records."""
    if not result.recordings:
        return None
    several = len(result.recordings) > 1
    files = tuple(
        (file_name(s.path), s.bytes, s.sha256 or "none", s.integrity)
        for s in (r.source for r in result.recordings)
    )
    streams = tuple(
        (s.recording, s.topic, s.kind, TableCell("yes" if s.used else "no", emphasis="strong"),
         s.why)
        for s in result.streams
    )  # fmt: skip
    title = "Every stream of the recordings, and whether this experiment uses it."
    tables = [
        NumberTable("", "Inputs.", ("file", "bytes", "SHA-256", "integrity"), files),
        NumberTable("streams", title, ("recording", "topic", "kind", "used", "why"), streams),
    ]
    tables += [_streams(r, several) for r in result.recordings]
    tables += [_assumed(r) for r in result.recordings if r.metadata.get(ASSUMED)]
    tables += [_metadata(r) for r in result.recordings if any(r.metadata.values())]
    unused = [s for s in result.streams if not s.used]
    words = tuple(f"Not used: {s.kind} '{s.topic}' of {s.recording}: {s.why}." for s in unused)
    return Exhibit("recording", "Recording", words, tuple(tables))


def _streams(record: Recording, several: bool) -> NumberTable:
    name = f" of {record.name}" if several else ""
    title = (
        f"Streams{name}. Noise: declared standard deviation; gaps: steps over three median steps."
    )
    rows: list[tuple[Entry | TableCell, ...]] = []
    for row in _kinds(record):
        clock = record.clock.get(str(row[0]))
        if clock is None:
            rows.append((*row, *(None,) * 5))
            continue
        lasts = TableCell(clock.duration, text=text(clock.duration, "1", 4))
        longest = TableCell(clock.longest_gap, "1")
        rate = TableCell(clock.rate_hz, "1")
        rows.append((*row, rate, lasts, clock.gaps, longest, clock.duplicates))
    return NumberTable("", title, _STREAMS, tuple(rows), folded=several)


def _kinds(record: Recording) -> Iterator[tuple[Entry, ...]]:
    """Topic, kind, unit as recorded, noise as shown, samples."""
    for k, s in record.signals.items():
        yield k, "signal", s.unit, with_unit(s.sd, s.unit, 2), str(len(s.t))
    for k, m in record.markers.items():
        yield k, "markers", "m", with_unit(m.sd, "m"), f"{len(m.t)} × {len(m.names)}"
    for k, c in record.contours.items():
        yield k, "outlines", "m", with_unit(c.sd, "m"), f"{len(c.t)} × {_points(c.outlines)}"
    for k, f in record.frames.items():
        yield k, "frames", "1", None, str(len(f.t))


def _points(outlines: tuple[object, ...]) -> str:
    sizes = sorted({len(o) for o in outlines})  # type: ignore[arg-type]
    return str(sizes[0]) if len(sizes) == 1 else f"{sizes[0]} to {sizes[-1]}"


def _metadata(record: Recording) -> NumberTable:
    rows = tuple(
        (name, key, str(without_folder(value)))
        for name, found in record.metadata.items()
        if name != ASSUMED
        for key, value in found.items()
    )
    title = f"Metadata records of {record.name}."
    return NumberTable("", title, ("record", "key", "value"), rows, folded=len(rows) > _FEW)


def _assumed(record: Recording) -> NumberTable:
    """What stands between the file as written and the recording; never folded."""
    rows = tuple(record.metadata[ASSUMED].items())
    title = f"Assumptions in reading {record.name}, with reasons."
    return NumberTable("", title, ("", "assumption and reason"), rows)


def parameters(result: Result) -> Exhibit:
    """Every parameter with the value used."""
    rows = tuple(
        (p.path, _plain(p.default), "" if p.unit == "1" else p.unit, p.origin, p.doc)
        for p in result.parameters
    )
    used = NumberTable(
        "", "Parameters as used, SI. Change one with --set path=value. Origin: recorded (in the "
            "recording), entered (the experiment's file or --set), default (the library's), "
        "identified.",
        ("path", "value", "unit", "origin", "meaning"), rows, folded=True,
    )  # fmt: skip
    seed = f"{result.seed}" if result.seed is not None else "none"
    around = tuple({"seed": seed, **environment()}.items())
    tables = (*((used,) if rows else ()), NumberTable("", "Environment.", ("", "value"), around))
    return Exhibit("parameters", "Parameters and environment", (), tables)


def how(result: Result, made: Made) -> Exhibit:
    """What differs from the declared parameters, the command, the commit, and the files' hashes."""
    rows = tuple(
        (c.path, _plain(c.default), _plain(c.value), "" if c.unit == "1" else c.unit)
        for c in result.changed
    )
    none = "" if rows else "None differs."
    differing = NumberTable(
        "", "Parameters that differ from the experiment's declared values, SI.",
        ("path", "declared", "here", "unit"), rows, none,
    )  # fmt: skip
    said = [("command", made.command or "none: made from Python")]
    unknown = "unknown: the code is not in a clone, or git does not answer"
    said += [("commit", str(made.commit) if made.commit else unknown)]
    said += [("code and libraries, SHA-256", made.code_sha256)]
    said += [("commit of the experiment's project", str(made.project))] if made.project else []
    said += [("plug-ins", ", ".join(made.plug_ins))] if made.plug_ins else []
    tables = [differing, NumberTable("", "Command and code.", ("", "value"), tuple(said))]
    if made.files:
        files = tuple((f.role, f.path, f.bytes, f.sha256) for f in made.files)
        head = ("what", "file", "bytes", "SHA-256")
        tables.append(NumberTable("", "Files read in addition to the recordings.", head, files))
    return Exhibit("made", "How this was made", (), tuple(tables))


def _plain(value: object) -> str:
    if isinstance(value, (list, tuple)):
        return ", ".join(_plain(v) for v in value)
    if value is None:
        return "not set"
    if isinstance(value, float):
        return f"{value:g}".replace("-", "−")
    return str(without_folder(value))
