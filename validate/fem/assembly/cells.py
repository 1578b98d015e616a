"""Integrals over the cells of a mesh of any kind, deformed or at rest."""

import numpy as np

from validate.arrays import Floats
from validate.scene.mesh import Mesh
from validate.scene.shape_functions import (
    CORNERS,
    EDGES,
    LATTICE,
    Quadrature,
    barycentric,
    brick_rule,
    collapsed_points,
    gauss_points,
    simplex_rule,
)


def rule(mesh: Mesh, points: int) -> Quadrature:
    """`points` Gauss points along each axis: exact to degree 2 points - 1."""
    inside = gauss_points if mesh.bricks else collapsed_points
    return _rule_at(mesh, *inside(mesh.dimension, points))


def nodal_rule(mesh: Mesh) -> Quadrature:
    """Shapes at the nodes of a cell, without weights: where slopes of linear fields peak."""
    if mesh.bricks:
        xi: Floats = (CORNERS if mesh.order == 1 else LATTICE)[mesh.dimension]
    else:
        xi = np.vstack([np.zeros(mesh.dimension), np.eye(mesh.dimension)])
        if mesh.order == 2:
            xi = np.vstack([xi, xi[np.array(EDGES[mesh.dimension])].mean(axis=1)])
    return _rule_at(mesh, xi, np.zeros(len(xi)))


def _rule_at(mesh: Mesh, xi: Floats, weights: Floats) -> Quadrature:
    if mesh.bricks:
        return brick_rule(xi, weights, mesh.order)
    return simplex_rule(mesh.order, barycentric(xi), weights)


def jacobians(mesh: Mesh, rule: Quadrature, u: Floats | None = None) -> Floats:
    """det dx/dxi (e, q) of the mesh, moved by u (n, d) m when given; not positive = inverted."""
    x = mesh.nodes if u is None else mesh.nodes + u
    return np.asarray(np.linalg.det(rule.jacobians(x[mesh.cells])))


def volumes_at(mesh: Mesh, rule: Quadrature) -> Floats:
    """Weight times volume (e, q) m^d: an integral is the sum of these times the integrand."""
    return rule.weights * jacobians(mesh, rule)


def values_at(mesh: Mesh, rule: Quadrature, nodal: Floats) -> Floats:
    """Nodal values (n, c) interpolated at the quadrature points (e, q, c)."""
    return rule.at(nodal[mesh.cells])
