"""Volume (area) of a closed cavity and the load of its pressure, linear and quadratic facets.

V = 1/d closed integral of x . n dA (paper 000, eqs 12-13, in the plane eq 11, whose two printed
forms have opposite signs), n pointing from the fluid into the solid; the load of a unit pressure is
its exact derivative, f_p = dV/dx (eq 8, consistent nodal forces). Facet sets point out of the
solid, so into the fluid: signs are turned here, once.

Departures: the trilinear form is integrated exactly on the facet instead of Mirtich's projections
(eqs 14-16), which divide by zero on flat facets; positions are taken about the cavity's centroid,
without which a far origin cancels digits.
"""

from dataclasses import dataclass
from itertools import permutations

import numpy as np
from scipy import sparse

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.fem.kernels.jit_cache import compiled
from validate.scene.mesh import Mesh
from validate.scene.shape_functions import Quadrature, facet_rule, simplex_rule


@dataclass(frozen=True)
class CavitySurface:
    """A closed surface in the mesh: facets (f, m) of node numbers, `nodes` (c,) sorted, unique."""

    name: str
    facets: Ints
    nodes: Ints

    def local(self) -> Ints:
        """Return the facets (f, m) in positions of `nodes`."""
        return np.searchsorted(self.nodes, self.facets)

    def volume(self, positions: Floats) -> float:
        """Volume m^3 for the positions (n, d) m of all mesh nodes; in 2-D m^3 per metre."""
        return float(volume_form(self, positions[None])[0, 0, 0])

    def pressure_load(self, positions: Floats) -> Floats:
        """dV/dx (n, d) m^(d - 1): nodal forces of a unit pressure, fluid pushing on the solid."""
        rule = _rule(self, positions)
        x = positions[self.facets]
        along = rule.jacobians(x)
        # Normals (f, q, d) into the solid, as long as the facet is large
        if x.shape[2] == 2:
            normals = np.stack([-along[..., 1, 0], along[..., 0, 0]], axis=-1)
        else:
            normals = -np.cross(along[..., 0], along[..., 1])
        nodal = np.einsum("q,qm,fqd->fmd", rule.weights, rule.N, normals)
        load = np.zeros_like(positions)
        np.add.at(load, self.facets, nodal)
        return load


def cavity_surface(mesh: Mesh, name: str, facets: str) -> CavitySurface:
    """Return the named facet set as a cavity; raises `SceneError` when open, flipped or inside
    out."""
    surface = CavitySurface(name, mesh.facets[facets], mesh.facet_nodes(facets))
    (_require_closed_line if mesh.dimension == 2 else _require_closed)(surface)
    volume = surface.volume(mesh.nodes)
    if volume <= 0:
        raise SceneError(f"cavity '{name}' is turned inside out: volume {1e9 * volume:.4g} mm3")
    return surface


def _require_closed(surface: CavitySurface) -> None:
    corners = surface.facets[:, :3]
    edges = corners[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    _, uses = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
    if (uses != 2).any():
        raise SceneError(
            f"cavity '{surface.name}' is open: {int((uses != 2).sum())} edges that belong to "
            "one facet only"
        )
    _, same_way = np.unique(edges, axis=0, return_counts=True)
    if (same_way != 1).any():
        count = int((same_way != 1).sum())
        raise SceneError(f"cavity '{surface.name}': at {count} edges two facets face opposite ways")


def _require_closed_line(surface: CavitySurface) -> None:
    starts, ends = np.sort(surface.facets[:, 0]), np.sort(surface.facets[:, 1])
    if not np.array_equal(starts, ends) or len(np.unique(starts)) != len(starts):
        raise SceneError(f"cavity '{surface.name}' is open or its facets face opposite ways")


def volume_form(surface: CavitySurface, columns: Floats) -> Floats:
    """T (k, k, k), symmetric: V = sum T_abc z_a z_b z_c for positions sum_a z_a columns_a.

    `columns` (k, n, d): the rest positions first, then displacement fields. A translation of a
    closed surface leaves its volume, so every column is centred for the digits' sake.
    """
    k, d = len(columns), columns.shape[2]
    x = columns[:, surface.nodes]
    x = x - x.mean(axis=1, keepdims=True)
    if surface.facets.shape[1] == 3 and d == 3:
        return flat_form(surface.local(), x)
    x = x[:, surface.local()]
    rule = _rule(surface, columns[0])
    weighted = (np.einsum("qm,kfmd->kfqd", rule.N, x) * rule.weights[:, None]).reshape(k, -1)
    along = np.einsum("qmj,kfmd->jkfqd", rule.dN, x)
    T = np.zeros((k, k, k))
    if d == 2:  # an area is bilinear: its first factor is the constant one of the rest shape
        normals = np.stack([-along[0, ..., 1], along[0, ..., 0]], axis=-1)
        T[0] = weighted @ normals.reshape(k, -1).T / d
    else:
        normals = -np.cross(along[0][:, None], along[1][None])
        T = (weighted @ normals.reshape(k * k, -1).T).reshape(k, k, k) / d
    return np.asarray(sum(T.transpose(p) for p in permutations(range(3))) / 6)


@compiled(fastmath=True)
def flat_form(facets: Ints, x: Floats) -> Floats:
    """`volume_form` of triangles (f, 3) in positions of x (k, c, 3): -det(x_a, x_b, x_c)/6 of each,
    its mean over the orders of a, b, c."""
    k = len(x)
    T = np.zeros((k, k, k))
    for f in range(len(facets)):
        p, q, r = facets[f]
        for b in range(k):
            for c in range(k):
                n0 = x[b, q, 1] * x[c, r, 2] - x[b, q, 2] * x[c, r, 1]
                n1 = x[b, q, 2] * x[c, r, 0] - x[b, q, 0] * x[c, r, 2]
                n2 = x[b, q, 0] * x[c, r, 1] - x[b, q, 1] * x[c, r, 0]
                for a in range(k):
                    T[a, b, c] -= x[a, p, 0] * n0 + x[a, p, 1] * n1 + x[a, p, 2] * n2
    mean = np.empty_like(T)
    for a in range(k):
        for b in range(k):
            for c in range(k):
                mean[a, b, c] = (T[a, b, c] + T[b, c, a] + T[c, a, b]
                                 + T[b, a, c] + T[a, c, b] + T[c, b, a]) / 36  # fmt: skip
    return mean


def _rule(surface: CavitySurface, positions: Floats) -> Quadrature:
    """Exact for the volume and its load; flat facets need their middle alone."""
    d, nodes = positions.shape[1], surface.facets.shape[1]
    if nodes == d:
        return simplex_rule(1, np.full((1, d), 1 / d), np.array([1 / (d - 1)]))
    return facet_rule(d, nodes)


# --- The second derivative of a cavity's volume: the stiffness of a pressure that follows the
# wall.
#
# V = sum over facets of -1/3 A_abc det(x_a, x_b, x_c), A antisymmetric, so that its Hessian is
# exact and symmetric, d2V/dx_a dx_b = 2 A_abc [x_c]x. It agrees with the gradient of `cavity` on
# closed surfaces, the only ones there are.


def volume_hessian(surface: CavitySurface, positions: Floats) -> sparse.csr_array:
    """d2V/dx2 (N, N) m for the positions (n, 3) m of all mesh nodes, N = 3 n.

    In 2-D it is (N, N) without a unit, N = 2 n.
    """
    if positions.shape[1] == 2:
        count = surface.facets.shape[1]
        rule = facet_rule(2, count)
        M = np.einsum("q,qa,qb->ab", rule.weights, rule.N, rule.dN[..., 0])
        turn = np.array([[0.0, -1.0], [1.0, 0.0]])
        block = np.einsum("ab,ij->aibj", (M - M.T) / 2, turn)
        blocks = np.broadcast_to(block, (len(surface.facets), *block.shape))
        return _assembled(surface, blocks, positions)
    x = positions[surface.facets] - positions[surface.nodes].mean(axis=0)
    blocks = 2 * np.einsum("abc,fcij->faibj", _antisymmetric(x.shape[1]), _cross_matrix(x))
    return _assembled(surface, blocks, positions)


def _assembled(surface: CavitySurface, blocks: Floats, positions: Floats) -> sparse.csr_array:
    """Blocks (f, m, d, m, d) of all facets, summed at their unknowns."""
    d = positions.shape[1]
    unknowns = (d * surface.facets[..., None] + np.arange(d)).reshape(len(surface.facets), -1)
    m = unknowns.shape[1]
    rows, columns = np.repeat(unknowns, m, axis=1).ravel(), np.tile(unknowns, m).ravel()
    shape = (positions.size, positions.size)
    return sparse.csr_array((blocks.ravel(), (rows, columns)), shape=shape)


def _antisymmetric(per_facet: int) -> Floats:
    """A (m, m, m): the facet's integrals of N_a dN_b/dxi dN_c/deta, signed mean of all orders."""
    rule = facet_rule(3, per_facet)
    M = np.einsum("q,qa,qb,qc->abc", rule.weights, rule.N, rule.dN[..., 0], rule.dN[..., 1])
    signed = [np.linalg.det(np.eye(3)[list(p)]) * M.transpose(p) for p in permutations(range(3))]
    return np.asarray(np.mean(signed, axis=0))


def _cross_matrix(x: Floats) -> Floats:
    """[x]x (..., 3, 3): the matrix of y -> x cross y."""
    rows = np.zeros((*x.shape, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        rows[..., i, k], rows[..., k, i] = x[..., j], -x[..., j]
    return rows
