"""Interior error E_i: how far apart two fields put the points of a body (paper 002, III C).

The paper integrates the distance over the body at rest and divides by the root of the area (the
cube root of the volume), which leaves m^2 (m^3); divided by the area (volume) it is a mean
distance in m. Both are given.

Departures: integrated by quadrature. The paper's sum over nodes is an upper bound for linear
elements, needs the weights w_a (it prints none; an unweighted sum grows with the mesh), and fails
for quadratic tetrahedra, whose vertex weights are negative.
"""

import numpy as np

from validate.compare.metric import Counted, Metric
from validate.compare.pair import FieldPair
from validate.fem.cells import rule, values_at, volumes_at

_POINTS = 4  # Gauss points along an axis; the distance has a kink where the fields agree


def printed(pair: FieldPair) -> float:
    """E_i with the paper's normaliser: integral of |u' - u| over |M0|^(1/d); m^2 (2-D), m^3."""
    distance, volume = _integrals(pair)
    return distance / float(volume ** (1 / pair.on.dimension))


def mean_distance(pair: FieldPair) -> float:
    """Integral of |u' - u| over the volume (area), m."""
    distance, volume = _integrals(pair)
    return distance / volume


def _integrals(pair: FieldPair) -> tuple[float, float]:
    points = rule(pair.on, _POINTS)
    dv = volumes_at(pair.on, points)
    distance = np.linalg.norm(values_at(pair.on, points, pair.difference), axis=2)
    return float((dv * distance).sum()), float(dv.sum())


_POINTS_OF: Counted[FieldPair] = Counted(
    "quadrature points", lambda p: len(p.on.cells) * len(rule(p.on, _POINTS).weights)
)

INTERIOR_METRICS: tuple[Metric[FieldPair], ...] = (
    Metric(
        "E_i",
        printed,
        "m^{dimension}",
        "interior error as printed (paper 002, III C): integral of |u' - u| over the body at rest, "
        "over the square root of its area (cube root of its volume)",
        _POINTS_OF,
        symmetric=True,
    ),
    Metric(
        "E_i.mean",
        mean_distance,
        "m",
        "mean distance: integral of |u' - u| over the body at rest, over its area (volume)",
        _POINTS_OF,
        symmetric=True,
    ),
)
