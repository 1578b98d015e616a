"""Arrays of a C3D file, and its byte layout. The only file that imports ezc3d.

A header counts at most 65535 frames; a longer file is read in parts that a header can count.
"""

import struct
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.errors import RecordingError
from validate.files import read_bytes
from validate.recording.reader import head

BLOCK = 512  # bytes
INTEL, BIG = 84, 86  # processors; numbers of the latter (SGI) stand the other way round
_DEC = 85  # the one whose floats stand so by halves
MOST = 65535  # frames that a header counts
_FRAMES = 6  # where the header has its first and last frame


@dataclass(frozen=True)
class Layout:
    """`points` and `analog` numbers of one frame, `frames` by the header, the block (from 1) in
    which they `start`, and bytes `each`."""

    processor: int
    points: int
    analog: int
    frames: int
    start: int
    each: int

    @property
    def needs(self) -> int:
        """Bytes to the end of the last frame that the header counts."""
        return self.at(self.frames)

    def at(self, frame: int) -> int:
        """Where a frame begins, bytes."""
        return BLOCK * (self.start - 1) + frame * self.each


def layout(path: Path, first: bytes) -> Layout:
    """By the first block. The last frame of a trial that begins late is counted modulo 65536."""
    # Whose numbers the whole file is in, as its parameters state: 84 Intel, 85 DEC, 86 SGI.
    begin = BLOCK * (max(first[0], 2) - 1)
    processor = (head(path, begin + 4)[begin + 3 :] or b"\0")[0]
    order = ">" if processor == BIG else "<"
    points, analog, begin, end = struct.unpack(f"{order}4H", first[2:10])
    (start,) = struct.unpack(f"{order}H", first[16:18])
    # Where the header's scale is below 0, coordinates are floats, not integers
    sign = {BIG: 0, _DEC: 1}.get(processor, 3)  # the byte of its highest bits
    size = (4 if first[12 + sign] >= 128 else 2) * (4 * points + analog)
    frames = end - begin + 1 + (MOST + 1 if end < begin else 0)
    return Layout(processor, points, analog, frames, start, size)


def parts_beyond(path: Path, frames: int, copy: Path) -> Iterator[Path]:
    """The frames after those that the header counts, up to `frames`, as whole files that are
    written to `copy` one after the other."""
    raw = read_bytes(path)
    lies = layout(path, raw[:BLOCK])
    for begin in range(lies.frames, frames, MOST):
        count = min(MOST, frames - begin)
        front = bytearray(raw[: lies.at(0)])
        front[_FRAMES : _FRAMES + 4] = struct.pack("<2H", 1, count)
        copy.write_bytes(front + raw[lies.at(begin) : lies.at(begin + count)])
        yield copy


def records(raw: bytes, begin: int) -> Iterator[tuple[int, bytes, int]]:
    """Group number (below 0: a group itself), name and the place of the link of each record, as far
    as the links lead.

    C3D user guide, parameter section: four bytes, then records that are linked.
    """
    order = ">" if raw[begin + 3 : begin + 4] == bytes([BIG]) else "<"
    at, ahead = begin + 4, 1
    while ahead > 0 and at + 2 <= len(raw):
        length, group = struct.unpack("bb", raw[at : at + 2])
        after = at + 2 + abs(length)  # of a locked one it is negative
        if length == 0 or after + 4 > len(raw):
            return
        yield group, raw[at + 2 : after], after
        (ahead,) = struct.unpack(f"{order}h", raw[after : after + 2])
        at = after + ahead


# --- C3D in the byte order of SGI, as the same file in Intel's: the library reads that one.

_HEADER = ((2, 12, 2), (12, 16, 4), (16, 20, 2), (20, 24, 4), (294, 302, 2), (304, 376, 4))
_Span = tuple[int, int, int]  # from, to, and the bytes of a number


def turned(path: Path, copy: Path) -> Path:
    """Return the path itself, or where its numbers stand the other way round a `copy` that is
    Intel's.

    C3D user guide: header, parameter section, data. Whole numbers and floats are turned each in
    its place, so that a file of whole numbers stays one.
    """
    raw = bytearray(read_bytes(path))
    lies = layout(path, bytes(raw[:BLOCK]))
    if lies.processor != BIG:
        return path
    begin = BLOCK * (max(raw[0], 2) - 1)
    wide = lies.each // max(4 * lies.points + lies.analog, 1) or 2
    spans = [*_HEADER, *_parameters(bytes(raw[: lies.at(0)]), begin), (lies.at(0), len(raw), wide)]
    # Each number between two places is turned round; what is left over stays.
    for first, last, width in spans:
        end = first + (min(last, len(raw)) - first) // width * width
        part = raw[first:end]
        for i in range(width):
            raw[first + i : end : width] = part[width - 1 - i :: width]
    raw[begin + 3] = INTEL
    copy.write_bytes(raw)
    return copy


def _parameters(raw: bytes, begin: int) -> Iterator[_Span]:
    """Where the links of groups and parameters stand, and the values of the latter."""
    for group, _, at in records(raw, begin):
        yield at, at + 2, 2
        if group > 0:
            kind, many = abs(int.from_bytes(raw[at + 2 : at + 3], signed=True)), raw[at + 3]
            values = at + 4 + many
            yield values, values + kind * prod(raw[at + 4 : values]), max(kind, 1)


# -------------------------------------------------------------------------------------------------

LIBRARIES = ("ezc3d",)
_OUTPUTS = {"ANGLES": "ANGLE_UNITS", "FORCES": "FORCE_UNITS", "MOMENTS": "MOMENT_UNITS",
            "POWERS": "POWER_UNITS", "SCALARS": "SCALAR_UNITS"}  # fmt: skip
_WORD = 65536  # levels of a whole number of two bytes
_MANY = 10  # parameters of one name, numbered from 2: one holds 255 words at most


def arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Points (nt, n, 3) and residuals (nt, n) in the file's unit, analog (nt a, c), poses
    (nt r, m, 4, 4), `rates` of the three, and words; `outputs` (k, 2): labels among the points that
    are none, as angles, and their units; `uncounted`: bytes after the frames that were counted.

    Raises `RecordingError` for a file without all frames that its parameters tell of.
    """
    with tempfile.TemporaryDirectory(prefix="validate-") as folder:
        # Of a file in an order that the library reads; a long trial is read by parts.
        path = turned(path, Path(folder) / "turned.c3d")
        import ezc3d

        found = ezc3d.c3d(str(path))
        parameters = found["parameters"]
        lies = layout(path, head(path, BLOCK))
        if lies.frames == MOST:
            # Frames of a long trial as programs tell of them: Vicon's first and last field, of two
            # words each, else a number beside or in place of the one that counts to 65535.
            ends = ("START", "END")
            fields = [list(_values(parameters, "TRIAL", f"ACTUAL_{w}_FIELD")) for w in ends]
            if all(len(words) == 2 for words in fields):
                begin, end = (int(low) % _WORD + _WORD * int(high) for low, high in fields)
                frames = end - begin + 1
            else:
                told = (_values(parameters, "POINT", n) for n in ("LONG_FRAMES", "FRAMES"))
                frames = max((int(v) for values in told for v in values), default=0)
        else:
            frames = 0
        size = path.stat().st_size
        if size < lies.at(frames):
            raise RecordingError(f"{size} bytes, {frames} frames need {lies.at(frames)}: truncated")
        rest = parts_beyond(path, frames, (Path(folder) / "part.c3d"))
        held = [_frames(found), *(_frames(ezc3d.c3d(str(one))) for one in rest)]
        header = found["header"]
        rates = [header["points"]["frame_rate"], _rate(parameters, "ANALOG", held[0]["analog"]),
                 _rate(parameters, "ROTATION", held[0]["poses"])]  # fmt: skip
        # Labels of events, each after its context (Left, Right), where as many are stated.
        events, sides = (_words(parameters, "EVENT", name) for name in ("LABELS", "CONTEXTS"))
        if len(sides) == len(events):
            both = zip(sides.tolist(), events.tolist(), strict=True)
            events = np.array([f"{side} {label}".strip() for side, label in both], dtype=str)
        # Minutes and seconds (2, n), as a file has them; none of what is shaped otherwise.
        group = parameters.get("EVENT", {})
        times = np.asarray(group["TIMES"]["value"] if "TIMES" in group else [], dtype=np.float64)
        # Labels and units of computed outputs, which lie among the points.
        pairs = []
        for group, units in _OUTPUTS.items():
            unit = next((str(u).strip() for u in _values(parameters, "POINT", units)), "")
            pairs += [(label, unit) for label in _words(parameters, "POINT", group)]
        return {
            **{name: np.concatenate([one[name] for one in held]) for name in held[0]},
            "rates": np.array(rates),
            "labels": _words(parameters, "POINT", "LABELS"),
            "unit": _words(parameters, "POINT", "UNITS")[:1],
            "channels": _words(parameters, "ANALOG", "LABELS"),
            "channel_units": _words(parameters, "ANALOG", "UNITS"),
            "bodies": _words(parameters, "ROTATION", "LABELS"),
            "outputs": np.array(pairs, dtype=str).reshape(-1, 2),
            "first_frame": np.array(header["points"]["first_frame"] + 1),
            "uncounted": np.array(size - lies.at(max(frames, MOST)) if lies.frames == MOST else 0),
            "events": events,
            "event_times": times if times.ndim == 2 and len(times) == 2 else np.empty((2, 0)),
        }


def _frames(found: Any) -> dict[str, NDArray[Any]]:
    """What the file holds frame by frame, times first."""
    data, parameters = found["data"], found["parameters"]
    analog = np.asarray(data["analogs"][0].T, dtype=np.float64)
    # The library takes whole numbers without a sign for signed ones.
    whole = float(_numbers(parameters, "POINT", "SCALE", 1)[0]) > 0
    words = _words(parameters, "ANALOG", "FORMAT")[:1]
    if analog.size and whole and [w.upper() for w in words] == ["UNSIGNED"]:
        many = analog.shape[1]
        each = _numbers(parameters, "ANALOG", "SCALE", many)
        each = each * _numbers(parameters, "ANALOG", "GEN_SCALE", 1)[0]
        offset = _numbers(parameters, "ANALOG", "OFFSET", many)
        raw = np.rint(analog / np.where(each == 0, 1.0, each) + offset)
        analog = np.asarray((raw % _WORD - offset % _WORD) * each)
    return {
        "points": np.transpose(data["points"][:3], (2, 1, 0)),
        "residuals": data["meta_points"]["residuals"][0].T,
        "analog": analog,
        "poses": np.transpose(data["rotations"], (3, 2, 0, 1)),
    }


def _numbers(parameters: Any, group: str, name: str, many: int) -> NDArray[np.float64]:
    """The first numbers of a parameter and its continuations; where too few, a scale of 1."""
    held = [float(v) for v in _values(parameters, group, name)][:many]
    return np.array(held + [1.0] * (many - len(held)))


def _rate(parameters: Any, group: str, samples: NDArray[np.float64]) -> float:
    value = parameters[group]["RATE"]["value"] if samples.size else []
    return float(value[0]) if len(value) else 0.0


def _values(parameters: Any, group: str, name: str) -> list[Any]:
    """The values of a parameter and of NAME2, NAME3, ... that continue it."""
    names = [name, *(f"{name}{i}" for i in range(2, _MANY))]
    held = parameters.get(group, {})
    return [v for n in names if n in held for v in held[n]["value"]]


def _words(parameters: Any, group: str, name: str) -> NDArray[Any]:
    return np.array([str(w).strip() for w in _values(parameters, group, name)], dtype=str)
