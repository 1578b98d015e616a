"""Linear statics at nu = 0.5: augmented Lagrangian on mixed cells, exact volume.

Find u and pressures p, of their own in every cell: a(u, v) + (p, theta(v)) = f(v), theta(u) = 0,
theta the projected volume strain (`fem.assembly.mean_dilatation`). K holds a and a finite penalty
r theta^T theta; each iteration adds r theta to p (Uzawa's, on the penalised problem: Fortin &
Glowinski 1983, ch. 1). The error shrinks by about mu / r an iteration, so that the limit is that of
the saddle system and of the penalty in nothing.
"""

import numpy as np
from scipy import sparse

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.assembly.assemble import lame_constants, mean_divergence
from validate.fem.linear_solvers.factor import Factor
from validate.fem.linear_solvers.frontal import Fronts
from validate.fem.system import System

_KEPT = 1e-11  # volume strain over the displacement gradient that counts as none
_ITERATIONS = 50


def keep_volumes(
    system: System, factor: Factor | Fronts, columns: Floats, loads: Floats
) -> tuple[Floats, Floats]:
    """Displacements (N, k + l) m per unit input that keep every cell with nu = 0.5, and the nodal
    forces (N, k + l) N of its pressures.

    `columns` are those of the penalty alone, drives first, `loads` (N, l) N. Raises `SceneError`
    where what is prescribed changes the volume.
    """
    scene, free = system.scene, system.free
    D, weights = mean_divergence(scene)
    kept = scene.per_cell(lambda m: m.incompressible) > 0
    bulk = lame_constants(scene)[0] + 2 / 3 * lame_constants(scene)[1]
    r = scene.thickness * (np.where(kept, bulk, 0.0)[:, None] * weights).ravel()
    push, D = sparse.csr_array(D.T * r), D[np.repeat(kept, weights.shape[1])]
    size = float(np.ptp(scene.mesh.nodes, axis=0).max())
    strain = np.abs(columns).max(axis=0) / size
    forces = np.hstack([np.zeros((len(columns), columns.shape[1] - loads.shape[1])), loads])
    u, total = columns.copy(), np.zeros((push.shape[1], columns.shape[1]))
    rows = np.flatnonzero(np.repeat(kept, weights.shape[1]))
    for _ in range(_ITERATIONS):
        theta = D @ u
        worst = np.abs(theta).max(axis=0)
        held = push @ total
        if (worst <= _KEPT * strain).all():
            return u, held
        total[rows] += theta
        held = push @ total
        left = forces - held - system.K @ u
        u[free] += factor.solve(left[free])
    raise SceneError(
        f"nu = 0.5: the cells change their volume by {worst.max():.1e} of it per unit input "
        f"after {_ITERATIONS} iterations; the held and driven nodes allow no motion of "
        "constant volume: free a face, or use nu <= 0.4999"
    )
