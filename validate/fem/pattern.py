"""Where the entries of the cells go in a sparse matrix, found once and used at every assembly."""

import numpy as np
from scipy import sparse

from validate.arrays import Floats, Ints


class NodePattern:
    """d x d blocks of all pairs of nodes that share a cell; `cells` (e, k), n nodes."""

    def __init__(self, cells: Ints, n: int, d: int) -> None:
        pairs = (cells[:, :, None] * n + cells[:, None, :]).reshape(len(cells), -1)
        keys, place = np.unique(pairs, return_inverse=True)
        self.place = place.reshape(pairs.shape)
        self.columns = keys % n
        self.starts = np.concatenate([[0], np.cumsum(np.bincount(keys // n, minlength=n))])
        self.n, self.d = n, d

    def zeros(self) -> Floats:
        return np.zeros((len(self.columns), self.d, self.d))

    def add(self, blocks: Floats, part: slice | Ints, local: Floats) -> None:
        """Adds the matrices (e, a, i, j, b) of the cells `part` to `blocks` in place; in 2-D
        what they have of the third direction is left out."""
        place = self.place[part].ravel()
        for i in range(self.d):
            for j in range(self.d):
                values = local[:, :, i, j].ravel()
                blocks[:, i, j] += np.bincount(place, values, minlength=len(blocks))

    def matrix(self, blocks: Floats) -> sparse.csr_array:
        """The matrix (n d, n d), node-major."""
        size = self.d * self.n
        parts = (blocks, self.columns, self.starts)
        return sparse.csr_array(sparse.bsr_array(parts, shape=(size, size)))
