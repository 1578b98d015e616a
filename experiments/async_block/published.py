"""What paper 004 shows of 2-D and 3-D, beside ours: pictures of regions, and no force or time."""

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from validate.compare.published import Figure
from validate.fem.system import build
from validate.scene.geometries.box import grid
from validate.scene.material import Material
from validate.scene.scene import Scene, Support

_WIDE = 12  # cells of Fig. 2's square: its rows of the list are 13 nodes apart
_NEAR = 2  # layers of the red region there: 3 by 3 nodes
_NONE = (
    "no force, size or time is printed in 2-D or 3-D: 'a one dimensional model is used' "
    "(section 6); Figs 1 and 2 show the arrangement of regions"
)
_LIST = (
    "the list of Fig. 2(b) starts at (42,48), its other rows at 54, 67, 80 and 93, in steps "
    "of 13: the first must be 41 to 47. A ring 7 nodes wide and 5 high around 3 by 3 is not a "
    "whole number of layers. By distance in the mesh, one layer has 16 nodes and two have 40"
)


def ring_nodes() -> dict[str, float]:
    """Nodes of the one layer around 3 by 3 in the middle of a square of quadrilaterals."""
    scene = Scene(grid((1.0, 1.0), (_WIDE, _WIDE)), Material(1.0, 0.0, rho=1.0),
                  (Support("x0", (0, 1)),))  # fmt: skip
    K = build(scene).K.tocoo()
    links = csr_array((np.ones(K.nnz), (K.row // 2, K.col // 2)))
    middle = scene.mesh.nearest_node(np.array([0.5, 0.5]))
    away = dijkstra(links, indices=np.array([middle]), unweighted=True, min_only=True)
    return {"ring.nodes": float((away == _NEAR).sum())}


BLOCK_FIGURES = (
    Figure("green region of Fig. 2(b), 100 Hz: its nodes", "told:ring.nodes", 26, None, "1",
           "not reproducible as printed", _LIST, "section 5.1, Fig. 2(b)", 16, 0.5),
    Figure("peak force error of regions in 3-D", "told:error.near", None, None, "%",
           "not comparable", _NONE, "section 5, Figs. 1 and 2"),
    Figure("gain of regions in 3-D, mean tick", "told:gain.near", None, None, "%",
           "not comparable", _NONE, "section 5, Figs. 1 and 2"),
)  # fmt: skip
