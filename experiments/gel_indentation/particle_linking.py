"""Linking of two clouds of the same particles, and interpolation between them.

Nobody moves at first by less than half a spacing: where most neighbours agree on their nearest
partner, links are taken. From there a front walks on: an unlinked particle is predicted by the
local affine motion of its linked neighbours, and takes the nearest free partner. Links that do
not fit their neighbours are cut, and may be made anew. (Idea: Patel et al. 2018, topology-based
tracking; Yang et al. 2022, SerialTrack; prediction by neighbours as in trackpy's predictors.)
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from validate.arrays import Floats, Ints, checked
from validate.errors import RegistrationError

_EVEN = 1e-8  # of the normal matrix: points in one plane leave a slope across it at zero
_TRIED = 400  # points left out in turn
_WILD = 25.0  # squared deviations count no more than that, in variances of the noise
_FAR = 3.0  # robust deviations at which a neighbour counts a quarter


@dataclass(frozen=True)
class LocalFit:
    """At m places: `values` (m, c), `slopes` (m, c, d) per metre, `spread` (m, c) the neighbours'
    robust standard deviation about the fit, `lever` (m,) the variance of a value over theirs."""

    values: Floats
    slopes: Floats
    spread: Floats
    lever: Floats


def local_fit(
    points: Floats,
    values: Floats,
    at: Floats,
    neighbours: int,
    order: int = 2,
    *,
    others: bool = False,
    robust: bool = False,
) -> LocalFit:
    """Least squares by a polynomial of `order` 1 or 2 through the nearest points (n, d) to every
    place (m, d), with values (n, c). `others`: the places are points, and their own value is left
    out. `robust`: neighbours that deviate count less.
    """
    both = cKDTree(points).query(at, neighbours + others)
    distance, index = (np.asarray(part) for part in both)
    index, distance = index[:, others:], distance[:, others:]
    reach = np.maximum(distance[:, -1:], 1e-300)
    # Monomials (..., p) up to `order` of places (..., d).
    x = (points[index] - at[:, None]) / reach[..., None]
    d = x.shape[-1]
    terms = [np.ones(x.shape[:-1]), *np.moveaxis(x, -1, 0)]
    if order == 2:
        terms += [x[..., i] * x[..., j] for i in range(d) for j in range(i, d)]
    A = np.stack(terms, axis=-1)
    y, w = values[index], np.ones(distance.shape)
    for _ in range(3 if robust else 1):
        weighted = (A * w[..., None]).swapaxes(1, 2)
        normal = weighted @ A + _EVEN * np.eye(A.shape[-1])
        c = np.asarray(np.linalg.solve(normal, weighted @ y))
        off = np.abs(A @ c - y)
        scale = np.maximum(np.median(off, axis=1, keepdims=True), 1e-300)
        w = 1 / (1 + ((off / (_FAR * scale)) ** 2).sum(axis=-1)) ** 2
    d = points.shape[1]
    lever = np.asarray(np.linalg.inv(normal)[:, 0, 0], dtype=np.float64)
    slopes = c[:, 1 : d + 1].swapaxes(1, 2) / reach[..., None]
    return LocalFit(c[:, 0], slopes, 1.4826 * np.median(off, axis=1), lever)


def noise(points: Floats, values: Floats, neighbours: int = 20) -> tuple[Floats, Floats]:
    """Residuals (n, c) of every point about a local quadratic of it and its nearest, and what they
    say of the noise (c,): less than it is, by the share of itself that a point fits."""
    fit = local_fit(points, values, points, neighbours)
    off = values - fit.values
    sd = np.sqrt((off**2).sum(axis=0) / (1 - fit.lever).sum())
    return off, np.asarray(sd, dtype=np.float64)


def best_neighbours(points: Floats, values: Floats, rows: Ints, counts: Sequence[int]) -> int:
    """Which of `counts` predicts values (n, c) at left-out points best, of those at `rows`: fewer
    neighbours hand on their noise, more smooth the field. At most 400 rows are tried."""
    _, sd = noise(points[rows], values[rows])
    some = rows[:: -(-len(rows) // _TRIED)]

    def missed(count: int) -> float:
        fit = local_fit(points, values, points[some], count, others=True, robust=True)
        off = (values[some] - fit.values) / np.maximum(sd, 1e-300)
        return float(np.minimum(off**2, _WILD).mean())

    return min((n for n in counts if n <= max(len(points) // 4, counts[0])), key=missed)


_FEWEST = 60  # particles that local fits need
_AGREE, _SAME = 0.6, 0.12  # share of 12 neighbours, within that many spacings
_NEAR, _TOUCH = 1.6, 4  # spacings within which a particle of the front has so many linked ones
_REACH = 0.25  # spacings from the predicted place to a partner
_OFF = 0.08  # spacings off its neighbours' motion that a link may always be while the front walks
_YOUNG, _ROUNDS = 8, 150  # rounds in which a link is looked at again; rounds at most
_CUT, _CLEANED = 4.5, 3  # robust deviations that cut a link at the end; times that is done
_PARTNER = 5.0  # standard deviations of the noise within which a late partner is taken


@dataclass(frozen=True)
class Linked:
    """`pairs` (k, 2): rows of the two clouds; `cut`: links taken back at the end, as outliers.

    `seeds` are the links that agreed at once, `noise` (d,) m the robust standard deviation about
    local motion, `spacing` m the mean distance of particles.
    """

    pairs: Ints
    cut: int
    seeds: int
    noise: Floats
    spacing: float


def link(before: Floats, after: Floats) -> Linked:
    """Links the particles before (n, 3) m and after (m, 3) m.

    Raises `RegistrationError` for too few particles, and where nothing stands still: without a
    part that moves less than half a spacing no link is safe.
    """
    for x, name in ((before, "before"), (after, "after")):
        checked(x, f"particles {name} [m]", (None, 3), error=RegistrationError)
        if len(x) < _FEWEST:
            raise RegistrationError(f"{len(x)} particles {name}: linking needs {_FEWEST}")
    front = _Front(before, after)
    seeds = front.seeded()
    front.walk()
    cut = sum(front.cleaned(last=k == _CLEANED - 1) for k in range(_CLEANED))
    rows = np.flatnonzero(front.to >= 0)
    pairs = np.stack([rows, front.to[rows]], axis=1)
    return Linked(pairs, cut, seeds, front.noise, front.spacing)


def _nearest(points: Floats, at: Floats, count: int = 1) -> Ints:
    """Rows (m,) or (m, count) of the points nearest to every place."""
    return np.asarray(cKDTree(points).query(at, count)[1])


class _Front:
    """What is linked so far: `to` (n,) the partner of every particle, -1 none."""

    def __init__(self, before: Floats, after: Floats) -> None:
        self.before, self.after = before, after
        volume = float(np.prod(np.ptp(before, axis=0)))
        self.spacing = (volume / len(before)) ** (1 / 3)
        self.to = np.full(len(before), -1)
        self.noise = np.zeros(3)

    def _links(self) -> tuple[Ints, Floats, Floats]:
        rows = np.flatnonzero(self.to >= 0)
        x = self.before[rows]
        return rows, x, self.after[self.to[rows]] - x

    def seeded(self) -> int:
        """Mutual nearest partners whose neighbours move alike."""
        there = _nearest(self.after, self.before)
        back = _nearest(self.before, self.after[there])
        rows = np.flatnonzero(back == np.arange(len(self.before)))
        x = self.before[rows]
        u = self.after[there[rows]] - x
        near = _nearest(x, x, min(13, len(x)))
        apart = np.linalg.norm(u[near[:, 1:]] - u[:, None], axis=-1)
        good = rows[(apart < _SAME * self.spacing).mean(axis=1) >= _AGREE]
        if len(good) < _FEWEST:
            raise RegistrationError(
                f"{len(good)} of {len(self.before)} particles have a partner on which their "
                f"neighbours agree; {_FEWEST} are needed. Each part of the body must move by less "
                f"than half the spacing of {1e6 * self.spacing:.3g} um; shift one of the clouds, "
                f"or record images in smaller steps"
            )
        self.to[good] = there[good]
        return len(good)

    def walk(self) -> None:
        """Until nearly nothing is won."""
        age = np.where(self.to >= 0, _YOUNG, 0)
        for k in range(_ROUNDS):
            _, x, u = self._links()
            young = self._near(np.flatnonzero(age < _YOUNG), x)
            had = int((self.to[young] >= 0).sum())
            predicted = self.before[young] + self._moved(young, x, u)
            self.to[young] = -1
            self._take(young, predicted, _REACH * self.spacing, np.ones(3))
            rows, x, u = self._links()
            new = np.isin(rows, young)
            fit = local_fit(x, u, x[new], 24, 1, others=True, robust=True)
            off = np.linalg.norm(u[new] - fit.values, axis=1)
            allowed = np.maximum(4 * np.linalg.norm(fit.spread, axis=1), _OFF * self.spacing)
            self.to[rows[new][off > allowed]] = -1
            age = np.where(self.to >= 0, age + 1, 0)
            if k > 3 and int((self.to[young] >= 0).sum()) - had < 0.002 * len(young):
                return

    def _near(self, rows: Ints, x: Floats) -> Ints:
        distance = np.asarray(cKDTree(x).query(self.before[rows], _TOUCH)[0])
        return np.asarray(rows[distance[:, -1] < _NEAR * self.spacing])

    def _moved(self, rows: Ints, x: Floats, u: Floats) -> Floats:
        """Motion (k, 3) m by the linked neighbours alone, its own link left out."""
        found, own = np.empty((len(rows), 3)), self.to[rows] >= 0
        for some, others in ((~own, False), (own, True)):
            at = self.before[rows[some]]
            found[some] = local_fit(x, u, at, 16, 1, others=others, robust=True).values
        return found

    def _take(self, rows: Ints, predicted: Floats, reach: float, scale: Floats) -> None:
        """The nearest free partner within `reach`, each once, the nearest first."""
        free = np.setdiff1d(np.arange(len(self.after)), self.to[self.to >= 0])
        tree = cKDTree(self.after[free] / scale)
        both = tree.query(predicted / scale, distance_upper_bound=reach)
        distance, at = (np.asarray(part) for part in both)
        found = np.flatnonzero(np.isfinite(distance))
        found = found[np.argsort(distance[found], kind="stable")]
        partner, first = np.unique(free[at[found]], return_index=True)
        self.to[rows[found[first]]] = partner

    def cleaned(self, last: bool) -> int:
        """Cuts what deviates from a local quadratic of its neighbours; but for the `last` time,
        links what is then predicted well. How many were cut."""
        rows, x, u = self._links()
        fit = local_fit(x, u, x, 30, others=True, robust=True)
        off = np.abs(u - fit.values)
        self.noise = 1.4826 * np.median(off, axis=0)
        bad = (off / np.maximum(fit.spread, self.noise)).max(axis=1) > _CUT
        self.to[rows[bad]] = -1
        if not last:
            _, x, u = self._links()
            left = self._near(np.flatnonzero(self.to < 0), x)
            moved = local_fit(x, u, self.before[left], 24, robust=True).values
            self._take(left, self.before[left] + moved, _PARTNER, self.noise)
        return int(bad.sum())
