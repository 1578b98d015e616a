"""What a C3D file holds as streams: points, computed outputs, analog channels, poses of bodies."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats
from validate.recording.formats.poses import pose_signals
from validate.recording.formats.recorded import distinct
from validate.recording.formats.text_rows import told_zeros, without_zeros
from validate.recording.types import Markers, Record, Signal, Stream

NOT_STATED = "not stated"
_NEVER = "never seen"
_MATRIX = "_4X4"  # behind the names of poses
Held = Mapping[str, NDArray[Any]]  # as `c3d_arrays.arrays` has them
Found = tuple[dict[str, Stream], dict[str, str]]  # streams, and why others are none


def names_of(found: Held) -> tuple[str, ...]:
    """A name for everything among the points."""
    return distinct(found["labels"].tolist(), found["points"].shape[1])


def is_output(found: Held) -> NDArray[np.bool_]:
    """Which of what stands among the points (n,) is a computed output, as an angle."""
    told = {label for label, _ in found["outputs"].tolist()}
    return np.array([name in told for name in names_of(found)], dtype=bool)


def markers_of(
    found: Held, rate: float, factor: float, sd: float, frame: str
) -> tuple[Markers, Record]:
    """Points (nt, k, 3) m and what is told of them: NaN where a residual is below 0, or all three
    coordinates are zero, which programs write for what no camera saw."""
    own = ~is_output(found)
    missing = (found["residuals"] < 0)[:, own, None]
    shown, zeros = without_zeros(np.where(missing, np.nan, found["points"][:, own]))
    names = tuple(n for n, kept in zip(names_of(found), own, strict=True) if kept)
    x: Floats = factor * np.where(np.isfinite(shown).all(axis=2, keepdims=True), shown, np.nan)
    residuals = found["residuals"][:, own]
    seen = residuals[residuals > 0]
    told = {
        "points_not_seen": f"{int(np.isnan(x[..., 0]).sum())} of {x[..., 0].size}",
        **told_zeros(zeros),
        "residual_median_m": f"{factor * np.median(seen):.3g}" if len(seen) else NOT_STATED,
    }
    return Markers(np.arange(len(x)) / rate, names, x, sd, frame), told


def outputs_of(found: Held, rate: float, frame: str) -> Found:
    """Each computed output as `model/<label>` (nt, 3) in its own unit, where it has a value."""
    units = dict(found["outputs"].tolist())
    streams: dict[str, Stream] = {}
    never = {}
    for i, (name, output) in enumerate(zip(names_of(found), is_output(found), strict=True)):
        values = found["points"][:, i]
        has = (found["residuals"][:, i] >= 0) & np.isfinite(values).all(axis=1)
        if output and not has.any():
            never[f"model/{name}"] = _NEVER
        elif output:
            t = np.flatnonzero(has) / rate
            streams[f"model/{name}"] = Signal(t, values[has], units[name] or NOT_STATED, 0.0, frame)
    return streams, never


def analog_of(found: Held, rate: float, frame: str) -> Found:
    """Each channel as `analog/<label>`; one with numbers that are none is left out and told."""
    values = found["analog"]
    units = [str(u) for u in found["channel_units"]] + [""] * values.shape[1]
    t = np.arange(len(values)) / rate if rate > 0 else np.empty(0)
    streams: dict[str, Stream] = {}
    never = {}
    for i, name in enumerate(distinct(found["channels"].tolist(), values.shape[1])):
        odd = int((~np.isfinite(values[:, i])).sum())
        if not len(t) or odd:
            never[f"analog/{name}"] = (
                f"{odd} values are not numbers" if odd else "no rate is declared"
            )
        else:
            unit = units[i] or NOT_STATED
            streams[f"analog/{name}"] = Signal(t, values[:, [i]], unit, 0.0, frame)
    return streams, never


def poses_of(found: Held, rate: float, factor: float, frame: str) -> Found:
    """Each body's pose as `<body>/rotation` and `<body>/translation`, where it is one."""
    poses = found["poses"]
    streams: dict[str, Stream] = {}
    never = {}
    for i, label in enumerate(distinct(found["bodies"].tolist(), poses.shape[1])):
        name = label.removesuffix(_MATRIX)
        T = poses[:, i]
        seen = np.isfinite(T).all(axis=(1, 2)) & T[:, :3, :3].any(axis=(1, 2))
        if rate <= 0 or not seen.any():
            never[name] = _NEVER if rate > 0 else "no rate is declared"
        else:
            x = factor * T[seen, :3, 3]
            streams |= pose_signals(name, np.flatnonzero(seen) / rate, T[seen, :3, :3], x, frame)
    return streams, never
