"""Frames along a chain of transforms: whether they turn as bodies do, and whether two ways from one
frame to another say the same.

A pose `<X>To<Y>/rotation`, `/translation`, or `<X>/...` in the frame Y, is T_Y_from_X.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from validate.arrays import Floats
from validate.errors import RecordingError
from validate.recording.formats.poses import ROTATION, TRANSLATION
from validate.recording.types import Recording

_PROPER = 1e-3  # off an orthogonal matrix
APART, TURNED = 2e-3, 2.0  # m and degrees by which two ways to a frame may differ in their median
_NEAR = 0.02  # s between poses that are compared


@dataclass(frozen=True)
class Link:
    """T_parent_from_child at t (nt,) s: rotations (nt, 3, 3), translations (nt, 3) m."""

    child: str
    parent: str
    t: Floats
    R: Floats
    x: Floats


def links(recording: Recording) -> tuple[Link, ...]:
    """Every pose of the recording that has both of its signals at the same times."""
    found = []
    for topic, turned in recording.signals.items():
        tool = topic.removesuffix(f"/{ROTATION}")
        moved = recording.signals.get(f"{tool}/{TRANSLATION}")
        if tool == topic or moved is None or not np.array_equal(turned.t, moved.t):
            continue
        name, _, to = tool.strip("/").rpartition("To")
        child, parent = (name, to) if name else (tool.strip("/"), turned.frame)
        found.append(Link(child, parent, turned.t, turned.y.reshape(-1, 3, 3), moved.y))
    return tuple(found)


def chain_faults(recording: Recording) -> Iterator[str]:
    """A line for every link that mirrors or is no rotation, and for ways that contradict."""
    found = links(recording)
    for link in found:
        yield from _improper(link)
    known = {(link.child, link.parent): link for link in found}
    known |= {(p, c): _turned_round(link) for (c, p), link in known.items() if (p, c) not in known}
    frames = dict.fromkeys(f for pair in known for f in pair)
    told: set[frozenset[str]] = set()
    for a, b, c in permutations(frames, 3):
        if frozenset((a, b, c)) in told or not {(a, b), (b, c), (a, c)} <= known.keys():
            continue
        told.add(frozenset((a, b, c)))
        yield from _differing(known, a, b, c)


def require_chain(recording: Recording) -> None:
    """Raises `RecordingError` with the first fault of the recording's frames."""
    for fault in chain_faults(recording):
        raise RecordingError(f"{recording.name}: {fault}")


def _improper(link: Link) -> Iterator[str]:
    where = f"pose of '{link.child}' in '{link.parent}'"
    mirrored = int((np.linalg.det(link.R) < 0).sum())
    off = float(np.abs(link.R @ link.R.swapaxes(1, 2) - np.eye(3)).max())
    if mirrored:
        yield (
            f"{where}: {mirrored} of {len(link.t)} are left-handed (determinant -1): an axis was "
            "turned on its own; export it right-handed"
        )
    elif off > _PROPER:
        yield f"{where}: off a rotation by {off:.2g}: scaled, sheared, or of other columns"


def _turned_round(link: Link) -> Link:
    R = link.R.swapaxes(1, 2)
    return Link(link.parent, link.child, link.t, R, -(R @ link.x[..., None])[..., 0])


def _differing(known: Mapping[tuple[str, str], Link], a: str, b: str, c: str) -> Iterator[str]:
    """Whether a to c is a to b to c, at the times of the first that the others were seen at."""
    first, second, direct = known[a, b], known[b, c], known[a, c]
    i, j = (_nearest(other.t, first.t) for other in (second, direct))
    met = (np.abs(second.t[i] - first.t) < _NEAR) & (np.abs(direct.t[j] - first.t) < _NEAR)
    if not met.any():
        return
    i, j = i[met], j[met]
    R = second.R[i] @ first.R[met]
    x = (second.R[i] @ first.x[met][..., None])[..., 0] + second.x[i]
    apart = float(np.median(np.linalg.norm(x - direct.x[j], axis=1)))
    cosine = (np.trace(R.swapaxes(1, 2) @ direct.R[j], axis1=1, axis2=2) - 1) / 2
    turned = float(np.median(np.degrees(np.arccos(np.clip(cosine, -1, 1)))))
    if apart > APART or turned > TURNED:
        yield (
            f"from '{a}' to '{c}' by way of '{b}' is {1e3 * apart:.3g} mm and {turned:.3g} degrees "
            f"off the pose recorded between them (median of {len(i)}; {1e3 * APART:g} mm and "
            f"{TURNED:g} degrees are allowed): a transform is turned round, or of another session"
        )


def _nearest(times: Floats, t: Floats) -> np.ndarray:
    after = np.clip(np.searchsorted(times, t), 1, max(len(times) - 1, 1))
    after = np.minimum(after, len(times) - 1)
    before = np.maximum(after - 1, 0)
    return np.where(np.abs(times[before] - t) <= np.abs(times[after] - t), before, after)
