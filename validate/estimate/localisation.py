"""How far a measurement reaches in an ensemble: a taper by the distance along the mesh."""

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import dijkstra

from validate.arrays import Floats
from validate.errors import UsageError
from validate.scene.mesh import Mesh


def gaspari_cohn(distance: Floats, radius: float) -> Floats:
    """1 at distance 0, 5/24 at `radius`, 0 from twice the radius on, twice differentiable in
    between (Gaspari & Cohn 1999, eq 4.10); both in m. Raises `UsageError` for a radius <= 0."""
    if not radius > 0:
        raise UsageError(f"localisation radius {radius:g} m: expected a positive number")
    r = np.abs(np.asarray(distance, dtype=np.float64)) / radius
    near, far = np.minimum(r, 1.0), np.clip(r, 1.0, 2.0)
    inner = (((-near / 4 + 1 / 2) * near + 5 / 8) * near - 5 / 3) * near**2 + 1
    outer = ((((far / 12 - 1 / 2) * far + 5 / 8) * far + 5 / 3) * far - 5) * far + 4 - 2 / (3 * far)
    return np.where(r <= 1, inner, np.where(r < 2, np.maximum(outer, 0.0), 0.0))


def along_mesh(mesh: Mesh, rows: sparse.csr_array) -> Floats:
    """Distance (n, m) m from what each of `rows` (m, N) reads to every node, along edges: a slit
    is walked around. Infinite where the mesh does not hang together."""
    d, H = mesh.dimension, sparse.csr_array(rows)
    graph = _edges(mesh)
    columns = []
    for k in range(H.shape[0]):
        pick = slice(H.indptr[k], H.indptr[k + 1])
        weights, nodes = np.abs(H.data[pick]), H.indices[pick] // d
        nodes, weights = nodes[weights > 0], weights[weights > 0]
        point = weights @ mesh.nodes[nodes] / weights.sum()
        start = np.linalg.norm(mesh.nodes[nodes] - point, axis=1)
        columns.append(
            (dijkstra(graph, directed=False, indices=nodes) + start[:, None]).min(axis=0)
        )
    return np.stack(columns, axis=1)


def _edges(mesh: Mesh) -> sparse.csr_array:
    """Lengths m between all nodes of every cell, (n, n)."""
    k = mesh.cells.shape[1]
    a, b = (mesh.cells[:, i].ravel() for i in np.triu_indices(k, 1))
    a, b = np.minimum(a, b), np.maximum(a, b)
    a, b = np.unique(np.stack([a, b]), axis=1)
    lengths = np.linalg.norm(mesh.nodes[a] - mesh.nodes[b], axis=1)
    return sparse.csr_array((lengths, (a, b)), shape=2 * (len(mesh.nodes),))
