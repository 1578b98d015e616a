"""Poses of a tracked tool as signals: `<tool>/rotation` (nt, 9), `<tool>/translation` (nt, 3) m.

Rotations are stored row by row. Samples exist only where the tool was tracked.
"""

import numpy as np

from validate.arrays import Floats
from validate.errors import RecordingError
from validate.recording.types import Signal

ROTATION, TRANSLATION = "rotation", "translation"
_UNIT = 0.02  # a quaternion's length may differ by so much from 1: logs have few decimals


def pose_signals(
    tool: str, t: Floats, rotation: Floats, translation: Floats, frame: str
) -> dict[str, Signal]:
    """Both signals of t (nt,) s, rotation (nt, 3, 3) and translation (nt, 3) m."""
    return {
        f"{tool}/{ROTATION}": Signal(t, rotation.reshape(-1, 9), "1", 0.0, frame),
        f"{tool}/{TRANSLATION}": Signal(t, translation, "m", 0.0, frame),
    }


def rotations(q: Floats, what: str) -> Floats:
    """Rotations (n, 3, 3) of quaternions (n, 4), x y z w, made of length 1.

    Raises `RecordingError` for one whose length differs by over 2 % from it: no rotation.
    """
    size = np.linalg.norm(q, axis=1)
    if (wrong := np.abs(size - 1) > _UNIT).any():
        i = int(wrong.argmax())
        raise RecordingError(
            f"{what}: sample {i + 1}: a quaternion of length {size[i]:.3g}, expected 1; wrong "
            "columns, or a damaged file"
        )
    x, y, z, w = (q / size[:, None]).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)
