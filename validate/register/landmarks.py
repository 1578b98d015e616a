"""Which of the places that were touched is which landmark: by their distances, in any order.

A touched place may be none (where a stylus is parked), and a landmark may not have been touched. A
body that looks the same after a turn is told apart by the order in which it was touched.
"""

from dataclasses import dataclass
from itertools import combinations, permutations

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from validate.arrays import Floats, Ints
from validate.errors import RegistrationError
from validate.register.transform import COLLINEAR, fit_rigid, spread

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
        """Whether those landmarks are at those places."""
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
