"""`validate inspect`, `import`, `merge` and `record`."""

import json
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from validate.cli.display import console, progress, table
from validate.cli.main import pairs
from validate.errors import UsageError
from validate.parameters import with_values
from validate.recording.alignment import declared_offset, shift
from validate.recording.digest import digest, to_text
from validate.recording.mcap.read import read_recording
from validate.recording.mcap.write import write_recording
from validate.recording.merge import merge
from validate.recording.preflight import Inspection, Topic, inspect_recording
from validate.recording.readers import named, recognised
from validate.recording.types import Recording
from validate.replay.find import find
from validate.replay.remade import stamped


def inspect(file: Path, as_json: bool) -> None:
    """Prints what an MCAP file holds."""
    found = inspect_recording(file)
    if as_json:
        print(json.dumps(found.to_dict(), indent=2, allow_nan=False))
    else:
        _print(found)


def import_file(
    file: Path, kind: str | None, out: Path, mapping: tuple[str, ...], given: Mapping[str, Any]
) -> None:
    """Reads a foreign file, of the `kind` that it shows where none is said, as a recording."""
    reader = named(kind) if kind else recognised(file)
    said = {key: str(value) for key, value in given.items() if value is not None}
    recording = reader.read(file, pairs(mapping, "--map") | said)
    write_recording(recording, out)
    _report(recording, out)


def merge_files(files: tuple[Path, ...], out: Path, shifts: tuple[str, ...]) -> None:
    """Writes one recording with all streams, moved where the user says so."""
    merged = merge([read_recording(f) for f in files], out.stem)
    for topic, text in pairs(shifts, "--shift").items():
        merged = shift(merged, topic, declared_offset(merged, topic, *_seconds(topic, text)))
    write_recording(merged, out)
    _report(merged, out)


def _seconds(topic: str, text: str) -> tuple[float, float]:
    seconds, _, sd = text.partition(":")
    try:
        return float(seconds), float(sd or "nan")
    except ValueError:
        raise UsageError(f"--shift {topic}={text}: expected SECONDS or SECONDS:SD") from None


def record(name: str, out: Path, values: tuple[str, ...]) -> None:
    """Makes an experiment's twin recording, with a JSON beside it of what must be read."""
    experiment = find(name, Path.cwd())
    twin = experiment.twin
    if twin is None:
        raise UsageError(f"experiment '{name}' has no synthetic recording; its data are measured")
    parameters = with_values(experiment.parameters, pairs(values, "--set"))
    with progress(f"record {name}") as bar:
        done = iter(range(10))
        made = twin.record(parameters, lambda text: bar(next(done), 3, text))
    if twin.truth is not None:
        made = stamped(made, parameters)
    write_recording(made, out)
    written = read_recording(out)
    out.with_suffix(".json").write_text(to_text(digest(written)), "utf-8")
    _report(written, out)


def _report(recording: Recording, out: Path) -> None:
    size = out.stat().st_size / 1e3
    console().print(f"{out}: {', '.join(recording.streams)}; {size:.0f} kB", soft_wrap=True)


def _print(found: Inspection) -> None:
    screen = console()
    head = ["topic", "kind", "schema (encoding)", "n", "duration s", "rate Hz", "gaps", "unit"]
    rows = [_row(topic) for topic in found.topics]
    screen.print(table(found.source.path, [*head, "frame"], rows))
    screen.print(_head(found), soft_wrap=True)
    for line in found.clock_offsets:
        screen.print(line, soft_wrap=True)
    screen.print(f"defects: {len(found.defects)}")
    for defect in found.defects:
        screen.print(f"  {defect}", soft_wrap=True)


def _row(topic: Topic) -> list[str]:
    clock = topic.clock
    duration = "-" if clock is None else f"{clock.duration:.3f}"
    rate = "-" if clock is None or clock.rate_hz is None else f"{clock.rate_hz:.4g}"
    gaps = "-" if clock is None else str(clock.gaps)
    schema = f"{topic.schema or '-'} ({topic.schema_encoding or '-'}/{topic.message_encoding})"
    return [
        topic.name, topic.kind, schema, str(topic.count), duration, rate, gaps,
        topic.unit or "-", topic.frame or "-",
    ]  # fmt: skip


def _head(found: Inspection) -> str:
    start = [t.first_ns for t in found.topics if t.first_ns is not None]
    when = datetime.fromtimestamp(min(start) / 1e9, UTC).isoformat() if start else "-"
    return (
        f"\n{found.messages} messages from {when}; {found.attachments} attachments; metadata: "
        f"{', '.join(found.metadata) or 'none'}\n"
        f"{found.source.bytes} bytes in {found.chunks} chunks ({', '.join(found.compressions)}), "
        f"library '{found.library}', profile '{found.profile}'\n"
        f"integrity: {found.source.integrity}; sha256 {found.source.sha256}"
    )
