"""Compiled loops over modes: covariance of a diagonal transition, and all steps of a filter."""

import numpy as np

from validate.arrays import Floats, Ints
from validate.fem.kernels.jit_cache import compiled


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


@compiled(fastmath={"contract", "reassoc"})
def advance_observed(
    P: Floats, G: Floats, B: Floats, phi: Floats, theta: Floats, Q: Floats, rows: Floats
) -> tuple[Floats, Floats]:
    """P- (w, r) = (P - G B^T) * phi theta^T + Q and P- rows^T (w, m): see `observable`.

    G (w, k), B (r, k) are the last update, k = 0 for none; rows (m, r).
    """
    (w, r), k, m = P.shape, G.shape[1], rows.shape[0]
    prior, seen, Bt = np.empty((w, r)), np.empty((w, m)), B.T.copy()
    for i in range(w):
        row = prior[i]
        for j in range(r):
            row[j] = P[i, j]
        for a in range(k):
            g = G[i, a]
            for j in range(r):
                row[j] -= g * Bt[a, j]
        for j in range(r):
            row[j] = phi[i] * theta[j] * row[j] + Q[i, j]
        for c in range(m):
            total = 0.0
            for j in range(r):
                total += row[j] * rows[c, j]
            seen[i, c] = total
    return prior, seen


def mirrored(P: Floats) -> Floats:
    """Return the symmetric matrix whose lower triangle P holds."""
    lower = np.tril(P)
    return lower + np.tril(P, -1).T


@compiled(fastmath={"contract", "reassoc"})
def walked(
    factors: Floats,
    rule: Floats,
    forces: Floats,
    begin: Floats,
    towards_prior: bool,
    which: Ints,
    gains: Floats,
    H: Floats,
    z: Floats,
    read: Floats,
) -> tuple[Floats, Floats]:
    """Values (nt, p) and innovations (nt, m) of one walk of amplitudes from rest.

    factors (4, n) as `InModes`, rule: h and b0, b1, g0, g1 as `Rule`; forces (nt, n), first
    acceleration `begin` (n,); gains (k, m, n), of step i the one `which` (nt,) says, -1 for none;
    H (m, n) of what is measured, read (p, n) of what is wanted. NaN of z (nt, m) is not measured.
    """
    nt, n = forces.shape
    m, p = len(H), len(read)
    values, y = np.zeros((nt, p)), np.zeros((nt, m))
    h, b0, b1, g0, g1 = rule
    fq, fv, fa, ff = factors
    x, v, a, prior, new = np.zeros(n), np.zeros(n), begin.copy(), np.empty(n), np.empty(n)
    for k in range(nt):
        f = forces[k]
        for i in range(n):
            prior[i] = fq[i] * x[i] + fv[i] * v[i] + fa[i] * a[i] + ff[i] * f[i]
            new[i] = prior[i]
        if which[k] >= 0:
            for c in range(m):
                if not np.isnan(z[k, c]):
                    total, row = 0.0, H[c]
                    for i in range(n):
                        total += row[i] * prior[i]
                    y[k, c] = z[k, c] - total
            for c in range(m):
                gain, e = gains[which[k], c], y[k, c]
                for i in range(n):
                    new[i] += gain[i] * e
        towards = prior if towards_prior else new
        for i in range(n):
            after = (towards[i] - x[i] - h * v[i] - h * h * b0 * a[i]) / (h * h * b1)
            v[i] += h * g0 * a[i] + h * g1 * after
            a[i] = after
            x[i] = new[i]
        for c in range(p):
            total, row = 0.0, read[c]
            for i in range(n):
                total += row[i] * x[i]
            values[k, c] = total
    return values, y
