"""The volumetric part of nodal mean dilatation at large strain, on linear tetrahedra.

W = sum_a V_a U(s_a), s_a = sum_e V_e/4 s_e / V_a, over the cells e around node a, with the law's
own measure s (tr E or J - 1). Source: Bonet & Burton (1998), their J averaged; the form for
St. Venant-Kirchhoff is the same average of tr E.
"""

import numpy as np
from scipy import sparse

from validate.arrays import Floats
from validate.fem.assemble import shape_gradients
from validate.fem.laws import Law
from validate.scene.mesh import Mesh, cell_volumes


class NodalMean:
    """`law` gives the measure and U with modulus kappa Pa; cell gradients H (e, 3, 3)."""

    def __init__(self, mesh: Mesh, law: Law, kappa: float) -> None:
        self.law, self.kappa = law, kappa
        self.gradients = shape_gradients(mesh)
        cells, n = mesh.corners, len(mesh.nodes)
        share = np.repeat(cell_volumes(mesh) / 4, 4)
        entries = (share, (cells.ravel(), np.repeat(np.arange(len(cells)), 4)))
        gathered = sparse.csr_array(entries, shape=(n, len(cells)))
        self.volumes: Floats = np.asarray(gathered.sum(axis=1))
        self.average = sparse.csr_array(sparse.diags_array(1 / self.volumes) @ gathered)
        self.columns = (3 * cells[..., None] + np.arange(3)).ravel()
        self.starts = 12 * np.arange(len(cells) + 1)
        self.cells, self.shape = cells, (len(cells), 3 * n)

    def energy(self, H: Floats) -> float:
        """J."""
        return float(self.volumes @ self._at_nodes(H)[0])

    def pressures(self, H: Floats, dH: Floats | None = None) -> Floats:
        """The slope dU/ds (e,) Pa that acts in every cell: the mean of its nodes' slopes, with
        the linear change that cell gradients dH (e, 3, 3) make."""
        _, slopes, stiff = self._at_nodes(H)
        if dH is not None:
            ds = (self.law.dilatation(H)[1] * dH).sum(axis=(-2, -1))
            slopes = slopes + stiff * (self.average @ ds)
        return np.asarray(slopes[self.cells].mean(axis=1))

    def tangent(self, H: Floats) -> sparse.csr_array:
        """D^T V U'' D (N, N) N/m, D = ds_a/du; the part with d2s/dF2 is the cells' own."""
        slope = self.law.dilatation(H)[1]
        values = (self.gradients @ np.swapaxes(slope, 1, 2)).ravel()
        B = sparse.csr_array((values, self.columns, self.starts), shape=self.shape)
        D = sparse.csr_array(self.average @ B)
        stiff = sparse.diags_array(self.volumes * self._at_nodes(H)[2])
        return sparse.csr_array(D.T @ stiff @ D)

    def _at_nodes(self, H: Floats) -> tuple[Floats, Floats, Floats]:
        s = np.asarray(self.average @ self.law.dilatation(H)[0])
        return self.law.volumetric(s, self.kappa)
