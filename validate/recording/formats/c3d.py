"""C3D, the file of motion capture: labelled points, analog channels, residuals.

The file's own words are taken: labels, unit, rate. A residual is the mean distance of the rays that
meet in a point, not a standard deviation: it is told, never used as one.
"""

import struct
from collections.abc import Iterator
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.errors import RecordingError
from validate.recording.formats.apart import decoded
from validate.recording.formats.options import metres, spread
from validate.recording.formats.recorded import distinct, recorded
from validate.recording.reader import Options, Reader, head, require_known, source_of
from validate.recording.types import Markers, Record, Recording, Signal

MARKERS = "markers"
_BLOCK = 512  # bytes
_BIG = 86  # the processor whose numbers stand the other way round
_DEC = 85  # the one whose floats stand so by halves
_KEY = 80  # the second byte of every C3D file
_OPTIONS = ("unit", "sd", "frame")


def read_c3d(path: Path, options: Options) -> Recording:
    """Points as `markers`, each analog channel as `analog/<label>` in the unit that it states.

    Options: `unit` of length where the file states none, `sd` of a coordinate (as 0.3mm; 0: not
    stated), `frame` (default capture). A point that was not seen is NaN. Raises `UsageError`
    without a unit of length, `RecordingError` for a file that is cut, damaged or no C3D.
    """
    require_known(options, _OPTIONS)
    _require_whole(path)
    found = decoded("c3d_arrays", path, "c3d")
    rate, analog_rate = (float(r) for r in found["rates"])
    if not (np.isfinite(rate) and rate > 0):
        raise RecordingError(f"{path.name}: {rate:g} frames a second stated; expected above 0")
    frame = options.get("frame", "capture")
    unit = str(found["unit"][0]) if len(found["unit"]) else ""
    factor, stated = metres(options, unit, path.name)
    markers = _markers(found, rate, factor, spread(options), frame)
    signals = {} if analog_rate <= 0 else _signals(found, analog_rate, frame)
    source = source_of(path, "C3D keeps no checksum: integrity not provable")
    told = _told(found, rate, analog_rate, factor, stated, markers)
    return recorded(path.stem, source, {MARKERS: markers, **signals}, told)


def _require_whole(path: Path) -> None:
    """The header's own account of its length, before a library believes it."""
    first = head(path, _BLOCK)
    if not path.is_file():
        raise RecordingError(f"{path}: no such file" if not path.exists() else f"{path}: no file")
    if len(first) < _BLOCK or first[1] != _KEY:
        raise RecordingError(f"{path.name}: no C3D file, or one cut in its first {_BLOCK} bytes")
    processor = _processor(path, first)
    order = ">" if processor == _BIG else "<"
    points, analog, begin, end = struct.unpack(f"{order}4H", first[2:10])
    (start,) = struct.unpack(f"{order}H", first[16:18])
    each = 4 if _negative(processor, first) else 2
    frames = end - begin + 1
    needs = _BLOCK * (start - 1) + frames * each * (4 * points + analog)
    size = path.stat().st_size
    if start < 2 or frames < 1 or size < needs:
        raise RecordingError(
            f"{path.name}: {size} bytes, its header tells of {frames} frames of {points} points "
            f"and {analog} analog numbers: {needs} bytes; cut or damaged"
        )
    if processor == _BIG:
        raise RecordingError(
            f"{path.name}: a whole C3D file in the byte order of SGI, which ezc3d does not read; "
            "write it anew as Intel's by another program, as Mokka or Vicon's, or export it as TRC"
        )
    _require_parameters(path, head(path, _BLOCK * (start - 1)), _BLOCK * max(first[0] - 1, 1))


def _processor(path: Path, first: bytes) -> int:
    """Whose numbers the whole file is in, as its parameters state: 84 Intel, 85 DEC, 86 SGI."""
    begin = _BLOCK * (max(first[0], 2) - 1)
    return (head(path, begin + 4)[begin + 3 :] or b"\0")[0]


def _negative(processor: int, first: bytes) -> bool:
    """Whether the header's scale is below 0: coordinates are floats, not integers."""
    sign = {_BIG: 0, _DEC: 1}.get(processor, 3)  # the byte of its highest bits
    return first[12 + sign] >= 128


def _require_parameters(path: Path, raw: bytes, begin: int) -> None:
    """No parameter tells of more values than the file has bytes left: ezc3d takes memory for them
    before it reads, for seconds."""
    size = path.stat().st_size
    for name, dimensions, at in _parameters(raw, begin):
        told = prod(d for d in dimensions if d)
        if told > size - at:
            raise RecordingError(
                f"{path.name}: its parameter {name!r} tells of {told:.3g} values, {size - at} "
                "bytes are left: damaged"
            )


def _parameters(raw: bytes, begin: int) -> Iterator[tuple[str, bytes, int]]:
    """Name, dimensions and place of each parameter, as far as their links lead; groups have none.

    C3D user guide, parameter section: four bytes, then records that are linked.
    """
    order = ">" if raw[begin + 3 : begin + 4] == bytes([_BIG]) else "<"
    at, ahead = begin + 4, 1
    while ahead > 0 and at + 2 <= len(raw):
        length, group = struct.unpack("bb", raw[at : at + 2])
        after = at + 2 + abs(length)  # of a locked one it is negative
        if length == 0 or after + 4 > len(raw):
            return
        if group > 0:
            name = raw[at + 2 : after].decode("ascii", "replace")
            yield name, raw[after + 4 : after + 4 + raw[after + 3]], after
        (ahead,) = struct.unpack(f"{order}h", raw[after : after + 2])
        at = after + ahead


def _markers(found: dict[str, Any], rate: float, factor: float, sd: float, frame: str) -> Markers:
    points, missing = found["points"], found["residuals"] < 0
    x = np.where(missing[..., None], np.nan, factor * points)
    names = distinct(found["labels"], points.shape[1])
    return Markers(np.arange(len(points)) / rate, names, x, sd, frame)


def _signals(found: dict[str, Any], rate: float, frame: str) -> dict[str, Signal]:
    values: Floats = found["analog"]
    names = distinct(found["channels"], values.shape[1])
    units = [str(u) for u in found["channel_units"]]
    units += [""] * (len(names) - len(units))
    t = np.arange(len(values)) / rate
    return {
        f"analog/{name}": Signal(t, values[:, [i]], units[i] or "not stated", 0.0, frame)
        for i, name in enumerate(names)
    }


def _told(
    found: dict[str, Any], rate: float, analog: float, factor: float, unit: str, markers: Markers
) -> Record:
    missing = int(np.isnan(markers.x[..., 0]).sum())
    seen = found["residuals"][found["residuals"] > 0]
    residual = f"{factor * np.median(seen):.3g}" if len(seen) else "not stated"
    return {
        "kind": "motion capture (C3D)",
        "unit": unit,
        "rate_hz": repr(rate),
        "analog_rate_hz": repr(analog),
        "points_not_seen": f"{missing} of {markers.x[..., 0].size}",
        "residual_median_m": residual,
        "first_frame": f"{int(found['first_frame'])} of the trial, time 0 here",
        **_events(found),
    }


def _events(found: dict[str, Any]) -> dict[str, str]:
    """Events as the file states them; its times count as the trial's, which may begin earlier."""
    times = 60 * found["event_times"][0] + found["event_times"][1]
    names = distinct(found["events"], len(times))
    told = "; ".join(f"{name} {t:.6g} s" for name, t in zip(names, times, strict=True))
    return {"events": f"{told} (of the trial; told, no stream)"} if told else {}


def _recognises(path: Path) -> bool:
    """The key is a P, too: text with one there (`Probe`, `"Procedure`) holds no zero byte, the
    header of a C3D does."""
    first = head(path, _BLOCK)
    return first[1:2] == bytes([_KEY]) and first[0] > 0 and 0 in first


C3D = Reader(
    "c3d",
    "motion capture (C3D)",
    _recognises,
    read_c3d,
    "its second byte is 80 and its first block is no text",
)
