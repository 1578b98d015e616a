"""Dwells of a tracked tip: intervals at rest, and the position of each with uncertainty.

A tip that stands on a point while its stylus is turned wanders: the offset of the tip is known only
so well, and a tracker is distorted. That wander is no noise, and its mean over a dwell is not
sharper by the square root of its samples: the samples that count are those that do not follow from
the ones before.
"""

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import median_filter

from validate.arrays import Floats, rms
from validate.errors import RegistrationError

_SPIKE = 3  # samples of the median that a single false one does not pass
_APART = 0.5  # s between two parts of one dwell
_CLEAR = 5.0  # standard deviations of noise that a radius takes in
_SETTLING = 3.0  # times the dwell's own speed: the tip still comes, or already leaves


@dataclass(frozen=True)
class Dwell:
    """Samples from `begin` to before `end` of a path, at t (k,) s and x (k, 3) m."""

    begin: int
    end: int
    t: Floats
    x: Floats

    @property
    def centre(self) -> Floats:
        """Mean (3,) m over the whole dwell."""
        return np.asarray(self.x.mean(axis=0))

    @property
    def wander(self) -> float:
        """Rms distance m from the centre, per axis."""
        return rms(self.x - self.centre) / float(np.sqrt(3))

    def touch(self, seconds: float, within: float) -> "Dwell":
        """Return the first `seconds` in which the tip holds `within` m of its mean; of a tip that
        never does, those in which it wanders least."""
        step = float(np.median(np.diff(self.t)))
        k = min(max(round(seconds / step), 1), len(self.t))
        smooth = median_filter(self.x, (_SPIKE, 1), mode="nearest")
        windows = np.moveaxis(sliding_window_view(smooth, k, axis=0), 2, 1)  # (m, k, 3)
        off = np.linalg.norm(windows - windows.mean(axis=1, keepdims=True), axis=2).max(axis=1)
        held = np.flatnonzero(off <= within)
        i = int(held[0] if len(held) else off.argmin())
        return Dwell(self.begin + i, self.begin + i + k, self.t[i : i + k], self.x[i : i + k])


def dwells(t: Floats, x: Floats, radius: float, least: float) -> tuple[Dwell, ...]:
    """Parts of a path x (n, 3) m at t (n,) s that stay within `radius` m for `least` s and more.

    The radius is no smaller than the path's own noise from sample to sample asks for. The samples
    in which the tip still comes or already leaves are cut off.
    """
    smooth = median_filter(x, (_SPIKE, 1), mode="nearest")
    radius = max(radius, _CLEAR * _noise(x))
    spans = _joined(t, smooth, _stays(smooth, radius), radius)
    found = [_settled(t, x, smooth, *span) for span in spans]
    return tuple(d for d in found if d.t[-1] - d.t[0] >= least)


def sd_of_mean(parts: tuple[Dwell, ...], whole: tuple[Dwell, ...]) -> float:
    """Standard deviation m per axis of the mean over each of the `parts` of dwells.

    Their wander over the root of the samples that count: those of a first-order autoregression with
    the correlation from sample to sample of the `whole` dwells.
    """
    wander = rms([d.wander for d in parts])
    off = [d.x - d.centre for d in whole]
    power = sum(float((o[:-1] ** 2).sum()) for o in off)
    follow = sum(float((o[:-1] * o[1:]).sum()) for o in off) / power if power else 0.0
    follow = min(max(follow, 0.0), 1.0)
    count = float(np.mean([len(p.x) for p in parts]))
    return wander / float(np.sqrt(max(count * (1 - follow) / (1 + follow), 1.0)))


def _noise(x: Floats) -> float:
    """Standard deviation m along an axis of what changes from sample to sample, while a tip stands:
    from the median of second differences, which a motion over less than half of them leaves."""
    bends = np.abs(np.diff(x, n=2, axis=0))
    return float(np.median(bends)) / 0.6745 / float(np.sqrt(6)) if bends.size else 0.0


def _stays(x: Floats, radius: float) -> list[tuple[int, int]]:
    """Spans, one behind the other, whose samples lie within the radius of the mean before them."""
    spans, begin = [], 0
    mean = x[0].copy()
    for i in range(1, len(x)):
        if np.linalg.norm(x[i] - mean) <= radius:
            mean += (x[i] - mean) / (i + 1 - begin)
            continue
        spans.append((begin, i))
        begin, mean = i, x[i].copy()
    return [*spans, (begin, len(x))]


def _joined(
    t: Floats, x: Floats, spans: list[tuple[int, int]], radius: float
) -> list[tuple[int, int]]:
    """Long spans; what a short disturbance parted at one place is one again."""
    out: list[tuple[int, int]] = []
    for begin, end in (s for s in spans if s[1] - s[0] > 2 * _SPIKE):
        if out:
            near = np.linalg.norm(x[begin:end].mean(axis=0) - x[slice(*out[-1])].mean(axis=0))
            if near <= radius and t[begin] - t[out[-1][1] - 1] <= _APART:
                out[-1] = (out[-1][0], end)
                continue
        out.append((begin, end))
    return out


def _settled(t: Floats, x: Floats, smooth: Floats, begin: int, end: int) -> Dwell:
    """Without the ends in which the tip moves faster than while it stands."""
    speed = np.linalg.norm(np.diff(smooth[begin:end], axis=0), axis=1)
    calm = np.flatnonzero(speed <= _SETTLING * np.median(speed))
    low, high = begin + int(calm[0]), begin + int(calm[-1]) + 2
    return Dwell(low, high, t[low:high], x[low:high])


def tip_path(
    names: tuple[str, str],
    stylus: tuple[Floats, Floats],
    reference: tuple[Floats, Floats] | None,
    tip: Floats,
) -> tuple[Floats, Floats]:
    """Times (n,) s and places (n, 3) m of a stylus' tip (3,) m, in the reference's frame.

    `stylus` and `reference` are times and 3 x 4 poses (n, 3, 4) in a tracker's frame; without a
    reference the stylus' own frame is taken. Only times at which both were seen are kept. Raises
    `RegistrationError` where there are none.
    """
    t, T = stylus
    x = T[:, :, :3] @ tip + T[:, :, 3]
    if reference is None:
        return t, x
    at, i, j = np.intersect1d(np.rint(1e9 * t), np.rint(1e9 * reference[0]), return_indices=True)
    if not len(at):
        raise RegistrationError(
            f"'{names[0]}' and '{names[1]}' are never visible at the same time: 0 of {len(t)} and "
            f"{len(reference[0])} frames"
        )
    R = reference[1][j]
    local = np.linalg.solve(R[:, :, :3], (x[i] - R[:, :, 3])[..., None])[..., 0]
    return t[i], np.asarray(local, dtype=np.float64)
