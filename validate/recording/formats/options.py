"""Parser of `--map KEY=VALUE`: facts that a file does not contain."""

from dataclasses import replace

import numpy as np

from validate.errors import UsageError
from validate.recording.reader import MapOption, Options
from validate.units import in_si, split

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
