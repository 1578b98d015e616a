"""Landmarks of a rigid body from a tracked tip: pose, and leave-one-out prediction.

What the pose was fitted on is no evidence of it. Left out one by one, every landmark is.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations, permutations

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation

from validate.arrays import Floats, Ints, rms
from validate.errors import RegistrationError
from validate.fem.assembly.locate import Rows
from validate.register.draws import AnyDraw
from validate.register.markers.measures import target_covariance
from validate.register.markers.transform import COLLINEAR, Similarity, fit_rigid, spread
from validate.register.observation import Deviation, Role, Selection, Simulated
from validate.register.tools.dwell import Dwell

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
    found = _matches(known, seen, within)
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


def _matches(known: Floats, seen: Floats, within: float) -> list[Match]:
    """Every assignment that some triple of landmarks leads to, once."""
    far, near = cdist(known, known), cdist(seen, seen)
    found: dict[tuple[tuple[int, ...], tuple[int, ...]], Match] = {}
    places = np.array(list(permutations(range(len(seen)), 3))).reshape(-1, 3)
    for a, b, c in _wide(known, far):
        sides = near[places[:, [0, 1, 2]], places[:, [1, 2, 0]]]
        fits = (np.abs(sides - [far[a, b], far[b, c], far[c, a]]) < within).all(axis=1)
        for triple in places[fits]:
            if any(m.has((a, b, c), triple) for m in found.values()):
                continue
            match = _settled(known, seen, np.array([a, b, c]), triple, within)
            if match:
                found[tuple(match.known.tolist()), tuple(match.seen.tolist())] = match
    return list(found.values())


def _wide(known: Floats, far: Floats) -> list[tuple[int, int, int]]:
    """Triples that are no line, those first whose nearest two lie furthest apart."""
    triples = [t for t in combinations(range(len(known)), 3) if _is_wide(known[list(t)])]
    triples.sort(key=lambda t: -min(far[t[0], t[1]], far[t[1], t[2]], far[t[2], t[0]]))
    return triples[:: max(1, -(-len(triples) // _TRIPLES))]


def _is_wide(points: Floats) -> bool:
    extent = spread(points)
    return bool(extent[1] > 100 * COLLINEAR * extent[0])


def _settled(known: Floats, seen: Floats, a: Ints, i: Ints, within: float) -> Match | None:
    """The assignment that a first one leads to; None where it ends with too few."""
    for _ in range(5):
        T = fit_rigid(known[a], seen[i])
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
    T = fit_rigid(known[a], seen[i])
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
        return fit_rigid(self.body, self.places)

    @property
    def residuals(self) -> Floats:
        """Fitted less touched (m, 3) m."""
        return np.asarray(self.pose.apply(self.body) - self.places)

    @property
    def without(self) -> tuple[Similarity, ...]:
        """T_frame_from_body without each landmark in turn."""
        all_of = range(len(self.body))
        kept = [[j for j in all_of if j != i] for i in all_of]
        return tuple(fit_rigid(self.body[k], self.places[k]) for k in kept)

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


@dataclass(frozen=True)
class TouchedLandmarks:
    """Every touched landmark at the instant t (m,) s of its own pose, against the run's."""

    digitised: Digitised
    t: Floats
    name: str = "landmark"
    role: Role = "validates"

    @property
    def units(self) -> Mapping[str, str]:
        return {self.name: "m"}

    def deviations(self, run: Simulated, selection: Selection) -> tuple[Deviation, ...]:
        d = self.digitised
        at = selection.samples(self.t, run.t, self.name)
        words = "predicted from all other landmarks minus touched, along the frame's axes"
        off = self._shown(run, at) - d.places[at]
        # Every pose has six numbers of all landmarks: so many of the differences are not free.
        freedom = max(off.size - 6, 1)
        about = d.places[at] - d.places.mean(axis=0)
        return (
            Deviation(self.name, off, "m", rms(d.expected), 0.0, words, freedom=freedom,
                      reference=about, t=self.t[at], axes=tuple("xyz")),
        )  # fmt: skip

    def left(self, run: Simulated) -> Floats:
        """Where the run has each landmark less where it was touched, flat (m 3,) m."""
        off = self._shown(run, np.arange(len(self.t))) - self.digitised.places
        return np.asarray(off.ravel())

    def anew(self, left: Floats, draw: AnyDraw) -> "TouchedLandmarks":
        """Touched where `left` (m 3,) m has them. A landmark's noise is drawn once: it moves its
        own place and the poses that predict all others."""
        exact = self.digitised.moved(self.digitised.residuals)  # as a rigid body has them
        noise = draw.white(self.digitised.sd, exact.places.shape)
        off = left.reshape(noise.shape) - exact.moved(noise).left_out
        return replace(self, digitised=self.digitised.moved(off))

    def _shown(self, run: Simulated, at: Ints) -> Floats:
        """Places (k, 3) m of some landmarks, each at the instant of its own pose."""
        steps = np.searchsorted(run.t, self.t[at])
        names = [self.digitised.touched[i] for i in at]
        pairs = list(zip(names, steps, strict=True))
        return np.array([[run.traces[f"{n}.{a}"].y[step] for a in "xyz"] for n, step in pairs])

    def unanswered(self, run: Simulated) -> tuple[str, ...]:
        return tuple(n for n in self.digitised.touched if f"{n}.x" not in run.traces)

    def rows(self) -> Rows | None:
        return None
