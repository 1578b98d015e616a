"""Tensors of the displacement gradient H = F - I, accurate at small strains."""

import numpy as np

from validate.arrays import Floats

EYE = np.eye(3)
_CYCLES = ((0, 1, 2), (1, 2, 0), (2, 0, 1))


def green_strain(H: Floats) -> Floats:
    """E (..., 3, 3) = (H + H^T + H^T H) / 2."""
    Ht = np.swapaxes(H, -1, -2)
    return np.asarray((H + Ht + Ht @ H) / 2)


def volume_change(H: Floats) -> Floats:
    """J - 1 (...), without the cancellation of det(I + H) - 1."""
    C = cofactor(H)
    return np.asarray(trace(H) + trace(C) + (H[..., 0, :] * C[..., 0, :]).sum(axis=-1))


def cofactor(F: Floats) -> Floats:
    """det(F) F^-T (..., 3, 3), also where F is singular."""
    C = np.empty_like(F)
    for i, j, k in _CYCLES:
        for r, s, t in _CYCLES:
            C[..., i, r] = F[..., j, s] * F[..., k, t] - F[..., j, t] * F[..., k, s]
    return C


def trace(E: Floats) -> Floats:
    return np.asarray(np.einsum("...ii->...", E))


def outer(indices: str, a: Floats, b: Floats) -> Floats:
    """Return the product of two tensors per point, e.g. "iJ,jK->JijK"."""
    inputs, out = indices.split("->")
    left, right = inputs.split(",")
    return np.asarray(np.einsum(f"...{left},...{right}->...{out}", a, b))
