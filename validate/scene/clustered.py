"""Blocks of hexahedra whose cells are small around one point, for contact there."""

from dataclasses import replace
from math import exp, log, sinh

import numpy as np
from scipy.optimize import brentq

from validate.arrays import Floats
from validate.scene.box import grid
from validate.scene.mesh import Mesh

_EVEN = 1.01  # smallest cell over mean cell above which a line stays even


def clustered_block(
    low: tuple[float, ...],
    high: tuple[float, ...],
    cells: tuple[int, ...],
    at: tuple[float, ...],
    share: tuple[float, ...],
) -> Mesh:
    """Return hexahedra of [low, high] m with sets "x0", "x1", ..., clustered around the point `at`.

    `share`: length of the cells at that point over the mean one, per axis (1: even). The lines of a
    finer grid lie on the same map of [0, 1], so that grids of one share are similar.
    """
    size = tuple(b - a for a, b in zip(low, high, strict=True))
    mesh = grid(size, cells)
    nodes = np.stack(
        [
            low[c] + size[c] * clustered(mesh.nodes[:, c] / size[c], (at[c] - low[c]) / size[c], s)
            for c, s in enumerate(share)
        ],
        axis=1,
    )
    return replace(mesh, nodes=nodes)


def clustered(t: Floats, at: float, share: float) -> Floats:
    """Return x(t) in [0, 1], monotone, with slope `share` where x = `at`.

    x = at (1 + sinh(k (t - B)) / sinh(k B)): Roberts' interior clustering (Tannehill, Anderson,
    Pletcher, Computational Fluid Mechanics and Heat Transfer, 2nd ed. 1997, eq 5.221).
    """
    at = min(max(at, 0.0), 1.0)
    if share * _EVEN >= 1:
        return t
    k = brentq(lambda k: _slope(k, at) - share, 1e-6, 60.0)
    B = _middle(k, at)
    # Both forms of one map: at an end B or 1 - B is 0, and one of them divides by it.
    if at >= 0.5:
        return np.asarray(at * (1 + np.sinh(k * (t - B)) / sinh(k * B)))
    return np.asarray(at + (1 - at) * np.sinh(k * (t - B)) / sinh(k * (1 - B)))


def _middle(k: float, at: float) -> float:
    return log(((1 - at) + at * exp(k)) / ((1 - at) + at * exp(-k))) / (2 * k)


def _slope(k: float, at: float) -> float:
    B = _middle(k, at)
    return at * k / sinh(k * B) if at >= 0.5 else (1 - at) * k / sinh(k * (1 - B))
