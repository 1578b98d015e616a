"""Strain and stress of every cell, averaged over its points, for display.

Mixed and averaged volume changes are those of the points here, so that pressures of a mean
dilatation element are not the ones that it was solved with (`fem.assembly.assemble` has
those).
"""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.fem.assembly.assemble import stiffness_points
from validate.fem.laws.energies import green_strain
from validate.fem.laws.law import law_of
from validate.scene.scene import Scene

_EYE = np.eye(3)


@dataclass(frozen=True)
class CellFields:
    """Green-Lagrange strain (e, 3, 3), at a linear law the small strain, and Cauchy stress
    (e, 3, 3) Pa; None: plane stress, whose strain across is not among the displacements, and
    nu = 0.5, whose pressure is not."""

    strain: Floats
    stress: Floats | None

    @property
    def von_mises(self) -> Floats | None:
        """(e,) Pa."""
        if self.stress is None:
            return None
        s = self.stress - np.trace(self.stress, axis1=1, axis2=2)[:, None, None] / 3 * _EYE
        return np.asarray(np.sqrt(1.5 * (s * s).sum(axis=(1, 2))))


def cell_fields(scene: Scene, u: Floats) -> CellFields:
    """Of displacements u (n, d) m."""
    points = stiffness_points(scene.mesh)
    d = scene.mesh.dimension
    H = np.zeros((*points.weights.shape, 3, 3))
    H[..., :d, :d] = np.einsum("eqaj,eai->eqij", points.slopes, u[scene.mesh.cells])
    share = points.weights / points.weights.sum(axis=1, keepdims=True)
    linear = scene.material.law == "linear"
    strain = (H + np.swapaxes(H, -1, -2)) / 2 if linear else green_strain(H)
    mean = np.einsum("eqij,eq->eij", strain, share)
    if (d == 2 and scene.plane == "stress") or any(m.incompressible for m in scene.materials):
        return CellFields(mean, None)
    stress = np.empty_like(H)
    own = np.zeros(len(H), dtype=np.int64)
    for i, region in enumerate(scene.regions, start=1):
        own[region.cells] = i
    for i, material in enumerate((scene.material, *(r.material for r in scene.regions))):
        # Cauchy stress (..., 3, 3) Pa: P F^T / J, or Hooke's law
        cells = own == i
        if material.law == "linear":
            eps = (H[cells] + np.swapaxes(H[cells], -1, -2)) / 2
            volume = np.trace(eps, axis1=-2, axis2=-1)[..., None, None]
            lam = material.bulk_modulus - 2 * material.shear_modulus / 3
            stress[cells] = lam * volume * _EYE + 2 * material.shear_modulus * eps
        else:
            F = H[cells] + _EYE
            J = np.linalg.det(F)[..., None, None]
            stress[cells] = law_of(material).stress(H[cells]) @ np.swapaxes(F, -1, -2) / J
    return CellFields(mean, np.einsum("eqij,eq->eij", stress, share))
