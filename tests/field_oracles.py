"""What tests hold the library against: quantities of fields and systems that no product uses."""

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import eigsh

from validate.arrays import Floats
from validate.compare.shapes.pair import FieldPair
from validate.fem.assembly.assemble import rule, volumes_at
from validate.fem.system import System
from validate.scene.mesh import Mesh


def nodal_volumes(mesh: Mesh) -> Floats:
    """w_a = integral of N_a (n,) m^d: their sum is the volume; negative at tet10 vertices."""
    points = rule(mesh, 2)
    share = volumes_at(mesh, points) @ points.N
    sums = np.bincount(mesh.cells.ravel(), share.ravel(), minlength=len(mesh.nodes))
    return np.asarray(sums, dtype=np.float64)


def weighted_nodal_sum(pair: FieldPair) -> float:
    """sum_a w_a |u'_a - u_a| over the volume, m, of paper 002: at least the mean distance, for
    linear elements."""
    weights = nodal_volumes(pair.on)
    return float(weights @ np.linalg.norm(pair.difference, axis=1) / weights.sum())


def frequency_range(system: System) -> tuple[float, float]:
    """Lowest and highest angular frequency 1/s with the consistent mass."""
    free = system.free
    K, M = (sparse.csc_array(X[free][:, free]) for X in (system.K, system.M))
    lowest = eigsh(K, k=1, M=M, sigma=0.0, which="LM", return_eigenvectors=False)
    highest = eigsh(K, k=1, M=M, which="LM", return_eigenvectors=False)
    return float(np.sqrt(lowest[0])), float(np.sqrt(highest[0]))
