"""C3D, the file of motion capture: labelled points, analog channels, residuals.

The file's own words are taken: labels, unit, rate. A residual is the mean distance of the rays that
meet in a point, not a standard deviation: it is told, never used as one.
"""

import struct
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats
from validate.errors import RecordingError, UsageError
from validate.recording.clocks import clock_of
from validate.recording.formats.apart import decoded
from validate.recording.reader import Options, Reader, head, require_known, source_of
from validate.recording.types import Clock, Markers, Record, Recording, Signal
from validate.units import in_si, split

MARKERS = "markers"
_BLOCK = 512  # bytes
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
    factor, stated = _metres(path, found["unit"], options)
    markers = _markers(found, rate, factor, _sd(options), frame)
    signals = {} if analog_rate <= 0 else _signals(found, analog_rate, frame)
    streams: dict[str, Markers | Signal] = {MARKERS: markers, **signals}
    return Recording(
        name=path.stem,
        source=source_of(path, "C3D keeps no checksum: integrity not provable"),
        t0_ns=0,
        markers={MARKERS: markers},
        signals=signals,
        clock={topic: _clock(topic, s.t) for topic, s in streams.items()},
        metadata={"provenance": _told(found, rate, analog_rate, factor, stated, markers)},
    )


def _require_whole(path: Path) -> None:
    """The header's own account of its length, before a library believes it."""
    first = head(path, _BLOCK)
    if not path.is_file():
        raise RecordingError(f"{path}: no such file" if not path.exists() else f"{path}: no file")
    if len(first) < _BLOCK or first[1] != _KEY:
        raise RecordingError(f"{path.name}: no C3D file, or one cut in its first {_BLOCK} bytes")
    points, analog, begin, end, _, scale, start = struct.unpack("<HHHHHfH", first[2:18])
    each = 4 if scale < 0 else 2
    frames = end - begin + 1
    needs = _BLOCK * (start - 1) + frames * each * (4 * points + analog)
    size = path.stat().st_size
    if start < 2 or frames < 1 or size < needs:
        raise RecordingError(
            f"{path.name}: {size} bytes, its header tells of {frames} frames of {points} points "
            f"and {analog} analog numbers: {needs} bytes; cut or damaged"
        )


def _metres(path: Path, unit: NDArray[Any], options: Options) -> tuple[float, str]:
    """Metres in the file's unit of length, and who said so."""
    own = str(unit[0]) if len(unit) else ""
    text = options.get("unit", own)
    factor = in_si(1.0, text, "m") if text else None
    if factor is None:
        states = f"states the unit '{own}'" if own else "states no unit"
        raise UsageError(f"{path.name}: {states} of length; say it: --map unit=mm")
    return factor, f"{text} ({'entered' if 'unit' in options else 'stated'})"


def _sd(options: Options) -> float:
    number, unit = split(options.get("sd", "0")) or (np.nan, "")
    value = in_si(number, unit or "m", "m")
    if value is None or not value >= 0:
        raise UsageError(f"--map sd={options['sd']}: expected a length, as 0.3mm")
    return value


def _markers(found: dict[str, Any], rate: float, factor: float, sd: float, frame: str) -> Markers:
    points, missing = found["points"], found["residuals"] < 0
    x = np.where(missing[..., None], np.nan, factor * points)
    names = _distinct(found["labels"], points.shape[1])
    return Markers(np.arange(len(points)) / rate, names, x, sd, frame)


def _signals(found: dict[str, Any], rate: float, frame: str) -> dict[str, Signal]:
    values: Floats = found["analog"]
    names = _distinct(found["channels"], values.shape[1])
    units = [str(u) for u in found["channel_units"]]
    units += [""] * (len(names) - len(units))
    t = np.arange(len(values)) / rate
    return {
        f"analog/{name}": Signal(t, values[:, [i]], units[i] or "not stated", 0.0, frame)
        for i, name in enumerate(names)
    }


def _distinct(labels: Sequence[str], count: int) -> tuple[str, ...]:
    """A name for each of `count`: the file's, numbered where one stands twice or is missing."""
    told = [str(s) for s in labels[:count]]
    told += [""] * (count - len(told))
    named = [s or f"unnamed {i + 1}" for i, s in enumerate(told)]
    often, seen = Counter(named), Counter[str]()
    out = []
    for name in named:
        seen[name] += 1
        out.append(f"{name} ({seen[name]})" if often[name] > 1 else name)
    return tuple(out)


def _clock(topic: str, t: Floats) -> Clock:
    ns = np.rint(1e9 * t).astype(np.int64)
    return clock_of(topic, None, ns, ns)


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
    }


C3D = Reader("c3d", "motion capture (C3D)", lambda p: head(p, 2)[1:2] == bytes([_KEY]), read_c3d)
