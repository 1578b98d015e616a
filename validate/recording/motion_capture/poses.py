"""Poses of tracked tools as signals, and chains of coordinate transforms.

Poses of a tracked tool as signals: `<tool>/rotation` (nt, 9), `<tool>/translation` (nt, 3) m.
Rotations are stored row by row. Samples exist only where the tool was tracked.

A pose `<X>To<Y>/rotation`, `/translation`, or `<X>/...` in the frame Y, is T_Y_from_X. One pose
alone stands for all times. Poses that link frames anew make a tree; each other one closes a way,
and is held against it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import RecordingError
from validate.recording.types import Recording, Signal

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


_PROPER = 1e-3  # off an orthogonal matrix
APART, TURNED = 2e-3, 2.0  # m and degrees by which two ways to a frame may differ
_SDS = 3.0  # or so many standard deviations of all translations on the way, if that is more
_SHARE = 0.1  # of the poses that may do otherwise, as outliers
_NEAR = 0.02  # s between poses that are compared


@dataclass(frozen=True)
class Link:
    """T_parent_from_child at t (nt,) s: rotations (nt, 3, 3), translations (nt, 3) m, sd m."""

    child: str
    parent: str
    t: Floats
    R: Floats
    x: Floats
    sd: float = 0.0

    @property
    def back(self) -> "Link":
        R = self.R.swapaxes(1, 2)
        return Link(self.parent, self.child, self.t, R, -_turned(R, self.x), self.sd)

    def at(self, t: Floats) -> tuple[Ints, Floats]:
        """Indices of the poses nearest to t (m,) s, and whether they are near: one alone is."""
        after = np.clip(np.searchsorted(self.t, t), 1, max(len(self.t) - 1, 1))
        after = np.minimum(after, len(self.t) - 1)
        before = np.maximum(after - 1, 0)
        index = np.asarray(
            np.where(np.abs(self.t[before] - t) <= np.abs(self.t[after] - t), before, after)
        )
        return index, np.asarray((np.abs(self.t[index] - t) < _NEAR) | (len(self.t) == 1))


def links(recording: Recording) -> tuple[Link, ...]:
    """Every pose of the recording that has both of its signals at the same times, and names two
    frames."""
    found = []
    for topic, turned in recording.signals.items():
        tool = topic.removesuffix(f"/{ROTATION}")
        moved = recording.signals.get(f"{tool}/{TRANSLATION}")
        if tool == topic or moved is None or not np.array_equal(turned.t, moved.t):
            continue
        name, _, to = tool.strip("/").rpartition("To")
        child, parent = (name, to) if name else (tool.strip("/"), turned.frame)
        if not name and child == parent:
            continue  # a topic that is called as its frame is: /odom in odom
        R = turned.y.reshape(-1, 3, 3)
        found.append(Link(child, parent, turned.t, R, moved.y, moved.sd))
    return tuple(found)


def chain_faults(recording: Recording) -> Iterator[str]:
    """A line for every link that mirrors or is no rotation, and for ways that contradict."""
    tree: dict[str, list[Link]] = {}
    for link in links(recording):
        yield from _improper(link)
        way = _way(tree, link.child, link.parent)
        if way is not None:
            yield from _differing(link, way)
            continue
        tree.setdefault(link.child, []).append(link)
        tree.setdefault(link.parent, []).append(link.back)


def require_chain(recording: Recording) -> None:
    """Raise `RecordingError` with the first fault of the recording's frames."""
    for fault in chain_faults(recording):
        raise RecordingError(f"{recording.name}: {fault}")


def _improper(link: Link) -> Iterator[str]:
    where = f"pose of '{link.child}' in '{link.parent}'"
    mirrored = int((np.linalg.det(link.R) < 0).sum())
    off = float(np.abs(link.R @ link.R.swapaxes(1, 2) - np.eye(3)).max())
    if mirrored:
        yield (
            f"{where}: {mirrored} of {len(link.t)} are left-handed (determinant -1): a single "
            f"axis was reversed; export it right-handed"
        )
    elif off > _PROPER:
        yield f"{where}: not a rotation (error {off:.2g}): scaled, sheared or wrong columns"


def _way(tree: dict[str, list[Link]], start: str, end: str) -> list[Link] | None:
    """The links of the tree from one frame to another; none from a frame to itself."""
    ways: dict[str, list[Link]] = {start: []}
    queue = [start]
    while queue and end not in ways:
        frame = queue.pop(0)
        for link in tree.get(frame, []):
            if link.parent not in ways:
                ways[link.parent] = [*ways[frame], link]
                queue.append(link.parent)
    return ways.get(end)


def _differing(direct: Link, way: Sequence[Link]) -> Iterator[str]:
    """Whether a pose is what the way between its frames makes of it, where all were seen."""
    n = len(direct.t)
    R, x, met = np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3)), np.full(n, True)
    for link in way:
        i, near = link.at(direct.t)
        R, x, met = link.R[i] @ R, _turned(link.R[i], x) + link.x[i], met & near
    if not met.any():
        return
    apart = np.linalg.norm(x - direct.x, axis=1)[met]
    cosine = (np.trace(R.swapaxes(1, 2) @ direct.R, axis1=1, axis2=2)[met] - 1) / 2
    turned = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    allowed = max(APART, _SDS * float(np.linalg.norm([link.sd for link in (direct, *way)])))
    beyond = (apart > allowed) | (turned > TURNED)
    if beyond.mean() <= _SHARE:
        return
    by = ", ".join(f"'{link.parent}'" for link in way[:-1]) or "the other pose between them"
    yield (
        f"pose of '{direct.child}' in '{direct.parent}' contradicts the way by {by} in "
        f"{int(beyond.sum())} of {len(apart)} samples, by up to {1e3 * apart.max():.3g} mm and "
        f"{turned.max():.3g} degrees ({1e3 * allowed:.3g} mm and {TURNED:g} degrees are allowed): "
        "a transform is inverted, or from another session; export it again"
    )


def _turned(R: Floats, x: Floats) -> Floats:
    return np.asarray((R @ x[..., None])[..., 0])
