"""Type of a reader of one format, its `--map` options, and helpers of all readers.

A new format of the package is one file with its `Reader`, and a line in `readers`.
"""

import difflib
import hashlib
import json
import math
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import wraps
from pathlib import Path
from stat import S_ISDIR, S_ISREG
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats
from validate.errors import RecordingError, UsageError
from validate.files import ANY_SIZE, LARGEST, first_bytes, open_file, too_large
from validate.recording.types import Contours, Frames, Recording, Source
from validate.units import in_si, split

Options = Mapping[str, str]  # what a file does not say itself: `--map KEY=VALUE`


@dataclass(frozen=True)
class MapOption:
    """One key of `--map KEY=VALUE`: what the user says that a file may not contain.

    Capitals in a name stand for any text (`axes.STREAM`). `unit` is that of the value ("" for
    text), `default` says what holds where the key is not given ("" where nothing does).
    """

    name: str
    doc: str
    unit: str = ""
    default: str = ""

    def accepts(self, key: str) -> bool:
        return re.fullmatch(re.sub("[A-Z]+", ".+", re.escape(self.name)), key) is not None


@dataclass(frozen=True)
class Reader:
    """One format; `name` is the KIND of `validate import --as KIND`, `sign` what it is known by.

    Its specification (name, `extensions`, sign, `options`) is what `--help`, error messages and the
    documentation say of it. `general`: any file of its kind may be one, so that it is asked after
    all readers that know their own.

    `recognises` looks at a path and its first bytes and raises nothing. `read` gives a `Recording`
    or raises one `ValidateError` of one line: for a path that cannot be read, a file that is empty,
    cut or of another kind, and an option that it does not know.

    `holds` lists the contents of a file of which the user must say more before it can be read.

    Both are guarded here, for all formats alike: only files of at most `largest` bytes and folders
    are opened (a pipe would wait for ever), only `options` are passed on, and what is wrong in a
    file names the file.
    """

    name: str
    doc: str
    recognises: Callable[[Path], bool]
    read: Callable[[Path, Options], Recording]
    sign: str
    largest: int = LARGEST
    holds: Callable[[Path], Mapping[str, str]] | None = None
    options: tuple[MapOption, ...] = ()
    extensions: tuple[str, ...] = ()
    general: bool = False

    def __post_init__(self) -> None:
        read = self.read

        @wraps(read)
        def guarded(path: Path, options: Options) -> Recording:
            require_readable(path, self.largest)
            require_known(options, self.options)
            try:
                return read(path, options)
            except RecordingError as error:
                if path.name in error.args[0]:
                    raise
                raise RecordingError(f"{path.name}: {error}") from error

        object.__setattr__(self, "read", guarded)


def require_readable(path: Path, largest: int) -> None:
    """Raise `RecordingError` for what cannot be looked at, is neither file nor folder, or is a file
    of over `largest` bytes."""
    try:
        found = path.stat()
    except (OSError, ValueError) as error:  # ValueError: a NUL in its name
        why = getattr(error, "strerror", error)
        raise RecordingError(f"{path}: cannot be read ({why})") from None
    if not (S_ISREG(found.st_mode) or S_ISDIR(found.st_mode)):
        raise RecordingError(f"{path}: cannot be read (neither a file nor a folder)")
    if S_ISREG(found.st_mode) and found.st_size > largest:
        raise too_large(path, found.st_size, largest)


def head(path: Path, count: int = 4096) -> bytes:
    """Return the first bytes of a file; none of what is no readable file."""
    return first_bytes(path, count)


def source_of(path: Path, integrity: str) -> Source:
    """Return a file's name, hash and size; `integrity` says what its bytes prove."""
    with open_file(path, ANY_SIZE) as stream:
        digest = hashlib.file_digest(stream, "sha256").hexdigest()
        size = stream.tell()
    return Source(path.name, digest, size, integrity)


def require_known(options: Iterable[str], known: Collection[MapOption]) -> None:
    """Raise `UsageError` naming the nearest known key for an option that is not `known`."""
    names = [option.name for option in known]
    for key in options:
        if not any(option.accepts(key) for option in known):
            listed = f"{did_you_mean(key, names)}known: {', '.join(names) or 'none'}"
            raise UsageError(f"--map {key}=...: no such key; {listed}")


def did_you_mean(text: str, known: Collection[str]) -> str:
    """Return a question with the nearest of the known texts; empty where none is near."""
    near = difflib.get_close_matches(text, known, n=1, cutoff=0.3)
    return f"did you mean '{near[0]}'? " if near else ""


UNIT = MapOption("unit", "unit of lengths", "a length", "as the file declares")
SD = MapOption("sd", "standard deviation of a coordinate", "m", "0: not stated")
RATE = MapOption("rate", "samples a second", "Hz", "as the file declares")
M_PER_PX = MapOption("m_per_px", "side of a pixel; also --m-per-px", "m", "as the file declares")
WHITE = MapOption("white", "level of a 16-bit image that becomes 255", "1", "the largest level")
TOPIC = MapOption("topic", "name of the image stream", default="images")
LENS_FILE = MapOption("lens", "file of the camera calibration that straightens the images")


def frame(default: str) -> MapOption:
    """Name of the coordinate frame."""
    return MapOption("frame", "name of the coordinate frame", default=default)


def asked(option: MapOption) -> MapOption:
    """Return an option that no file of the format declares."""
    return replace(option, default="")


def length(options: Options, key: str, example: str, *, zero: bool = False) -> float:
    """Metres of a length with its unit, of a bare unit, or of a number of metres.

    Raises `UsageError` for anything else, and for 0 where `zero` is not allowed.
    """
    text = options[key]
    number, unit = split(text) or (1.0, text)
    value = in_si(number, unit or "m", "m")
    if value is None or not (0 < value < np.inf or (zero and value == 0)):
        raise UsageError(f"--map {key}={text}: expected a length, as {example}")
    return value


def spread(options: Options) -> float:
    """Standard deviation `sd` of a coordinate, m; 0: not stated."""
    return length({"sd": "0m", **options}, "sd", "0.3mm", zero=True)


def above_zero(options: Options, key: str) -> float:
    """Return a number above 0; raises `UsageError` for anything else."""
    try:
        value = float(options[key])
    except ValueError:
        value = 0.0
    if not 0 < value < np.inf:
        raise UsageError(f"--map {key}={options[key]}: expected a number above 0")
    return value


def metres(options: Options, stated: str, what: str) -> tuple[float, str]:
    """Metres in the unit of length that a file states, or the user, and who said so.

    Raises `UsageError` where nobody does.
    """
    text = options.get("unit", stated)
    factor = in_si(1.0, text, "m") if text else None
    if factor is None:
        states = f"has the unit '{stated}'" if stated else "has no unit"
        raise UsageError(f"{what}: {states} of length; give --map unit=mm")
    return factor, f"{text} ({'entered' if 'unit' in options else 'declared'})"


# --- digest of a twin's recording: short JSON beside its file ------------------------------------

Json = dict[str, Any]


def digest(recording: Recording) -> Json:
    """Streams by kind and topic, in SI, with their arrays in short; metadata as they are."""
    return {
        "name": recording.name,
        "t0_ns": recording.t0_ns,
        "signals": {
            k: {"unit": s.unit, "sd": s.sd, "frame": s.frame, "t": _array(s.t), "y": _array(s.y)}
            for k, s in recording.signals.items()
        },
        "markers": {
            k: {
                "frame": m.frame,
                "names": list(m.names),
                "sd": m.sd,
                "t": _array(m.t),
                "x": _array(m.x),
            }
            for k, m in recording.markers.items()
        },
        "contours": {k: _contours(c) for k, c in recording.contours.items()},
        "frames": {k: _frames(f) for k, f in recording.frames.items()},
        "metadata": {k: dict(v) for k, v in recording.metadata.items()},
    }


def to_text(found: Json) -> str:
    """Return the digest as JSON, a line for each array and each metadata record."""
    return "\n".join(_lines(found, 0)) + "\n"


def _lines(value: Mapping[str, Any], depth: int) -> list[str]:
    lines = ["{"]
    for i, (key, part) in enumerate(value.items()):
        nested = isinstance(part, dict) and any(isinstance(v, dict) for v in part.values())
        text = _lines(part, depth + 1) if nested else [json.dumps(part, allow_nan=False)]
        text[0] = f"{' ' * (depth + 1)}{json.dumps(key)}: {text[0]}"
        text[-1] += "," if i + 1 < len(value) else ""
        lines += text
    return [*lines, " " * depth + "}"]


def _contours(c: Contours) -> Json:
    own = {"frame": c.frame, "sd": c.sd, "pose": c.pose.tolist(), "t": _array(c.t)}
    if c.each is not None:
        own["each"] = _array(c.each)
    lengths = np.array([len(o) for o in c.outlines], dtype=np.float64)
    return {**own, "counts": _array(lengths), "outlines": _array(np.concatenate(c.outlines))}


def _frames(f: Frames) -> Json:
    images = np.stack(f.images)
    own = {"frame": f.frame, "m_per_px": list(f.m_per_px), "pose": f.pose.tolist()}
    grey = {"shape": list(images.shape), "sum": int(images.sum(dtype=np.int64))}
    return {**own, "t": _array(f.t), "images": {**grey, "sha256": _sha256(images)}}


def _array(x: Floats) -> Json:
    """An array (n, ...) in short; NaN (not seen) is null in rows, 0 in the sum, one NaN hashed."""
    rows = x.reshape(-1, x.shape[-1] if x.ndim > 1 else 1).tolist()
    first, last = ([None if v != v else v for v in row] for row in (rows[0], rows[-1]))
    total = math.fsum(x[~np.isnan(x)].tolist())
    plain = np.where(np.isnan(x), np.nan, x).astype("<f8")
    shape = list(x.shape)
    return {"shape": shape, "first": first, "last": last, "sum": total, "sha256": _sha256(plain)}


def _sha256(x: NDArray[Any]) -> str:
    return hashlib.sha256(np.ascontiguousarray(x).tobytes()).hexdigest()
