"""Streams of several recordings in one."""

from collections import Counter
from collections.abc import Mapping, Sequence

from validate.errors import RecordingError
from validate.recording.alignment import moved
from validate.recording.types import Record, Recording, Source, by_kind

PROVENANCE = "provenance"


def merge(recordings: Sequence[Recording], name: str) -> Recording:
    """All streams of all recordings, each at its own moments of the clock; t = 0 is the earliest.

    Records that differ under one name are kept as `<name>/<recording>`. Raises `RecordingError` for
    fewer than two recordings and for topics that occur twice. Clocks are taken as they are: move a
    stream with `alignment.shift`.
    """
    if len(recordings) < 2:
        raise RecordingError(f"{len(recordings)} recordings to merge; give at least 2")
    counts = Counter(topic for r in recordings for topic in r.streams)
    twice = sorted(topic for topic, n in counts.items() if n > 1)
    if twice:
        raise RecordingError(f"topics {twice} occur in several recordings; rename them first")
    start = min(r.t0_ns for r in recordings)
    parts = [moved(r, (r.t0_ns - start) / 1e9) for r in recordings]
    return Recording(
        name=name,
        source=Source(" + ".join(r.source.path for r in recordings), "", 0, "merged"),
        t0_ns=start,
        **by_kind({k: s for r in parts for k, s in r.streams.items()}),
        clock={k: c for r in parts for k, c in r.clock.items()},
        unread={k: why for r in parts for k, why in r.unread.items()},
        metadata={**_records(recordings), "merged": _origins(recordings)},
    )


def _records(recordings: Sequence[Recording]) -> dict[str, Record]:
    values: dict[str, list[tuple[str, Record]]] = {}
    for recording in recordings:
        for name, record in recording.metadata.items():
            values.setdefault(name, []).append((recording.name, record))
    found: dict[str, Record] = {}
    for name, given in values.items():
        alike = all(dict(record) == dict(given[0][1]) for _, record in given)
        for i, (origin, record) in enumerate(given):
            single = alike and name != PROVENANCE
            key = name if single else f"{name}/{origin}"
            found[key if key not in found or single else f"{key}#{i + 1}"] = record
    return found


def _origins(recordings: Sequence[Recording]) -> Mapping[str, str]:
    return {
        f"{i + 1}": f"{r.name}: {', '.join(r.streams)}; {r.source.path} sha256 {r.source.sha256}"
        for i, r in enumerate(recordings)
    }
