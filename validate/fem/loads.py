"""Nodal forces of the scene's loads, per newton of their inputs, per m/s^2 of a weight."""

import numpy as np

from validate.arrays import Floats, Ints
from validate.fem.assemble import mass
from validate.scene.mesh import Mesh
from validate.scene.scene import Load, Scene, Weight
from validate.scene.shape_functions import facet_rule


def load_columns(scene: Scene) -> Floats:
    """Forces (N, l) on all unknowns for one newton or m/s^2 of each load, node-major.

    Raises `SceneError` for a weight without densities.
    """
    columns = np.zeros((scene.mesh.nodes.size, len(scene.loads)))
    for j, load in enumerate(scene.loads):
        if isinstance(load, Weight):
            columns[:, j] = mass(scene) @ np.tile(load.direction, len(scene.mesh.nodes))
            continue
        columns[:, j] = np.outer(_nodal(scene.mesh, load), load.direction).ravel()
    return columns


def _nodal(mesh: Mesh, load: Load) -> Floats:
    """The share (n,) of the input that every node takes."""
    shares = np.zeros(len(mesh.nodes))
    if load.spread == "consistent":
        facets = mesh.facets[load.facets]
        parts = facet_integrals(mesh, facets)
        np.add.at(shares, facets, parts / parts.sum())
        return shares
    nodes = mesh.facet_nodes(load.facets)
    shares[nodes] = 1.0 if load.spread == "per_node" else 1 / len(nodes)
    return shares


def facet_integrals(mesh: Mesh, facets: Ints) -> Floats:
    """Integral of every node's shape function (f, m) over its facet, m^(d - 1)."""
    rule = facet_rule(mesh.dimension, facets.shape[1])
    J = rule.jacobians(mesh.nodes[facets])
    normal = np.cross(J[..., 0], J[..., 1]) if mesh.dimension == 3 else J[..., 0]
    return np.asarray(rule.weights * np.linalg.norm(normal, axis=-1) @ rule.N)
