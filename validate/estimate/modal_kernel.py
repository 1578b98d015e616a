"""The covariance of a diagonal transition over one step, in one pass over its lower triangle."""

import numpy as np

from validate.arrays import Floats
from validate.fem.compiled import compiled


@compiled(fastmath={"contract", "reassoc"})
def advance(
    P: Floats, G: Floats, B: Floats, f: Floats, Q: Floats, H: Floats
) -> tuple[Floats, Floats]:
    """P- (n, n) = (P + G B^T + B G^T) * f f^T + Q and P- H^T (n, m).

    G, B (n, r) are the last update (see `covariance`), r = 0 for none. Only lower triangles of P, Q
    and P- are read and filled.
    """
    n, r, m = P.shape[0], G.shape[1], H.shape[0]
    prior, W = np.empty((n, n)), np.zeros((m, n))
    Gt, Bt, row = G.T.copy(), B.T.copy(), np.empty(n)
    for i in range(n):
        for j in range(i + 1):
            row[j] = P[i, j]
        for a in range(r):
            g, b = G[i, a], B[i, a]
            for j in range(i + 1):
                row[j] += g * Bt[a, j] + b * Gt[a, j]
        for j in range(i + 1):
            row[j] = f[i] * f[j] * row[j] + Q[i, j]
            prior[i, j] = row[j]
        for a in range(m):
            h, total = H[a, i], 0.0
            for j in range(i):
                total += row[j] * H[a, j]
                W[a, j] += row[j] * h
            W[a, i] += total + row[i] * h
    return prior, W.T


def mirrored(P: Floats) -> Floats:
    """The symmetric matrix whose lower triangle P holds."""
    lower = np.tril(P)
    return lower + np.tril(P, -1).T
