"""Recordings of a released beam: its markers found, its rest before, its swing, its rest after.

Names may have a prefix or other spacing, markers may stand in any order and among others, and may
be missing for a while. The release is found from the markers: other recordings have other frames.
"""

import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.datasets.home import data_path
from validate.errors import RecordingError
from validate.pipeline.experiment.tree import Tree
from validate.recording.readers import recognised
from validate.recording.types import Markers, Recording

from .settings import FOLDER, LAYOUT, TIPS


def over(statistic: Callable[..., Any], x: Floats, axis: int) -> Floats:
    """One of numpy's `nan...` statistics of x along an axis."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return np.asarray(statistic(x, axis=axis))


REST, SWING = "markers", "swing"  # streams: two instants of rest; the samples from the release on
_MOVED = 5e-4  # m: of the tip, when the beam has been let go
_HELD, _FALLEN = 0.03, 0.5  # of the drop to rest: held until here, let go for good by there
_BEFORE, _CLEAR, _AFTER = 0.3, 0.03, 1.0  # s: of rest before, clear of the release, of rest after
_SETTLING = 1.5  # s from the release to where rest may begin
_SAME, _STILL = 1e-3, 1e-4  # m: how far positions wander at rest, at most, and where it is sure


def load(tree: Tree, folder: Path) -> tuple[Recording, ...]:
    """The recording as its two states of rest and its swing."""
    path = data_path(FOLDER, "beam_gravity_V2_b.c3d", folder, tree.recording or None)
    unit = tree.settings.unit
    options = {"unit": unit} if unit else {}
    return (released(recognised(path).read(path, options)),)


def released(recording: Recording) -> Recording:
    """`REST`: markers at 0 s, before the release, and when the beam has settled, means over what is
    at rest; `SWING`: samples from the last one of the beam held, at 0 s, to the end.

    Raises `RecordingError` for markers that are missing or never seen, a beam that is not let go,
    and one that still moves at the end.
    """
    markers = named(recording)
    x, t = markers.x, markers.t
    at = _release(recording.name, x[:, : len(TIPS)], t)
    before = (t >= t[at] - _BEFORE) & (t < t[at] - _CLEAR)
    after = _settled(x[:, : len(TIPS)], t, at)
    ends = [_at_rest(recording.name, x[part], word) for part, word in
            ((before, "before the release"), (after, "at the end"))]  # fmt: skip
    until = float(t[after].mean())
    still = replace(markers, t=np.array([0.0, until - t[at]]), x=np.array(ends))
    swing = replace(markers, t=t[at:] - t[at], x=x[at:])
    clock = dict.fromkeys((REST, SWING), next(iter(recording.clock.values())))
    return replace(recording, markers={REST: still, SWING: swing}, signals={}, clock=clock)


def named(recording: Recording) -> Markers:
    """The markers of the layout, in its order and under its names.

    Raises `RecordingError` where one is absent, or two have its name.
    """
    if not recording.markers:
        raise RecordingError(f"{recording.name}: no markers; record those of a motion capture")
    markers = next(iter(recording.markers.values()))
    kept = []
    for name in LAYOUT:
        same = [i for i, other in enumerate(markers.names) if _is(other, name)]
        if len(same) != 1:
            many = f"{len(same)} markers are named '{name}'" if same else f"no marker '{name}'"
            raise RecordingError(
                f"{recording.name}: {many}; it has {list(markers.names)[:8]}; rename them"
            )
        kept += same
    return replace(markers, names=tuple(LAYOUT), x=markers.x[:, kept])


def _is(theirs: str, name: str) -> bool:
    """Letters and digits are those of the name, whatever stands before them."""
    plain = ["".join(c for c in text.casefold() if c.isalnum()) for text in (theirs, name)]
    return plain[0].endswith(plain[1])


def _release(name: str, tips: Floats, t: Floats) -> int:
    """The last sample at which the tips (nt, k, 3) m are held, before they fall for good."""
    start = over(np.nanmedian, tips[t < t[0] + _BEFORE / 2], 0)
    drop = fallen(tips - start)
    whole = float(np.percentile(drop[np.isfinite(drop)], 90)) if np.isfinite(drop).any() else 0.0
    if not whole > _MOVED:
        raise RecordingError(
            f"{name}: no marker at the tip moves by {1e3 * _MOVED:g} mm: the beam is not released"
        )
    let_go = int(np.argmax(drop > _FALLEN * whole))
    held = np.flatnonzero(drop[: let_go + 1] < _HELD * whole)
    at = int(held[-1]) if len(held) else 0
    if t[at] - t[0] < _BEFORE / 2:
        raise RecordingError(
            f"{name}: the beam moves at {t[at]:.2f} s; {_BEFORE / 2:g} s of rest before the "
            "release are needed for the initial position"
        )
    return at


def fallen(moved: Floats) -> Floats:
    """Motion (nt,) m of the markers (nt, k, 3) along where they go farthest, in the median."""
    mean = over(np.nanmean, moved, 1)
    lengths = np.linalg.norm(mean, axis=1)
    farthest = mean[int(np.argmax(np.where(np.isfinite(lengths), lengths, 0.0)))]
    direction = farthest / max(float(np.linalg.norm(farthest)), 1e-12)
    return over(np.nanmedian, moved @ direction, 1)


def _settled(tips: Floats, t: Floats, at: int) -> Floats:
    """The samples (nt,) of the last second in which the fallen tips are still, or simply the last:
    a hand may lift the beam again."""
    sunk = over(np.nanmedian, tips[t > t[at] + _SETTLING], 0) - tips[at]
    for first in np.flatnonzero((t > t[at] + _SETTLING) & (t <= t[-1] - _AFTER))[::-1]:
        window = (t > t[first]) & (t <= t[first] + _AFTER)
        off = over(np.nanmean, tips[window], 0) - tips[at] - sunk
        lifted = float(np.nanmax(np.abs(off), initial=0.0)) > _FALLEN * np.nanmax(np.abs(sunk))
        if not lifted and over(np.nanstd, tips[window], 0).max() < _STILL:
            return np.asarray(window)
    return np.asarray(t > t[-1] - _AFTER)


def _at_rest(name: str, x: Floats, when: str) -> Floats:
    seen = np.isfinite(x).all(axis=2).sum(axis=0)
    for marker, count in zip(LAYOUT, seen, strict=True):
        if count < 3:
            raise RecordingError(
                f"{name}: '{marker}' is seen at {count} of {len(x)} samples {when}; 3 are needed"
            )
    wander = float(over(np.nanstd, x[:, : len(TIPS)], 0).max())
    if wander > _SAME:
        raise RecordingError(
            f"{name}: markers wander by {1e3 * wander:.2f} mm {when}, at most {1e3 * _SAME:g} mm "
            "are rest; record longer"
        )
    return over(np.nanmean, x, 0)
