"""Landmarks of a rigid body from dwells of a tracked tip: pose, and leave-one-out prediction.

What the pose was fitted on is no evidence of it. Left out one by one, every landmark is.

A tip that stands on a point while its stylus is turned wanders: the offset of the tip is known
only so well, and a tracker is distorted. That wander is no noise, and its mean over a dwell is
not sharper by the square root of its samples: the samples that count are those that do not follow
from the ones before.
"""

from dataclasses import dataclass, replace
from itertools import combinations, permutations
from typing import Self

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import median_filter
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation

from validate.arrays import Floats, Ints, rms
from validate.errors import RegistrationError
from validate.register.markers.measures import target_covariance
from validate.register.markers.transform import COLLINEAR, Similarity, spread

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

    @classmethod
    def of_path(cls, t: Floats, x: Floats, radius: float, least: float) -> tuple[Self, ...]:
        """Return the parts of a path x (n, 3) m at t (n,) s that stay within `radius` m for `least`
        s and more.

        The radius is no smaller than the path's own noise from sample to sample asks for. The
        samples in which the tip still comes or already leaves are cut off.
        """
        smooth = median_filter(x, (_SPIKE, 1), mode="nearest")
        # Standard deviation m along an axis of what changes from sample to sample, while a tip
        # stands: from the median of second differences, which a motion over less than half of
        # them leaves.
        bends = np.abs(np.diff(x, n=2, axis=0))
        noise = float(np.median(bends)) / 0.6745 / float(np.sqrt(6)) if bends.size else 0.0
        radius = max(radius, _CLEAR * noise)
        # Spans, one behind the other, whose samples lie within the radius of the mean before
        # them.
        spans, begin = [], 0
        mean = smooth[0].copy()
        for i in range(1, len(smooth)):
            if np.linalg.norm(smooth[i] - mean) <= radius:
                mean += (smooth[i] - mean) / (i + 1 - begin)
                continue
            spans.append((begin, i))
            begin, mean = i, smooth[i].copy()
        spans = _joined(t, smooth, [*spans, (begin, len(smooth))], radius)
        ends = [_settled_span(smooth, *span) for span in spans]
        found = [cls(low, high, t[low:high], x[low:high]) for low, high in ends]
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


def _settled_span(smooth: Floats, begin: int, end: int) -> tuple[int, int]:
    """Without the ends in which the tip moves faster than while it stands."""
    speed = np.linalg.norm(np.diff(smooth[begin:end], axis=0), axis=1)
    calm = np.flatnonzero(speed <= _SETTLING * np.median(speed))
    return begin + int(calm[0]), begin + int(calm[-1]) + 2


# --- Which of the places that were touched is which landmark: by their distances, in any order.
#
# A touched place may be none (where a stylus is parked), and a landmark may not have been
# touched. A body that looks the same after a turn is told apart by the order in which it was
# touched.

FEWEST = 4  # of which one is left out
_TRIPLES = 20  # triples of landmarks that are tried, the widest
_ALIKE = 2.0  # times the squares of the best: another assignment that fits as well
_MOST = 60  # places: more are no dwells on landmarks


@dataclass(frozen=True)
class Match:
    """Landmarks `known` (k,) and the places `seen` (k,) of them, by index; rms m of the fit."""

    known: Ints
    seen: Ints
    rms: float

    def has(self, known: tuple[int, int, int], seen: Ints) -> bool:
        """Return whether those landmarks are at those places."""
        at = dict(zip(self.known.tolist(), self.seen.tolist(), strict=True))
        return bool([at.get(k) for k in known] == seen.tolist())

    @property
    def ordered(self) -> bool:
        """Whether they were touched in the order of the list."""
        return bool((np.diff(self.seen[np.argsort(self.known)]) > 0).all())


def match_landmarks(known: Floats, seen: Floats, within: float) -> Match:
    """Landmarks known (m, 3) m among the places seen (n, 3) m, each within `within` m of its own.

    The assignment of most landmarks is taken, then the one in the order of the list, then the
    best fit. Raises `RegistrationError` for fewer than four landmarks, and where two assignments
    fit alike and neither is in order.
    """
    if len(seen) > _MOST:
        raise RegistrationError(
            f"{len(seen)} places for {len(known)} landmarks; expected at most {_MOST}"
        )
    # Every assignment that some triple of landmarks leads to, once.
    far, near = cdist(known, known), cdist(seen, seen)
    every: dict[tuple[tuple[int, ...], tuple[int, ...]], Match] = {}
    places = np.array(list(permutations(range(len(seen)), 3))).reshape(-1, 3)
    # Triples that are no line, those first whose nearest two lie furthest apart.
    triples = [t for t in combinations(range(len(known)), 3) if _is_wide(known[list(t)])]
    triples.sort(key=lambda t: -min(far[t[0], t[1]], far[t[1], t[2]], far[t[2], t[0]]))
    for a, b, c in triples[:: max(1, -(-len(triples) // _TRIPLES))]:
        sides = near[places[:, [0, 1, 2]], places[:, [1, 2, 0]]]
        fits = (np.abs(sides - [far[a, b], far[b, c], far[c, a]]) < within).all(axis=1)
        for triple in places[fits]:
            if any(m.has((a, b, c), triple) for m in every.values()):
                continue
            match = _settled(known, seen, np.array([a, b, c]), triple, within)
            if match:
                every[tuple(match.known.tolist()), tuple(match.seen.tolist())] = match
    found = list(every.values())
    most = max((len(m.known) for m in found), default=0)
    if most < min(FEWEST, len(known)) or most < FEWEST:
        raise RegistrationError(
            f"{most} of {len(known)} landmarks lie among the {len(seen)} places touched, within "
            f"{1e3 * within:g} mm; {FEWEST} are needed: check the tip's offset, the list of "
            "landmarks and its unit"
        )
    best = sorted((m for m in found if len(m.known) == most), key=lambda m: m.rms)
    alike = [m for m in best if m.rms**2 <= _ALIKE * best[0].rms ** 2]
    ordered = [m for m in alike if m.ordered]
    if len(alike) > 1 and not ordered:
        raise RegistrationError(
            f"{len(alike)} assignments of {most} landmarks fit alike ({1e3 * best[0].rms:.2f} and "
            f"{1e3 * alike[1].rms:.2f} mm), none in the order of the list: list the landmarks as "
            "they were touched"
        )
    return (ordered or alike)[0]


def _is_wide(points: Floats) -> bool:
    extent = spread(points)
    return bool(extent[1] > 100 * COLLINEAR * extent[0])


def _settled(known: Floats, seen: Floats, a: Ints, i: Ints, within: float) -> Match | None:
    """The assignment that a first one leads to; None where it ends with too few."""
    for _ in range(5):
        T = Similarity.rigid(known[a], seen[i])
        off = cdist(T.apply(known), seen)
        # Beyond `within` all distances cost the same: a landmark without a place moves no other.
        rows, columns = linear_sum_assignment(np.minimum(off, within) ** 2)
        kept = off[rows, columns] < within
        if kept.sum() < FEWEST or not _is_wide(known[rows[kept]]):
            return None
        settled = np.array_equal(a, rows[kept]) and np.array_equal(i, columns[kept])
        a, i = rows[kept], columns[kept]
        if settled:
            break
    T = Similarity.rigid(known[a], seen[i])
    rms = float(np.sqrt(((T.apply(known[a]) - seen[i]) ** 2).sum(axis=1).mean()))
    return Match(a, i, rms)


# -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Digitised:
    """The path of a tip t (n,) s, x (n, 3) m, its dwells, the `parts` of them that count, and which
    of them is which of the landmarks `names` (k,) at `known` (k, 3) m; `sd` m of a place, per axis.
    """

    t: Floats
    x: Floats
    dwells: tuple[Dwell, ...]
    parts: tuple[Dwell, ...]
    names: tuple[str, ...]
    known: Floats
    match: Match
    sd: float

    @classmethod
    def of(
        cls,
        t: Floats,
        x: Floats,
        dwells: tuple[Dwell, ...],
        parts: tuple[Dwell, ...],
        names: tuple[str, ...],
        known: Floats,
        within: float,
    ) -> Self:
        """Return which part is which landmark, each within `within` m of its own.

        Raises `RegistrationError` for fewer than four landmarks, and where two assignments fit
        alike and neither is in the order of the list.
        """
        match = match_landmarks(known, np.array([d.centre for d in parts]), within)
        used, whole = (tuple(group[i] for i in match.seen) for group in (parts, dwells))
        return cls(t, x, dwells, parts, names, known, match, sd_of_mean(used, whole))

    def along(self, x: Floats) -> Self:
        """Return the same landmarks with another path x (n, 3) m, as of a corrected tip."""
        parts, dwells = (
            tuple(replace(d, x=x[d.begin : d.end]) for d in group)
            for group in (self.parts, self.dwells)
        )
        used, whole = (tuple(group[i] for i in self.match.seen) for group in (parts, dwells))
        return replace(self, x=x, dwells=dwells, parts=parts, sd=sd_of_mean(used, whole))

    @property
    def touched(self) -> tuple[str, ...]:
        """Names of the landmarks that were touched, in the order of the list."""
        return tuple(self.names[i] for i in self.match.known)

    @property
    def body(self) -> Floats:
        """The touched landmarks (m, 3) m in the body's frame."""
        return np.asarray(self.known[self.match.known])

    @property
    def places(self) -> Floats:
        """Where they were touched (m, 3) m."""
        return np.array([self.parts[i].centre for i in self.match.seen])

    @property
    def pose(self) -> Similarity:
        """T_frame_from_body of all touched landmarks."""
        return Similarity.rigid(self.body, self.places)

    @property
    def residuals(self) -> Floats:
        """Fitted less touched (m, 3) m."""
        return np.asarray(self.pose.apply(self.body) - self.places)

    @property
    def without(self) -> tuple[Similarity, ...]:
        """T_frame_from_body without each landmark in turn."""
        all_of = range(len(self.body))
        kept = [[j for j in all_of if j != i] for i in all_of]
        return tuple(Similarity.rigid(self.body[k], self.places[k]) for k in kept)

    @property
    def left_out(self) -> Floats:
        """Predicted from the others less touched (m, 3) m."""
        at = zip(self.without, self.body, self.places, strict=True)
        return np.array([T.apply(x) - place for T, x, place in at])

    @property
    def expected(self) -> Floats:
        """Standard deviation (m,) m per axis of what is left out: its place's, and the pose's."""
        found = []
        for i, point in enumerate(self.body):
            others = np.delete(self.body, i, axis=0)
            pose = target_covariance(point[None], others, float(np.sqrt(3)) * self.sd)[0]
            found.append(np.sqrt(self.sd**2 + np.trace(pose) / 3))
        return np.array(found)

    def moved(self, by: Floats) -> "Digitised":
        """With every landmark touched `by` (m, 3) m elsewhere."""
        parts = list(self.parts)
        for i, off in zip(self.match.seen, by, strict=True):
            parts[i] = replace(parts[i], x=parts[i].x + off)
        return replace(self, parts=tuple(parts))

    @property
    def poses(self) -> Floats:
        """The poses without each landmark (m, 6): rotation vector rad, translation m."""
        return np.array([[*Rotation.from_matrix(T.R).as_rotvec(), *T.t] for T in self.without])
