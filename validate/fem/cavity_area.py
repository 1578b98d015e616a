"""Area of a closed cavity in the plane and the load of its pressure (paper 000, eq 11).

A = 1/2 closed integral of x y' - y x' ds, counter-clockwise. Facets run with the solid on their
left, so clockwise around the cavity: the sign is turned here, once. (The paper's two forms of
eq 11 have opposite signs.)
"""

import numpy as np

from validate.arrays import Floats, Ints

# Three Gauss points on 0 <= s <= 1: exact to degree 5, for edges with a middle node too.
_S = 0.5 + np.array([-1.0, 0.0, 1.0]) * np.sqrt(0.15)
_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18


def area_bilinear(facets: Ints, a: Floats, b: Floats) -> float:
    """-1/2 integral of a x b' over facets (f, m) for fields a, b (n, 2) m."""
    N, dN = _edge_shapes(facets.shape[1])
    value, slope = np.einsum("qm,fmd->fqd", N, a[facets]), np.einsum("qm,fmd->fqd", dN, b[facets])
    cross = value[..., 0] * slope[..., 1] - value[..., 1] * slope[..., 0]
    return float(-0.5 * np.einsum("q,fq->", _WEIGHTS, cross))


def area_load(facets: Ints, positions: Floats) -> Floats:
    """dA/dx (n, 2) m: nodal forces of a unit pressure per metre of thickness."""
    N, dN = _edge_shapes(facets.shape[1])
    slope = np.einsum("qm,fmd->fqd", dN, positions[facets])
    outward = np.stack([-slope[..., 1], slope[..., 0]], axis=-1)  # from the fluid into the solid
    load = np.zeros_like(positions)
    np.add.at(load, facets, np.einsum("q,qm,fqd->fmd", _WEIGHTS, N, outward))
    return load


def _edge_shapes(per_facet: int) -> tuple[Floats, Floats]:
    """N, dN/ds (q, m) of edges with 2 or 3 nodes (the middle one last)."""
    L = np.stack([1 - _S, _S], axis=1)
    dL = np.array([[-1.0, 1.0]] * len(_S))
    if per_facet == 2:
        return L, dL
    middle, slope = 4 * L[:, :1] * L[:, 1:], 4 * (L[:, :1] - L[:, 1:])
    return np.hstack([L * (2 * L - 1), middle]), np.hstack([(4 * L - 1) * dL, slope])
