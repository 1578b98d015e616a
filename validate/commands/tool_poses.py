"""Poses of a tracked tool in a recording, by the names that commands use."""

import numpy as np

from validate.arrays import Floats
from validate.errors import UsageError
from validate.recording.motion_capture.poses import ROTATION, TRANSLATION
from validate.recording.reader import length
from validate.recording.types import Recording


def tool_poses(recording: Recording, tool: str) -> tuple[Floats, Floats, Floats]:
    """Times (n,) s, rotations (n, 3, 3) and places (n, 3) m of a tool; raises `UsageError` with
    those there are where it is none of them."""
    turns = [t for t in recording.signals if t.endswith(f"/{ROTATION}")]
    tools = sorted(t.removesuffix(f"/{ROTATION}") for t in turns)
    if tool not in tools:
        raise UsageError(f"no poses of '{tool}'; tools with poses: {', '.join(tools) or 'none'}")
    turned = recording.signal(f"{tool}/{ROTATION}", "1")
    moved = recording.signal(f"{tool}/{TRANSLATION}", "m")
    return turned.t, turned.y.reshape(-1, 3, 3), moved.y


def in_reference(
    recording: Recording, tool: str, reference: str
) -> tuple[Floats, Floats, Floats, str]:
    """The same in the frame of a tracked reference, at the times when both were seen, and the name
    of that frame; without a reference in the frame that the tool's poses have."""
    t, R, T = tool_poses(recording, tool)
    if not reference:
        return t, R, T, recording.signal(f"{tool}/{TRANSLATION}", "m").frame
    other, Q, P = tool_poses(recording, reference)
    _, i, j = np.intersect1d(np.rint(1e9 * t), np.rint(1e9 * other), return_indices=True)
    if not len(i):
        raise UsageError(f"'{tool}' and '{reference}' are never visible at the same time")
    frame = reference.partition("To")[0] or reference
    Qt = np.swapaxes(Q[j], 1, 2)
    return t[i], Qt @ R[i], np.einsum("nij,nj->ni", Qt, T[i] - P[j]), frame


def tip_offset(text: str) -> Floats:
    """Return a tip (3,) m in its tool's frame, of a text as 108mm,-8mm,3mm."""
    words = text.split(",")
    if len(words) != 3:
        raise UsageError(f"--tip {text}: expected three lengths, as 108mm,8mm,3mm")
    tip = []
    for text in map(str.strip, words):
        sign = -1.0 if text.startswith("-") else 1.0
        tip.append(sign * length({"tip": text.lstrip("+-")}, "tip", "108mm", zero=True))
    return np.array(tip)
