"""Digest of a twin's recording: short JSON beside its file.

Every array is held by shape, first and last row, sum and a SHA-256 of its little-endian bytes. The
hash is what must be equal; the rest tells a reader of a failed comparison what has changed.
"""

import hashlib
import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats
from validate.recording.types import Contours, Frames, Recording

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
