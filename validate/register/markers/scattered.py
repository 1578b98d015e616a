"""Interpolation of scattered values: local polynomials through the nearest points."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from validate.arrays import Floats, Ints

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
    A = _terms((points[index] - at[:, None]) / reach[..., None], order)
    y, w = values[index], np.ones(distance.shape)
    for _ in range(3 if robust else 1):
        normal, c = _solved(A, y, w)
        off = np.abs(A @ c - y)
        scale = np.maximum(np.median(off, axis=1, keepdims=True), 1e-300)
        w = 1 / (1 + ((off / (_FAR * scale)) ** 2).sum(axis=-1)) ** 2
    d = points.shape[1]
    lever = np.asarray(np.linalg.inv(normal)[:, 0, 0], dtype=np.float64)
    slopes = c[:, 1 : d + 1].swapaxes(1, 2) / reach[..., None]
    return LocalFit(c[:, 0], slopes, 1.4826 * np.median(off, axis=1), lever)


def _solved(A: Floats, y: Floats, w: Floats) -> tuple[Floats, Floats]:
    weighted = (A * w[..., None]).swapaxes(1, 2)
    normal = weighted @ A + _EVEN * np.eye(A.shape[-1])
    return normal, np.asarray(np.linalg.solve(normal, weighted @ y))


def _terms(x: Floats, order: int) -> Floats:
    """Monomials (..., p) up to `order` of places (..., d)."""
    d = x.shape[-1]
    terms = [np.ones(x.shape[:-1]), *np.moveaxis(x, -1, 0)]
    if order == 2:
        terms += [x[..., i] * x[..., j] for i in range(d) for j in range(i, d)]
    return np.stack(terms, axis=-1)


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
