"""What a C3D file holds, as plain arrays. The only file that imports ezc3d."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

LIBRARIES = ("ezc3d",)


def arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Points (nt, n, 3) and residuals (nt, n) in the file's unit, analog (nt a, c), and words."""
    import ezc3d

    found = ezc3d.c3d(str(path))
    points = np.moveaxis(found["data"]["points"][:3], 0, -1)  # (n, nt, 3)
    analog = found["data"]["analogs"][0]
    parameters = found["parameters"]
    return {
        "points": np.swapaxes(points, 0, 1),
        "residuals": found["data"]["meta_points"]["residuals"][0].T,
        "rates": np.array([found["header"]["points"]["frame_rate"], _rate(parameters, analog)]),
        "labels": _words(parameters, "POINT", "LABELS"),
        "unit": _words(parameters, "POINT", "UNITS")[:1],
        "analog": np.asarray(analog.T, dtype=np.float64),
        "channels": _words(parameters, "ANALOG", "LABELS"),
        "channel_units": _words(parameters, "ANALOG", "UNITS"),
        "first_frame": np.array(found["header"]["points"]["first_frame"] + 1),
        "events": _words(parameters, "EVENT", "LABELS"),
        "event_times": _event_times(parameters),
    }


def _event_times(parameters: Any) -> NDArray[np.float64]:
    """Minutes and seconds (2, n), as a file has them; none of what is shaped otherwise."""
    group = parameters.get("EVENT", {})
    times = np.asarray(group["TIMES"]["value"] if "TIMES" in group else [], dtype=np.float64)
    return times if times.ndim == 2 and len(times) == 2 else np.empty((2, 0))


def _rate(parameters: Any, analog: NDArray[np.float64]) -> float:
    value = parameters["ANALOG"]["RATE"]["value"] if analog.size else []
    return float(value[0]) if len(value) else 0.0


def _words(parameters: Any, group: str, name: str) -> NDArray[Any]:
    """A list of words, and those of NAME2, NAME3, ...: one parameter holds 255 at most."""
    names = [name, *(f"{name}{i}" for i in range(2, 10))]
    held = parameters.get(group, {})
    found = [w for n in names if n in held for w in held[n]["value"]]
    return np.array([str(w).strip() for w in found], dtype=str)
