"""Nodal forces of the scene's loads, per newton of their inputs, per m/s^2 of a weight."""

import numpy as np

from validate.arrays import Floats, Ints
from validate.fem.assemble import mass
from validate.scene.bricks import gauss_points, jacobians, shapes
from validate.scene.mesh import Mesh
from validate.scene.scene import Load, Scene, Weight

# Shares of a uniform traction at the nodes of a straight facet, vertices first.
_SHARES = {
    "tri3": (1 / 2, 1 / 2),
    "quad4": (1 / 2, 1 / 2),
    "tri6": (1 / 6, 1 / 6, 4 / 6),
    "tet4": (1 / 3, 1 / 3, 1 / 3),
    "tet10": (0.0, 0.0, 0.0, 1 / 3, 1 / 3, 1 / 3),
}


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
        parts = _parts(mesh, facets)
        np.add.at(shares, facets, parts / parts.sum())
        return shares
    nodes = mesh.facet_nodes(load.facets)
    shares[nodes] = 1.0 if load.spread == "per_node" else 1 / len(nodes)
    return shares


def _parts(mesh: Mesh, facets: Ints) -> Floats:
    """Integral of every node's shape function (f, m) over its facet, m^(d - 1)."""
    if mesh.kind != "hex8":
        shares: Floats = np.array(_SHARES[mesh.kind], dtype=np.float64)
        return facet_sizes(mesh, facets)[:, None] * shares
    points, weight = gauss_points(2)
    J = jacobians(mesh.nodes[facets], points)
    areas = np.linalg.norm(np.cross(J[..., 0], J[..., 1]), axis=-1)
    parts: Floats = weight * areas @ shapes(points)
    return parts


def facet_sizes(mesh: Mesh, facets: Ints) -> Floats:
    """Areas (f,) m^2 of facets, lengths m of edges in 2-D, from their vertices."""
    if mesh.kind == "hex8":
        return np.asarray(_parts(mesh, facets).sum(axis=1))
    x = mesh.nodes[facets[:, : mesh.dimension]]
    edges = x[:, 1:] - x[:, :1]
    if mesh.dimension == 2:
        return np.asarray(np.linalg.norm(edges[:, 0], axis=1))
    return np.asarray(np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / 2)
