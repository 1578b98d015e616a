"""`validate inspect`: content of a recording and summary of its motion."""

import json
from collections.abc import Sequence
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path

from validate.commands.arguments import FAILED, OK, Detail, pairs
from validate.commands.screen import Passage, rows, sentences, show
from validate.errors import ValidateError
from validate.recording.mcap.decoders import messages_in
from validate.recording.preflight import Inspection, Topic, inspect_file
from validate.recording.readers import named, recognised
from validate.report.sections.motion_words import motion_lines

_UNREAD = "not read: "  # before the reason, in a topic's kind


def inspect(
    file: Path, as_json: bool, kind: str | None, mapping: tuple[str, ...],
    detail: Detail = "screen",
) -> int:  # fmt: skip
    """Print what a file of any format holds; return 1 where it has a defect, else 0."""
    options = pairs(mapping, "--map")
    found = inspect_file(file, kind, options)
    motion: tuple[str, ...] = ()
    with suppress(ValidateError):  # not readable as a recording: `found` says so
        reader = named(kind) if kind else recognised(file)
        motion = motion_lines(reader.read(file, options))
    if as_json:
        document = {**found.to_dict(), "motion": motion}
        print(json.dumps(document, ensure_ascii=False, indent=2, allow_nan=False))
    else:
        show(_passages(found, motion, detail), detail)
    return FAILED if found.defects else OK


def messages(file: Path, topic: str, most: int, as_json: bool) -> None:
    """Print messages of a topic of an MCAP file, decoded, a line each or as one document."""
    found = list(messages_in(file, topic, most))
    if as_json:
        print(json.dumps(found, ensure_ascii=False, indent=2, allow_nan=False))
        return
    for one in found:
        print(json.dumps(one, ensure_ascii=False, allow_nan=False))


def _passages(found: Inspection, motion: Sequence[str], detail: Detail) -> list[Passage]:
    """Defects first, then streams, fields that are not read, motion, clocks and the file."""
    streams = [t for t in found.topics if not t.kind.startswith(_UNREAD)]
    unread = [f"{t.name}: {t.kind}" for t in found.topics if t.kind.startswith(_UNREAD)]
    full = detail == "full"
    if len(unread) > 1 and not full:
        unread = [f"{len(unread)} fields are not read; the first: {unread[0]}"]
    defects = len(found.defects)
    counted = f"{defects or 'no'} defect{'' if defects == 1 else 's'}"
    names = f"{len(streams)} stream{'' if len(streams) == 1 else 's'}"
    head = ["", "kind", "n", "duration / s", "rate / Hz", "gaps", "unit", "frame"]
    facts = [*found.clock_offsets, *(found.facts if found.read_as == "mcap" else ())]
    source = found.source
    if found.chunks or found.read_as == "mcap":
        start = [t.first_ns for t in found.topics if t.first_ns is not None]
        when = datetime.fromtimestamp(min(start) / 1e9, UTC).isoformat() if start else "-"
        file = (
            f"{found.messages} messages from {when}; {found.attachments} attachments; metadata: "
            f"{', '.join(found.metadata) or 'none'}\n"
            f"{source.bytes} bytes in {found.chunks} chunks ({', '.join(found.compressions)}), "
            f"library '{found.library}', profile '{found.profile}'\n"
            f"integrity: {source.integrity}; sha256 {source.sha256}"
        )
    else:
        size, sums = "", ""
        if source.sha256:
            size, sums = f"{source.bytes} bytes; ", f"; sha256 {source.sha256}"
        told = "".join(f"{line}\n" for line in found.facts)
        file = f"read as {found.read_as}\n{told}{size}integrity: {source.integrity}{sums}"
    return [
        sentences([f"{source.path}: {names}, {counted}."], None),
        sentences((f"defect: {d}" for d in found.defects), keep=4, most=8),
        Passage("Streams", rows(head, [_row(t)[:-1] for t in streams]), 4, 12),
        sentences(unread, keep=2),
        sentences(motion, keep=3),
        sentences(facts, keep=1),
        sentences(file.strip().splitlines(), keep=3),
        Passage("Schemas", rows(["", "schema (encoding)"], [[t.name, _row(t)[-1]] for t in streams])
              if full else ()),
    ]  # fmt: skip


def _row(topic: Topic) -> list[str]:
    clock = topic.clock
    duration = "-" if clock is None else f"{clock.duration:.3f}"
    rate = "-" if clock is None or clock.rate_hz is None else f"{clock.rate_hz:.4g}"
    gaps = "-" if clock is None else str(clock.gaps)
    encoding = f"({topic.schema_encoding or '-'}/{topic.message_encoding})"
    schema = f"{topic.schema or '-'} {encoding}" if topic.message_encoding else "-"
    return [
        topic.name, topic.kind, str(topic.count), duration, rate, gaps, topic.unit or "-",
        topic.frame or "-", schema,
    ]  # fmt: skip
