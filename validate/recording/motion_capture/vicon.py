"""Reader of Vicon CSV: blocks of trajectories, devices and models.

A block is its title, its rate in Hz, a line of names, one of columns, one of units, then a row a
frame (devices: a row a sub-frame) until a blank line.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from validate.errors import RecordingError
from validate.recording.formats.streams import begun, distinct, recorded
from validate.recording.motion_capture.text_rows import (
    LEFT_OUT,
    TextRow,
    TextRows,
    as_number,
    numbers,
    text_rows,
    told_left,
    told_zeros,
    whole_points,
    without_zeros,
)
from validate.recording.reader import (
    SD,
    UNIT,
    Options,
    Reader,
    frame,
    head,
    metres,
    source_of,
    spread,
)
from validate.recording.types import Markers, Recording, Signal, Stream

_POINTS, _DEVICES, _EVENTS = "Trajectories", "Devices", "Events"
_TITLES = (
    _POINTS,
    _DEVICES,
    "Segments",
    "Joints",
    "Model Outputs",
    _EVENTS,
    "Force Plates",
    "Objects",
)
_BEFORE = 2  # columns before the first value: frame, sub-frame


@dataclass(frozen=True)
class CsvBlock:
    """`rate` Hz; names (k,) above their first columns, columns and units (w,), and the rows."""

    rate: float
    names: tuple[str, ...]
    columns: tuple[str, ...]
    units: tuple[str, ...]
    rows: tuple[TextRow, ...]

    @property
    def width(self) -> int:
        return len(self.columns)


def read_vicon(path: Path, options: Options) -> Recording:
    """Trajectories as `markers`, each channel of a device as `analog/<device>.<channel>`.

    Times are frame numbers over the block's rate, from the first frame of all. Options: `unit` of
    length in place of the file's, `sd` of a coordinate (0: not stated), `frame` (default capture).
    Other blocks are listed as unread. Raises `UsageError` without a unit of length,
    `RecordingError` for a file without trajectories and devices, or damaged.
    """
    held = text_rows(path)
    # Blocks by title, numbered where one stands twice; one without rows is left out.
    begins = [i for i, row in enumerate(held.rows) if row.cell(0) in _TITLES and _lone(row)]
    blocks: dict[str, CsvBlock] = {}
    titles: Counter[str] = Counter()
    for begin, end in pairwise([*begins, len(held.rows)]):
        title = held.rows[begin].cell(0)
        if title == _EVENTS or end - begin < 6:
            continue
        _, rate, names, columns, units, *values = held.rows[begin:end]
        hz = as_number(rate.cell(0)) or 0.0
        if not 0 < hz < np.inf:
            raise RecordingError(
                f"{held.name}: line {rate.line}: '{rate.cell(0)[:20]}' is not a rate in Hz; damaged"
            )
        last = next((i for i, r in enumerate(values) if not any(r.cells)), len(values))
        width = max((i + 1 for i, c in enumerate(columns.cells) if c), default=0)
        titles[title] += 1
        blocks[title if titles[title] == 1 else f"{title} ({titles[title]})"] = CsvBlock(
            hz, names.cells, columns.cells[:width], units.cells, tuple(values[:last])
        )
    streams: dict[str, Stream] = {}
    told = {"kind": "motion capture (Vicon CSV)"}
    if _POINTS in blocks:
        markers, more = _points(held, blocks[_POINTS], options)
        streams["markers"] = markers
        told |= more
    devices = {title: block for title, block in blocks.items() if title.startswith(_DEVICES)}
    for title, block in devices.items():
        signals, more = _signals(held, block, title.removeprefix(_DEVICES), options)
        streams |= signals
        told |= more | told_left([r[LEFT_OUT] for r in (told, more) if LEFT_OUT in r])
    # Events: rows of subject, context, name and time below their title, rate and names.
    first = next((i for i, r in enumerate(held.rows) if r.cell(0) == _EVENTS and _lone(r)), None)
    rows = held.rows[first + 3 :] if first is not None else ()
    last = next((i for i, r in enumerate(rows) if not any(r.cells)), len(rows))
    events = [f"{' '.join(filter(None, r.cells[1:3]))} {r.cell(3)} s" for r in rows[:last]]
    if events:
        listed = "; ".join(events)
        told["events"] = f"{listed} (events of the trial, listed but not stored as a stream)"
    if not streams:
        raise RecordingError(
            f"{path.name}: neither trajectories nor devices; it has "
            f"{', '.join(blocks) or 'none'}; export those two as well"
        )
    unread = {
        title: f"a block of {len(b.rows)} rows that is not read"
        for title, b in blocks.items()
        if title != _POINTS and title not in devices
    }
    source = source_of(path, "text file: integrity not provable")
    return recorded(path.stem, source, begun(streams), told, unread)


def _lone(row: TextRow) -> bool:
    return not any(row.cells[1:])


def _points(held: TextRows, block: CsvBlock, options: Options) -> tuple[Markers, Mapping[str, str]]:
    """Named triples X, Y, Z; derivatives (X', X'') are passed over."""
    axes = tuple(c.upper() for c in block.columns)
    at = [i for i in range(_BEFORE, block.width - 2) if axes[i : i + 3] == ("X", "Y", "Z")]
    if not at:
        raise RecordingError(f"{held.name}: trajectories without columns X, Y, Z; damaged")
    names = distinct([block.names[i] if i < len(block.names) else "" for i in at], len(at))
    values, rows, left = numbers(held, block.rows, block.width)
    columns = np.array(at)[:, None] + np.arange(3)
    shown, zeros = without_zeros(values[:, columns])
    x = whole_points(held, shown, names, rows)
    unit = next((u for u in block.units[_BEFORE:] if u), "")
    factor, stated = metres(options, unit, held.name)
    markers = Markers(
        values[:, 0] / block.rate, names, factor * x, spread(options),
        options.get("frame", "capture"),
    )  # fmt: skip
    missing = f"{int(np.isnan(x[..., 0]).sum())} of {x[..., 0].size}"
    return markers, {"unit": stated, "rate_hz": repr(block.rate), "points_not_seen": missing,
                     **told_zeros(zeros),
                     **told_left(left)}  # fmt: skip


def _signals(
    held: TextRows, block: CsvBlock, more: str, options: Options
) -> tuple[dict[str, Signal], dict[str, str]]:
    """Channels of devices; one with blank cells is left out and told. `more` follows each name."""
    values, _, left = numbers(held, block.rows, block.width)
    # Samples counted from frame 0: the block's rate is that of its rows, so that a frame has
    # as many samples as it has sub-frames.
    each = values[:, 1].max() + 1
    t = np.asarray(values[:, 0] * each + values[:, 1]) / block.rate
    found, gone = {}, list(left)
    frame = options.get("frame", "capture")
    # A topic for every column of a device: its name stands above the first of them.
    device, topics = "device", []
    for column in range(_BEFORE, block.width):
        if column < len(block.names) and block.names[column]:
            device = block.names[column]
        topics.append(f"analog/{device}.{block.columns[column]}{more}")
    for i, topic in enumerate(distinct(topics, len(topics)), start=_BEFORE):
        if np.isnan(values[:, i]).any():
            gone.append(f"{topic}: {int(np.isnan(values[:, i]).sum())} blank cells")
            continue
        unit = block.units[i] if i < len(block.units) else ""
        found[topic] = Signal(t, values[:, [i]], unit or "not stated", 0.0, frame)
    return found, {"analog_rate_hz": repr(block.rate), **told_left(gone)}


def _recognises(path: Path) -> bool:
    first = head(path, 64).removeprefix(b"\xef\xbb\xbf").splitlines()
    return bool(first) and first[0].rstrip(b",;\t\r ").decode("ascii", "replace") in _TITLES


VICON = Reader(
    "vicon",
    "motion capture (Vicon CSV)",
    _recognises,
    read_vicon,
    "its first cell is the title of a block, as Trajectories",
    options=(UNIT, SD, frame("capture")),
    extensions=(".csv",),
)
