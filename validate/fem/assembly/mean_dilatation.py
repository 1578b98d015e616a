"""Mean dilatation of mixed cells: projection of volume change on constants or linear fields.

Three fields u, p, theta with p and theta of their own in every cell and eliminated there (Simo,
Taylor & Pister 1985): theta is the projection of the law's measure of volume change, and the energy
is W(F) of the isochoric part plus U(theta). Constants on hex8 (mean dilatation, Nagtegaal, Parks &
Rice 1974), tet10 and tri6; linear fields of the place on hex27 (Boffi, Brezzi & Fortin 2013, 8.6),
which keep its order up to nu -> 1/2; on tet10 constants leave order 2 there.
"""

import numpy as np

from validate.arrays import Floats
from validate.scene.mesh import Mesh


def projections(mesh: Mesh, places: Floats, weights: Floats) -> Floats:
    """Pi (e, q, q): what values at the points of every cell become, in the mean with `weights`.

    `places` (e, q, d) m and `weights` (e, q) m^d are those of the points. Pi is symmetric in the
    scalar product of the weights, so that it is its own adjoint.
    """
    volume = weights.sum(axis=1)[:, None, None]
    middle = (weights[..., None] * places).sum(axis=1, keepdims=True) / volume
    fields = np.ones((*weights.shape, 1))
    if mesh.kind == "hex27":
        fields = np.concatenate([fields, (places - middle) / np.cbrt(volume)], axis=2)
    weighted = np.swapaxes(fields * weights[..., None], 1, 2)
    return np.asarray(fields @ np.linalg.solve(weighted @ fields, weighted))
