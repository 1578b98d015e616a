"""A recorded path of a needle: what of it can be walked, and which sensors can be compared."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats
from validate.compare.verdict import Accept
from validate.errors import RecordingError
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.live import RecordedPath, as_given
from validate.recording.types import Recording
from validate.scene.mesh import Mesh

_PLANE = 25.0  # N/m over N: what a force limit in the plane is worth in the solid's


def follows(experiment: Experiment, recordings: Sequence[Recording], p: Tree) -> Experiment:
    """The experiment as its recording has it: a path of the user's own is walked as it is."""
    recording = recordings[0]
    accept = tuple(_of_space(a, p) for a in experiment.accept)
    if recording.made_with:
        return replace(experiment, accept=accept)
    twin = experiment.twin
    assert twin is not None
    if given := as_given(experiment, recording):
        return given
    there = tuple(a for a in accept if a.quantity in recording.signals)
    return replace(experiment, accept=there, twin=replace(twin, remake=()))


def _of_space(accept: Accept, p: Tree) -> Accept:
    force = accept.quantity.startswith("force") and p.scene.body.space == "solid"
    return replace(accept, limit=accept.limit / _PLANE) if force and accept.limit else accept


_GAP = 3.0  # steps as long as this many median ones are gaps
_LINEAR = 0.15  # of the body's height: the strain to which paper 000 takes its law as linear
_FAR = 1.0  # body sizes away: such a place is no needle's at this body


@dataclass(frozen=True)
class Walkable:
    """t (nt,) s, tip x (nt, d) m, the first one outside the body; sd m; `findings` with counts."""

    t: Floats
    x: Floats
    sd: float
    findings: tuple[str, ...]


def walkable(recording: Recording, mesh: Mesh) -> Walkable:
    """The recorded path against the box that the body fills.

    Raises `RecordingError` where no path is there, it has other dimensions, or none of it can be
    walked.
    """
    space = "plane" if mesh.dimension == 3 else "solid"
    path = RecordedPath.of(recording, mesh.dimension, f"--set body.space={space}")
    t, x = path.t, path.x
    low, high = mesh.nodes.min(axis=0), mesh.nodes.max(axis=0)
    size = float((high - low).max())
    seen = np.asarray(np.isfinite(x).all(axis=1))
    near = seen & np.asarray(_beyond(np.where(seen[:, None], x, low), low, high) <= _FAR * size)
    inside = np.asarray(near & ((x > low) & (x < high)).all(axis=1))
    first = int(np.argmax(near & ~inside)) if (near & ~inside).any() else len(t)
    kept = near & (np.arange(len(t)) >= first)
    findings = [
        _said(~seen, "is not visible and is omitted"),
        _said(seen & ~near, f"lies over {1e3 * _FAR * size:.0f} mm outside the body and is "
                            "omitted"),
        _said(near & (np.arange(len(t)) < first),
              "lies inside the body before the path was outside it and is omitted"),
    ]  # fmt: skip
    if kept.sum() < 2:
        what = "; ".join(f for f in findings if f)
        raise RecordingError(
            f"{recording.name}: {int(kept.sum())} of {len(t)} samples of the tip can be used: "
            f"{what}; the path must begin outside the body and lie in its frame"
        )
    deep = x[kept, 1] < high[1] - _LINEAR * (high - low)[1]
    findings += [
        _gaps(t[kept]),
        _touch(x[kept], low, high),
        _said(deep, f"is deeper than {100 * _LINEAR:g} % of the body's height: beyond linearity"),
        _left(x[kept], low, high),
    ]
    return Walkable(t[kept], x[kept], path.sd, tuple(f for f in findings if f))


def _beyond(x: Floats, low: Floats, high: Floats) -> Floats:
    """How far (nt,) m outside the box."""
    out = np.maximum(low - x, 0) + np.maximum(x - high, 0)
    return np.asarray(np.linalg.norm(out, axis=1))


def _said(which: NDArray[np.bool_], what: str) -> str:
    return f"the tip of {int(which.sum())} of {len(which)} samples {what}" if which.any() else ""


def _gaps(t: Floats) -> str:
    steps = np.diff(t)
    gaps = steps > _GAP * np.median(steps)
    if not gaps.any():
        return ""
    return (
        f"{int(gaps.sum())} gaps in the path, the longest {steps.max():.3g} s: the tip is "
        "assumed to move on a straight line"
    )


def _touch(x: Floats, low: Floats, high: Floats) -> str:
    if ((x > low) & (x < high)).all(axis=1).any():
        return ""
    least = float(_beyond(x, low, high).min())
    return (
        f"none of {len(x)} samples of the tip lies in the body, the nearest {1e3 * least:.3g} "
        "mm away: there is no contact unless the path crosses the body between two samples"
    )


def _left(x: Floats, low: Floats, high: Floats) -> str:
    """Through the body and out below or at a side."""
    sides = [c for c in range(x.shape[1]) if c != 1]
    below = (x[:, 1] < high[1]) & (
        ((x[:, sides] < low[sides]) | (x[:, sides] > high[sides])).any(axis=1) | (x[:, 1] < low[1])
    )
    return _said(below, "lies below the touched face and outside another one: it left the mesh")
