"""Norms of the difference of two displacement fields (paper 002, III A).

The paper's "energy norm" sums squares over nodes: it depends on where the nodes lie. The L2 norm
weighs by mass; the energy norm proper, root of e^T K e, is the strain energy of the difference.
"""

import numpy as np

from validate.arrays import Floats
from validate.compare.metric import Counted, Metric
from validate.compare.pair import FieldPair
from validate.errors import ComparisonError
from validate.fem.cells import rule, values_at, volumes_at

_POINTS = 3  # Gauss points along an axis: degree 5 holds the square of a quadratic field


def relative_nodal_norm(pair: FieldPair) -> float:
    """E_n = |u' - u| / |u| over all nodal components (paper 002, eq 1); 0/0 at rest is refused."""
    return _relative(
        float(np.linalg.norm(pair.difference)), float(np.linalg.norm(pair.u_other)), pair, "E_n"
    )


def relative_l2_norm(pair: FieldPair) -> float:
    """Root of (integral of rho |u' - u|^2) over (integral of rho |u|^2)."""
    top, bottom = _l2(pair, pair.difference), _l2(pair, pair.u_other)
    return _relative(top, bottom, pair, "the L2 norm")


def rms_difference(pair: FieldPair) -> float:
    """Root of (integral of rho |u' - u|^2) over the mass, m."""
    ones = np.ones((len(pair.on.nodes), 1))
    return _l2(pair, pair.difference) / _l2(pair, ones)


def relative_energy_norm(pair: FieldPair) -> float:
    """Root of (e^T K e) over (u^T K u), e = u' - u."""
    return _relative(
        energy_norm(pair, pair.difference), energy_norm(pair, pair.u_other), pair, "the energy norm"
    )


def energy_norm_of_difference(pair: FieldPair) -> float:
    """Root of e^T K e, J^(1/2)."""
    return energy_norm(pair, pair.difference)


def energy_norm(pair: FieldPair, u: Floats) -> float:
    """Root of u^T K u, J^(1/2), of a field u (n, d) m on the pair's mesh.

    Raises `ComparisonError` without a scene, which holds the moduli.
    """
    v = u.ravel()
    # Rounding can leave a rigid motion a hair below zero.
    return float(np.sqrt(max(0.0, float(v @ (pair.common.K @ v)))))


def _l2(pair: FieldPair, values: Floats) -> float:
    """Root of the integral of rho |values (n, c)|^2."""
    points = rule(pair.on, _POINTS)
    square = (values_at(pair.on, points, values) ** 2).sum(axis=2)
    per_cell = (volumes_at(pair.on, points) * square).sum(axis=1)
    return float(np.sqrt(per_cell @ pair.common.density))


def _relative(top: float, bottom: float, pair: FieldPair, what: str) -> float:
    if bottom == 0:
        raise ComparisonError(
            f"{what} is {'0' if top == 0 else f'{top:.3g}'}/0: {pair.other.name} does not move "
            "there (rest, t = 0); compare a later time or take an absolute metric"
        )
    return top / bottom


_NODES: Counted[FieldPair] = Counted("nodes", lambda p: len(p.on.nodes))

FIELD_METRICS: tuple[Metric[FieldPair], ...] = (
    Metric(
        "E_n",
        relative_nodal_norm,
        "1",
        "relative norm of paper 002, eq 1: root of the sum over nodes of |u' - u|^2 over that "
        "of |u|^2, as printed; it is unweighted and depends on the mesh",
        _NODES,
    ),
    Metric(
        "L2.relative",
        relative_l2_norm,
        "1",
        "mass-weighted L2 norm of u' - u over that of u, by quadrature; equal densities cancel",
        _NODES,
    ),
    Metric(
        "L2.rms",
        rms_difference,
        "m",
        "root mean square of |u' - u| over the mass, by quadrature",
        _NODES,
        symmetric=True,
    ),
)

ENERGY_METRICS: tuple[Metric[FieldPair], ...] = (
    Metric(
        "energy.relative",
        relative_energy_norm,
        "1",
        "energy norm of u' - u over that of u: root of e^T K e over u^T K u, linear elasticity",
        _NODES,
    ),
    Metric(
        "energy",
        energy_norm_of_difference,
        "J^(1/2)",
        "energy norm of u' - u: root of e^T K e, twice the strain energy of the difference",
        _NODES,
        symmetric=True,
    ),
)
