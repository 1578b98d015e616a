"""A hyperelastic body in total Lagrangian form: energy, internal force and tangent of a mesh.

f_int = sum over points of w P : dN/dX, K_t its derivative (Bonet & Wood 2008, ch. 9). Nodal mean
dilatation at large strain takes the isochoric law per cell and the volumetric one of the cells'
measure (tr E or J - 1) averaged around each node; at rest its tangent is that of `fem.assemble`.

Departures: four points per quadratic cell (degree 2) integrate the stiffness at rest exactly; at
large strain they are what the order of convergence needs, not exact. Foundations act as linear
springs at any displacement; membranes are known at small strain only and are refused.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.assemble import point_slopes
from validate.fem.laws import law_of
from validate.fem.nodal_mean import NodalMean
from validate.fem.pattern import NodePattern
from validate.fem.surface import foundation_stiffness
from validate.fem.tensors import green_strain, volume_change
from validate.scene.mesh import cell_volumes, require_positive_cells
from validate.scene.scene import Scene

_BLOCK = 2048  # cells at a time: bounds the memory of the kernel's temporaries


@dataclass(frozen=True)
class Inverted:
    """`count` of `points` quadrature points with det F <= 0, `first` the first such cell."""

    count: int
    points: int
    first: int


class Body:
    """A scene's mesh and law, prepared once; displacements u (N,) m, node-major.

    Raises `SceneError` for other elements than tet4 and tet10, inverted cells, a linear law, a
    membrane.
    """

    def __init__(self, scene: Scene) -> None:
        mesh, kappa = scene.mesh, scene.material.bulk_modulus
        if mesh.kind not in ("tet4", "tet10"):
            raise SceneError(f"elements of kind {mesh.kind} have no hyperelastic form; use tet4")
        if scene.membranes:
            raise SceneError("membranes are linear only: drop them, or take the linear law")
        if scene.regions:
            raise SceneError("large strain is for one material; drop the regions")
        require_positive_cells(mesh)
        averaged = scene.dilatation == "nodal_mean"
        self.mesh, self.law = mesh, law_of(scene.material, isochoric=averaged)
        self.mean = NodalMean(mesh, self.law, kappa) if averaged else None
        self.gradients = point_slopes(mesh)
        springs = [foundation_stiffness(mesh, f) for f in scene.foundations]
        self.springs: sparse.csr_array | None = sum(springs[1:], springs[0]) if springs else None
        points = self.gradients.shape[1]
        self.weights = np.repeat(cell_volumes(mesh)[:, None] / points, points, axis=1)
        self.pattern = NodePattern(mesh.cells, len(mesh.nodes))
        spread = np.linalg.norm(self.gradients, axis=-1) * self.weights[..., None]
        #: N, norm of the nodal forces that a stress of kappa + mu in every cell would add up to.
        self.unit_force = float((kappa + self.law.mu) * np.linalg.norm(self._nodal(spread.sum(1))))

    def energy(self, u: Floats) -> float:
        """Stored energy J of the mesh (not times the scene's copies)."""
        total = sum(
            float((self.weights[part] * self.law.energy(H)).sum()) for part, H in self._blocks(u)
        )
        springs = 0.0 if self.springs is None else float(u @ (self.springs @ u)) / 2
        return total + springs + (self.mean.energy(self._cell_gradient(u)) if self.mean else 0.0)

    def force(self, u: Floats) -> Floats:
        """Internal nodal forces (N,) N."""
        pressure = self.mean.pressures(self._cell_gradient(u)) if self.mean else None
        nodal = np.empty((*self.mesh.cells.shape, 3))
        for part, H in self._blocks(u):
            P = self.law.stress(H)
            if self.mean and pressure is not None:
                P = P + pressure[part, None, None, None] * self.mean.law.dilatation(H)[1]
            weighted = np.swapaxes(self.weights[part, :, None, None] * P, -1, -2)
            nodal[part] = (self.gradients[part] @ weighted).sum(axis=1)
        force = np.stack([self._nodal(nodal[..., i]) for i in range(3)], axis=1).ravel()
        return force if self.springs is None else force + self.springs @ u

    def tangent(self, u: Floats) -> sparse.csr_array:
        """K_t (N, N) N/m, symmetric."""
        gradient = self._cell_gradient(u)
        pressure = self.mean.pressures(gradient) if self.mean else None
        blocks = self.pattern.zeros()
        for part, H in self._blocks(u):
            A = self.law.tangent(H)
            if self.mean and pressure is not None:
                A += pressure[part, None, None, None, None, None] * self.mean.law.curvature(H)
            self.pattern.add(blocks, part, self._cell_tangents(part, A))
        K = self.pattern.matrix(blocks)
        K = K if self.springs is None else sparse.csr_array(K + self.springs)
        return sparse.csr_array(K + self.mean.tangent(gradient)) if self.mean else K

    def jacobians(self, u: Floats) -> Floats:
        """det F (e, q) at every quadrature point."""
        return 1 + np.concatenate([volume_change(H) for _, H in self._blocks(u)])

    def inverted(self, u: Floats) -> Inverted | None:
        """The points with det F <= 0, if any: no state of a body."""
        bad = ~(self.jacobians(u) > 0)
        if not bad.any():
            return None
        return Inverted(int(bad.sum()), bad.size, int(np.argmax(bad.any(axis=1))))

    def principal_stretches(self, u: Floats) -> Floats:
        """The principal stretches (e, q, 3), rising, at every quadrature point."""
        squares = [np.linalg.eigvalsh(2 * green_strain(H) + np.eye(3)) for _, H in self._blocks(u)]
        return np.sqrt(np.maximum(np.concatenate(squares), 0.0))

    def beyond_the_law(self, u: Floats) -> str:
        """Where a principal stretch is one at which the law has no sense, in words, or nothing."""
        least, most = self.law.least_stretch, self.law.most_stretch
        if least == 0 and most == np.inf:
            return ""
        stretches = self.principal_stretches(u)
        low, high = stretches[..., 0].min(axis=1), stretches[..., 2].max(axis=1)
        if low.min() < least:
            found, cell, ends = low.min(), low.argmin(), f"below {least:.3f}"
        elif high.max() > most:
            found, cell, ends = high.max(), high.argmax(), f"above {most:.3f}"
        else:
            return ""
        words = f"principal stretch {found:.3f} in element {cell}"
        return f"beyond the law's validity: {words} is {ends}"

    def _cell_tangents(self, part: slice, A: Floats) -> Floats:
        """K (e, a, i, j, b) of the cells of a block: dN_aJ A_iJjK dN_bK, summed over points."""
        dN, w = self.gradients[part], self.weights[part]
        e, q, a, _ = dN.shape
        right = (w[..., None, None] * A.reshape(e, q, 27, 3)) @ np.swapaxes(dN, -1, -2)
        left = np.swapaxes(dN, 1, 2).reshape(e, a, 3 * q)
        return (left @ right.reshape(e, 3 * q, 9 * a)).reshape(e, a, 3, 3, a)

    def _blocks(self, u: Floats) -> Iterator[tuple[slice, Floats]]:
        """H (b, q, 3, 3) = du/dX of the cells, block by block."""
        nodal = u.reshape(-1, 3)
        for start in range(0, len(self.mesh.cells), _BLOCK):
            part = slice(start, start + _BLOCK)
            local = np.swapaxes(nodal[self.mesh.cells[part]], 1, 2)
            yield part, local[:, None] @ self.gradients[part]

    def _cell_gradient(self, u: Floats) -> Floats:
        """H (e, 3, 3) of linear cells."""
        return np.concatenate([H[:, 0] for _, H in self._blocks(u)])

    def _nodal(self, values: Floats) -> Floats:
        """Sums (n,) of what the cells (e, k) leave at their nodes."""
        cells, n = self.mesh.cells, len(self.mesh.nodes)
        return np.bincount(cells.ravel(), values.ravel(), n).astype(np.float64)
