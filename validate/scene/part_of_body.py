"""One body out of a mesh of several: by the name of a label or set, or by its place by size."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from validate.arrays import Ints
from validate.errors import SceneError
from validate.scene.mesh import Mesh, cell_volumes


def pieces(mesh: Mesh) -> Ints:
    """Of every cell (e,) which body it is of: parts without a common node, 1 the largest."""
    first = np.repeat(mesh.cells[:, 0], mesh.cells.shape[1])
    n = len(mesh.nodes)
    joined = coo_matrix((np.ones(len(first)), (first, mesh.cells.ravel())), shape=(n, n))
    _, labels = connected_components(joined, directed=False)
    _, of = np.unique(labels[mesh.cells[:, 0]], return_inverse=True)
    sizes = np.bincount(of, weights=np.abs(cell_volumes(mesh)))
    return np.asarray(np.argsort(np.argsort(-sizes, kind="stable"))[of] + 1)


def cells_of(mesh: Mesh, words: str, named: Mapping[str, Ints]) -> NDArray[np.bool_]:
    """Which cells (e,) are of the part of that name, in capitals or small letters, else of that
    number by size. Raises `SceneError` for none."""
    for name, cells in named.items():
        if name.upper() == words.upper():
            return np.isin(np.arange(len(mesh.cells)), cells)
    of = pieces(mesh)
    if words in {str(k) for k in range(1, of.max() + 1)}:
        return np.asarray(of == int(words))
    names = "".join(f"'{name[:40]}', " for name in list(named)[:12])
    sizes = f"1 (the largest) to {of.max()}" if of.max() > 1 else "1, the whole"
    raise SceneError(f"no part '{words[:40]}'; there are {names}by size {sizes}")


def only(mesh: Mesh, chosen: NDArray[np.bool_]) -> Mesh:
    """The chosen cells with their nodes, and what of the facet sets lies on their outside."""
    used = np.unique(mesh.cells[chosen])
    at = np.full(len(mesh.nodes), -1)
    at[used] = np.arange(len(used))
    alone = Mesh(mesh.nodes[used], at[mesh.cells[chosen]], mesh.kind)
    outer = {tuple(row) for row in np.sort(alone.surface, axis=1).tolist()}
    facets = {}
    for name, found in mesh.facets.items():
        mine = at[found]
        kept = mine[[tuple(sorted(row)) in outer for row in mine.tolist()]]
        if len(kept):
            facets[name] = kept
    return replace(alone, facets=facets)
