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

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.scene.mesh import Mesh
from validate.scene.shape_functions import Quadrature, facet_rule


@dataclass(frozen=True)
class CavitySurface:
    """A closed surface in the mesh: facets (f, m) of node numbers, `nodes` (c,) sorted, unique."""

    name: str
    facets: Ints
    nodes: Ints

    def local(self) -> Ints:
        """The facets (f, m) in positions of `nodes`."""
        return np.searchsorted(self.nodes, self.facets)


def cavity_surface(mesh: Mesh, name: str, facets: str) -> CavitySurface:
    """The named facet set as a cavity; raises `SceneError` when open, flipped or inside out."""
    surface = CavitySurface(name, mesh.facets[facets], mesh.facet_nodes(facets))
    (_require_closed_line if mesh.dimension == 2 else _require_closed)(surface)
    volume = volume_of(surface, mesh.nodes)
    if volume <= 0:
        raise SceneError(f"cavity '{name}' is inside out: volume {1e9 * volume:.4g} mm3")
    return surface


def _require_closed(surface: CavitySurface) -> None:
    corners = surface.facets[:, :3]
    edges = corners[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    _, uses = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
    if (uses != 2).any():
        raise SceneError(
            f"cavity '{surface.name}' is open: {int((uses != 2).sum())} edges without partner"
        )
    _, same_way = np.unique(edges, axis=0, return_counts=True)
    if (same_way != 1).any():
        count = int((same_way != 1).sum())
        raise SceneError(f"cavity '{surface.name}': at {count} edges two facets face opposite ways")


def _require_closed_line(surface: CavitySurface) -> None:
    starts, ends = np.sort(surface.facets[:, 0]), np.sort(surface.facets[:, 1])
    if not np.array_equal(starts, ends) or len(np.unique(starts)) != len(starts):
        raise SceneError(f"cavity '{surface.name}' is open or its facets face opposite ways")


def volume_of(surface: CavitySurface, positions: Floats) -> float:
    """Volume m^3 for the positions (n, d) m of all mesh nodes; in 2-D m^3 per metre."""
    x = positions[surface.nodes]
    return float(_trilinear(surface, *(3 * [x - x.mean(axis=0)])))


def pressure_load(surface: CavitySurface, positions: Floats) -> Floats:
    """dV/dx (n, d) m^(d - 1): nodal forces of a unit pressure, fluid pushing on the solid."""
    rule = _rule(surface, positions)
    x = positions[surface.facets]
    nodal = np.einsum("q,qm,fqd->fmd", rule.weights, rule.N, _into_solid(rule, x, x))
    load = np.zeros_like(positions)
    np.add.at(load, surface.facets, nodal)
    return load


def volume_form(surface: CavitySurface, columns: Floats) -> Floats:
    """T (k, k, k), symmetric: V = sum T_abc z_a z_b z_c for positions sum_a z_a columns_a.

    `columns` (k, n, d): the rest positions first, then displacement fields. A translation of a
    closed surface leaves its volume, so every column is centred for the digits' sake.
    """
    k = len(columns)
    local = columns[:, surface.nodes] - columns[:, surface.nodes].mean(axis=1, keepdims=True)
    T = np.zeros((k, k, k))
    # An area is bilinear: its first factor is the constant one that stands with the rest shape.
    firsts = range(1 if columns.shape[2] == 2 else k)
    for a in firsts:
        for b in range(k):
            for c in range(k):
                T[a, b, c] = _trilinear(surface, local[a], local[b], local[c])
    return np.asarray(np.mean([T.transpose(p) for p in permutations(range(3))], axis=0))


def _trilinear(surface: CavitySurface, a: Floats, b: Floats, c: Floats) -> Floats:
    local, rule, d = surface.local(), _rule(surface, a), a.shape[1]
    value = a if d == 3 else b
    normal = _into_solid(rule, b[local], c[local])
    return np.asarray(np.einsum("q,fqd,fqd->", rule.weights, rule.at(value[local]), normal) / d)


def _into_solid(rule: Quadrature, b: Floats, c: Floats) -> Floats:
    """Normals (f, q, d) of facets with nodes b and c (f, m, d): bilinear, in the plane of c."""
    if c.shape[2] == 2:
        along = rule.jacobians(c)[..., 0]
        return np.stack([-along[..., 1], along[..., 0]], axis=-1)
    return np.asarray(-np.cross(rule.jacobians(b)[..., 0], rule.jacobians(c)[..., 1]))


def _rule(surface: CavitySurface, positions: Floats) -> Quadrature:
    return facet_rule(positions.shape[1], surface.facets.shape[1])
