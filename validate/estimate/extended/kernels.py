"""Compiled loops of the nonlinear filters: explicit step and node-level update.

Paper 003, eqs 35-39. P is packed by row, one column a component or node:
"component" 1 row of variances m^2, "companion" 3 rows (U_t, cross, U_{t-dt}) of 2 x 2 covariances,
"node" 6 rows (xx, yy, zz, xy, xz, yz) of 3 x 3 ones.
"""

import numpy as np

from validate.arrays import Floats, Ints
from validate.fem.kernels import explicit as explicit_kernels
from validate.fem.kernels.explicit import add_forces_and_blocks, pull
from validate.fem.kernels.jit_cache import compiled
from validate.fem.large_strain.explicit import PackedBody

_UNSIGNED = np.int64(0x7FFFFFFFFFFFFFFF)  # all bits of a double but its sign
HUGE = 1e300  # m^2: beyond it the next products would leave the number range

ROW = np.array([[0, 3, 4], [3, 1, 5], [4, 5, 2]])  # packed row of (i, j) of a symmetric 3 x 3
_compiled = compiled(*explicit_kernels.MODULES, explicit_kernels, error_model="numpy")


@_compiled
def follow(
    u: Floats, before: Floats, R: Floats, c2: Floats, c1: Floats, w: Floats,
    loaded: Ints, columns: Floats, loads: Floats, held: Ints, moves: Floats, drives: Floats,
) -> Floats:  # fmt: skip
    """U_{t+h} = c2 U_t - c1 U_{t-h} + w (F - R) (eq 35), a new array (N,).

    F has rows `columns` (k, l) of loads (l,) at the `loaded` unknowns; those `held` take `moves`
    (k, drives) of drives.
    """
    following = np.empty_like(u)
    for i in range(u.size):
        following[i] = c2[i] * u[i] - c1[i] * before[i] - w[i] * R[i]
    for k in range(loaded.size):
        for j in range(loads.size):
            following[loaded[k]] += w[loaded[k]] * columns[k, j] * loads[j]
    for k in range(held.size):
        for j in range(drives.size):
            following[held[k]] += moves[k, j] * drives[j]
    return following


@_compiled
def farthest(u: Floats) -> float:
    """Return the largest |u|; infinite where one is not a number.

    By their bits, which are ordered as the numbers are, and in vectors.
    """
    bits, top = u.view(np.int64), np.zeros(1, np.int64)
    for i in range(bits.size):
        top[0] = max(top[0], bits[i] & _UNSIGNED)
    found = float(top.view(np.float64)[0])
    return found if found < np.inf else np.inf


@_compiled
def spread_components(
    P: Floats, new: Floats, c2: Floats, w: Floats, K: Floats, Q: Floats
) -> int:  # fmt: skip
    """A^2 P + Q of every component (eq 36), A = c2 - w K_ii; counts those beyond `HUGE`."""
    count, p, following = 0, P[0], new[0]
    for i in range(p.shape[0]):
        a = c2[i] - w[i] * K[i]
        following[i] = a * a * p[i] + Q[i]
        count += not following[i] < HUGE
    return count


@_compiled
def spread_companions(
    P: Floats, new: Floats, c2: Floats, c1: Floats, w: Floats, K: Floats, Q: Floats
) -> int:  # fmt: skip
    """Return a P A^T + Q of (U_t, U_{t-dt}), A = [[a, -c1], [1, 0]]; counts those beyond `HUGE`."""
    count = 0
    for i in range(P.shape[1]):
        a = c2[i] - w[i] * K[i]
        p, x = P[0, i], P[1, i]
        new[0, i] = a * a * p - 2 * a * c1[i] * x + c1[i] * c1[i] * P[2, i] + Q[i]
        new[1, i] = a * p - c1[i] * x
        new[2, i] = p
        count += not new[0, i] < HUGE
    return count


@_compiled
def spread_nodes(P: Floats, new: Floats, c2: Floats, w: Floats, K: Floats, Q: Floats) -> int:
    """Return a P A^T + Q of every node, A = c2 I - w K_nn (3 x 3); counts those beyond `HUGE`.

    K (n, 6) holds the packed rows; c2, w and Q (N,) are those of the nodes' components.
    """
    count = 0
    for n in range(P.shape[1]):
        x, y, z = 3 * n, 3 * n + 1, 3 * n + 2
        xx, xy, xz = c2[x] - w[x] * K[n, 0], -w[x] * K[n, 3], -w[x] * K[n, 4]
        yx, yy, yz = -w[y] * K[n, 3], c2[y] - w[y] * K[n, 1], -w[y] * K[n, 5]
        zx, zy, zz = -w[z] * K[n, 4], -w[z] * K[n, 5], c2[z] - w[z] * K[n, 2]
        a, b, c, d, e, f = P[0, n], P[1, n], P[2, n], P[3, n], P[4, n], P[5, n]
        # Rows of A P, then their products with the rows of A.
        x0, x1, x2 = xx * a + xy * d + xz * e, xx * d + xy * b + xz * f, xx * e + xy * f + xz * c
        y0, y1, y2 = yx * a + yy * d + yz * e, yx * d + yy * b + yz * f, yx * e + yy * f + yz * c
        z0, z1, z2 = zx * a + zy * d + zz * e, zx * d + zy * b + zz * f, zx * e + zy * f + zz * c
        new[0, n] = x0 * xx + x1 * xy + x2 * xz + Q[x]
        new[1, n] = y0 * yx + y1 * yy + y2 * yz + Q[y]
        new[2, n] = z0 * zx + z1 * zy + z2 * zz + Q[z]
        new[3, n] = x0 * yx + x1 * yy + x2 * yz
        new[4, n] = x0 * zx + x1 * zy + x2 * zz
        new[5, n] = y0 * zx + y1 * zy + y2 * zz
        count += not (new[0, n] < HUGE and new[1, n] < HUGE and new[2, n] < HUGE)
    return count


@_compiled
def predict(
    body: PackedBody, u: Floats, before: Floats, P: Floats,
    c2: Floats, c1: Floats, w: Floats, Q: Floats,
    loaded: Ints, columns: Floats, loads: Floats, held: Ints, moves: Floats, drives: Floats,
) -> tuple[Floats, Floats, int]:  # fmt: skip
    """Eqs 35 and 36 at once: U_{t+h} as `follow` has it, the next P, and how many are beyond
    `HUGE`; a P of 1 row spreads by components, of 3 by companions, of 6 by nodes."""
    law, geometry, cells, springs, own, work = body
    R, six = np.empty_like(u), P.shape[0] == 6
    K, new = np.zeros(2 * u.size if six else u.size), np.empty_like(P)
    pull(springs, u, R)
    for i in range(own.size):
        K[2 * i - i % 3 if six else i] = own[i]
    add_forces_and_blocks(law, geometry, cells, u, R, K, work)
    if six:
        count = spread_nodes(P, new, c2, w, K.reshape(-1, 6), Q)
    elif P.shape[0] == 3:
        count = spread_companions(P, new, c2, c1, w, K, Q)
    else:
        count = spread_components(P, new, c2, w, K, Q)
    return follow(u, before, R, c2, c1, w, loaded, columns, loads, held, moves, drives), new, count


@_compiled
def innovations(
    u: Floats, P: Floats, rows: Ints, z: Floats, R: Floats, y: Floats, sd: Floats
) -> int:
    """y = z - H u and its sd (m,) before the update, zero where z is NaN; counts the measured."""
    per, count = (3 if P.shape[0] == 6 else 1), 0
    for m in range(len(rows)):
        y[m] = sd[m] = 0.0
        if not np.isnan(z[m]):
            y[m] = z[m] - u[rows[m]]
            sd[m] = np.sqrt(P[rows[m] % per, rows[m] // per] + R[m])
            count += 1
    return count


@_compiled
def correct_components(
    u: Floats, before: Floats, P: Floats, rows: Ints, z: Floats, R: Floats,
    joseph: bool, shift: bool,
) -> tuple[float, float]:  # fmt: skip
    """Eqs 37-39 at the measured components (m,), NaN = missing; returns NIS and ln det S.

    `shift` adds the correction to `before` (U_t) too. "printed" P - K P loses all of P where
    P >> R; "joseph" is (1 - K)^2 P + K^2 R.
    """
    nis, log_det, p = 0.0, 0.0, P[0]
    for m in range(len(rows)):
        i = rows[m]
        if np.isnan(z[m]):
            continue
        y, S = z[m] - u[i], p[i] + R[m]
        G = p[i] / S
        u[i] += G * y
        if shift:
            before[i] += G * y
        p[i] = (1 - G) * p[i] * (1 - G) + G * R[m] * G if joseph else p[i] - G * p[i]
        nis += y / S * y
        log_det += np.log(S)
    return nis, log_det


@_compiled
def correct_companions(
    u: Floats, before: Floats, P: Floats, rows: Ints, z: Floats, R: Floats, joseph: bool
) -> tuple[float, float]:
    """Return the update of (U_t, U_{t-dt}) together, measured in U_t; returns NIS and ln det S."""
    nis, log_det, now, cross, old = 0.0, 0.0, P[0], P[1], P[2]
    for m in range(len(rows)):
        i = rows[m]
        if np.isnan(z[m]):
            continue
        p, x, b = now[i], cross[i], old[i]
        y, S = z[m] - u[i], p + R[m]
        G, L = p / S, x / S
        u[i] += G * y
        before[i] += L * y
        if joseph:
            now[i] = (1 - G) * p * (1 - G) + G * R[m] * G
            cross[i] = (1 - G) * (x - L * p) + G * R[m] * L
            old[i] = (b - L * x) - L * (x - L * p) + L * R[m] * L
        else:
            now[i], cross[i], old[i] = p - G * p, x - G * x, b - L * x
        nis += y / S * y
        log_det += np.log(S)
    return nis, log_det


@_compiled
def correct_nodes(
    u: Floats, before: Floats, P: Floats, rows: Ints, z: Floats, R: Floats,
    joseph: bool, shift: bool,
) -> tuple[float, float]:  # fmt: skip
    """Return the 3 x 3 update of the measured nodes, one component after the other; returns NIS and
    ln det S.

    R is diagonal, so this is the joint update of a node's components.
    """
    nis, log_det, G, T = 0.0, 0.0, np.empty(3), np.empty((3, 3))
    for m in range(len(rows)):
        n, i = divmod(rows[m], 3)
        if np.isnan(z[m]):
            continue
        y, S = z[m] - u[rows[m]], P[i, n] + R[m]
        for j in range(3):
            G[j] = P[ROW[i, j], n] / S
            u[3 * n + j] += G[j] * y
            if shift:
                before[3 * n + j] += G[j] * y
        for j in range(3):
            for k in range(3):
                own = (1 - G[i]) if j == i else 1.0
                gone = 0.0 if j == i else G[j] * P[ROW[i, k], n]
                T[j, k] = own * P[ROW[j, k], n] - gone
        for j in range(3):
            for k in range(j, 3):
                P[ROW[j, k], n] = T[j, k]
                if joseph:
                    P[ROW[j, k], n] += G[j] * R[m] * G[k] - T[j, i] * G[k]
        nis += y / S * y
        log_det += np.log(S)
    return nis, log_det


@_compiled
def clip(P: Floats) -> int:
    """Scale the covariances beyond `HUGE` back to it; returns how many. One that has left the
    number range altogether becomes `HUGE` in its variances, uncorrelated."""
    count = 0
    for i in range(P.shape[1]):
        top, lost = 0.0, False
        for k in range(P.shape[0]):
            top = max(top, abs(P[k, i]))
            lost = lost or not np.isfinite(P[k, i])
        if lost or top >= HUGE:
            count += 1
            for k in range(P.shape[0]):
                cross = (k == 1 and P.shape[0] == 3) or k > 2
                whole = 0.0 if cross else HUGE
                P[k, i] = whole if lost else P[k, i] * (HUGE / top)
    return count


@_compiled
def correct(
    u: Floats, before: Floats, P: Floats, rows: Ints, z: Floats, R: Floats,
    joseph: bool, shift: bool, y: Floats, sd: Floats,
) -> tuple[float, float, int]:  # fmt: skip
    """`innovations`, then the update of the kind that P has: NIS, ln det S, and how many were
    measured."""
    dof = innovations(u, P, rows, z, R, y, sd)
    if P.shape[0] == 3:
        nis, log_det = correct_companions(u, before, P, rows, z, R, joseph)
    elif P.shape[0] == 6:
        nis, log_det = correct_nodes(u, before, P, rows, z, R, joseph, shift)
    else:
        nis, log_det = correct_components(u, before, P, rows, z, R, joseph, shift)
    return nis, log_det, dof
