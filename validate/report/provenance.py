"""Where the numbers come from: recordings, their streams and clocks, parameters, environment."""

from collections.abc import Mapping

from validate.compare.result import Result
from validate.recording.types import Recording
from validate.report.environment import environment, file_name, without_folder
from validate.report.numbers import text, with_unit
from validate.report.page import Cell, Section, Table, cells, section


def recording(result: Result) -> Section | None:
    """Files with hashes, streams with clocks, metadata records."""
    if not result.recordings:
        return None
    return section(
        "recording",
        "Recording",
        _files(result.recordings),
        *(_streams(r, len(result.recordings) > 1) for r in result.recordings),
        *(t for r in result.recordings if (t := _metadata(r)) is not None),
    )


def _files(recordings: tuple[Recording, ...]) -> Table:
    rows = tuple(
        cells(
            file_name(r.source.path),
            text(r.source.bytes),
            r.source.sha256 or "none",
            r.source.integrity,
        )
        for r in recordings
    )
    return Table("Inputs.", ("file", "bytes", "SHA-256", "integrity"), rows, words=(0, 2, 3))


def _streams(record: Recording, several: bool) -> Table:
    rows = []
    for kind, found in _kinds(record).items():
        for topic, (unit, sd, count) in found.items():
            rows.append((*cells(topic, kind, unit, sd, count), *_clock(record, topic)))
    name = f" of {record.name}" if several else ""
    return Table(
        f"Streams{name}. Noise: declared standard deviation; gaps: steps over three median steps.",
        ("topic", "kind", "unit", "noise", "samples", "rate / Hz", "duration / s", "gaps",
         "longest gap / s", "duplicates"),
        tuple(rows),
        words=(0, 1, 2),
        folded=several,
    )  # fmt: skip


def _kinds(record: Recording) -> dict[str, dict[str, tuple[str, str, str]]]:
    """Unit as recorded, noise as shown, samples, by kind and topic."""
    return {
        "signal": {
            k: (s.unit, with_unit(s.sd, s.unit, 2), str(len(s.t)))
            for k, s in record.signals.items()
        },
        "markers": {
            k: ("m", with_unit(m.sd, "m"), f"{len(m.t)} × {len(m.names)}")
            for k, m in record.markers.items()
        },
        "outlines": {
            k: ("m", with_unit(c.sd, "m"), f"{len(c.t)} × {_points(c.outlines)}")
            for k, c in record.contours.items()
        },
        "frames": {k: ("1", "–", str(len(f.t))) for k, f in record.frames.items()},
    }


def _points(outlines: tuple[object, ...]) -> str:
    sizes = sorted({len(o) for o in outlines})  # type: ignore[arg-type]
    return str(sizes[0]) if len(sizes) == 1 else f"{sizes[0]} to {sizes[-1]}"


def _clock(record: Recording, topic: str) -> tuple[Cell, ...]:
    clock = record.clock.get(topic)
    if clock is None:
        return cells(*["–"] * 5)
    return cells(
        text(clock.rate_hz),
        text(clock.duration, "1", 4),
        str(clock.gaps),
        text(clock.longest_gap),
        str(clock.duplicates),
    )


def _metadata(record: Recording) -> Table | None:
    rows = tuple(
        cells(name, key, str(without_folder(value)))
        for name, found in record.metadata.items()
        for key, value in found.items()
    )
    if not rows:
        return None
    return Table(
        f"Metadata records of {record.name}.",
        ("record", "key", "value"),
        rows,
        words=(0, 1, 2),
        folded=len(rows) > 12,
    )


def parameters(result: Result) -> Section | None:
    """Every parameter with the value used."""
    rows = tuple(
        cells(p.path, _plain(p.default), "" if p.unit == "1" else p.unit, p.doc)
        for p in result.parameters
    )
    table = Table(
        "Parameters as used, SI. Change one with --set path=value.",
        ("path", "value", "unit", "meaning"),
        rows,
        words=(0, 2, 3),
        folded=True,
    )
    seed = f"{result.seed}" if result.seed is not None else "none"
    extra = {"seed": seed, **environment()}
    return section(
        "parameters", "Parameters and environment", table if rows else None, _pairs(extra)
    )


def _pairs(values: Mapping[str, str]) -> Table:
    rows = tuple(cells(k, v) for k, v in values.items())
    return Table("Environment.", ("", "value"), rows, words=(0, 1))


def _plain(value: object) -> str:
    if isinstance(value, (list, tuple)):
        return ", ".join(_plain(v) for v in value)
    if isinstance(value, float):
        return f"{value:g}".replace("-", "−")
    return str(without_folder(value))
