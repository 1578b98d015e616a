"""Nodal forces of the scene's loads, per newton of their inputs."""

import numpy as np

from validate.arrays import Floats, Ints
from validate.scene.mesh import Mesh
from validate.scene.scene import Load, Scene

# Shares of a uniform traction at the nodes of a straight facet, vertices first.
_SHARES = {
    "tri3": (1 / 2, 1 / 2),
    "tri6": (1 / 6, 1 / 6, 4 / 6),
    "tet4": (1 / 3, 1 / 3, 1 / 3),
    "tet10": (0.0, 0.0, 0.0, 1 / 3, 1 / 3, 1 / 3),
}


def load_columns(scene: Scene) -> Floats:
    """Forces (N, l) on all unknowns for one newton of each load, node-major."""
    columns = np.zeros((scene.mesh.nodes.size, len(scene.loads)))
    for j, load in enumerate(scene.loads):
        columns[:, j] = np.outer(_nodal(scene.mesh, load), load.direction).ravel()
    return columns


def _nodal(mesh: Mesh, load: Load) -> Floats:
    """The share (n,) of the input that every node takes."""
    shares = np.zeros(len(mesh.nodes))
    if load.spread == "consistent":
        facets = mesh.facets[load.facets]
        sizes = facet_sizes(mesh, facets)
        np.add.at(shares, facets, sizes[:, None] / sizes.sum() * np.array(_SHARES[mesh.kind]))
        return shares
    nodes = mesh.facet_nodes(load.facets)
    shares[nodes] = 1.0 if load.spread == "per_node" else 1 / len(nodes)
    return shares


def facet_sizes(mesh: Mesh, facets: Ints) -> Floats:
    """Areas (f,) m^2 of triangles, lengths m of edges in 2-D, from their vertices."""
    x = mesh.nodes[facets[:, : mesh.dimension]]
    edges = x[:, 1:] - x[:, :1]
    if mesh.dimension == 2:
        return np.asarray(np.linalg.norm(edges[:, 0], axis=1))
    return np.asarray(np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / 2)
