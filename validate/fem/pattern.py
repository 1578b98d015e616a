"""Where the entries of the cells go in a sparse matrix, found once and used at every assembly."""

import numpy as np
from scipy import sparse

from validate.arrays import Floats, Ints


class NodePattern:
    """3 x 3 blocks of all pairs of nodes that share a cell; `cells` (e, k), n nodes."""

    def __init__(self, cells: Ints, n: int) -> None:
        pairs = (cells[:, :, None] * n + cells[:, None, :]).reshape(len(cells), -1)
        keys, place = np.unique(pairs, return_inverse=True)
        self.place = place.reshape(pairs.shape)
        self.columns = keys % n
        self.starts = np.concatenate([[0], np.cumsum(np.bincount(keys // n, minlength=n))])
        self.n = n

    def zeros(self) -> Floats:
        return np.zeros((len(self.columns), 3, 3))

    def add(self, blocks: Floats, part: slice | Ints, local: Floats) -> None:
        """Adds the matrices (e, a, i, j, b) of the cells `part` to `blocks` in place."""
        place = self.place[part].ravel()
        for i in range(3):
            for j in range(3):
                values = local[:, :, i, j].ravel()
                blocks[:, i, j] += np.bincount(place, values, minlength=len(blocks))

    def matrix(self, blocks: Floats) -> sparse.csr_array:
        """The matrix (3 n, 3 n), node-major."""
        size = 3 * self.n
        parts = (blocks, self.columns, self.starts)
        return sparse.csr_array(sparse.bsr_array(parts, shape=(size, size)))
