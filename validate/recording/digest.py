"""What must be read from a recording, as numbers: the JSON that lies beside a twin's file."""

import hashlib
from typing import Any

from validate.recording.types import Recording


def summary(recording: Recording) -> dict[str, Any]:
    """Every number of every stream, in SI, nested by topic; NaN (not seen) as null."""
    return {
        "name": recording.name,
        "t0_ns": recording.t0_ns,
        "signals": {
            k: {"unit": s.unit, "sd": s.sd, "t": s.t.tolist(), "y": s.y.tolist()}
            for k, s in recording.signals.items()
        },
        "markers": {
            k: {"frame": m.frame, "names": list(m.names), "sd": m.sd, "t": m.t.tolist(),
                "x": [[None if p[0] != p[0] else p for p in x] for x in m.x.tolist()]}
            for k, m in recording.markers.items()
        },
        "contours": {
            k: {"frame": c.frame, "sd": c.sd, "t": c.t.tolist(), "pose": c.pose.tolist(),
                "outlines": [o.tolist() for o in c.outlines]}
            for k, c in recording.contours.items()
        },
        "frames": {
            k: {"frame": f.frame, "t": f.t.tolist(), "m_per_px": list(f.m_per_px),
                "pose": f.pose.tolist(), "shape": list(f.images[0].shape),
                "sha256": [hashlib.sha256(i.tobytes()).hexdigest() for i in f.images]}
            for k, f in recording.frames.items()
        },
        "metadata": {k: dict(v) for k, v in recording.metadata.items()},
    }  # fmt: skip
