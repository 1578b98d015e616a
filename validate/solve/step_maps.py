"""Maps of (q, v, a) of one mode over a step, of implicit and explicit rules, and their radii."""

from typing import Literal

import numpy as np

from validate.arrays import Floats
from validate.solve.newmark_rule import Rule, per_mode

UpdateName = Literal["printed", "lagged"]


def newmark_maps(rule: Rule, c: Floats, k: Floats, *, misprinted: bool = False) -> Floats:
    """Maps (r, 3, 3) of (q, q', q'') over a step of q'' + c q' + k q = 0; c 1/s, k 1/s^2 (r,)."""
    h, one, zero = rule.h, np.ones_like(c), np.zeros_like(c)
    q = np.stack(per_mode(rule, c, k)[:3], axis=-1)
    v_old = np.stack([zero, one, zero], axis=-1)
    a_old = np.stack([zero, zero, one], axis=-1)
    q_old = np.stack([one, zero, zero], axis=-1)
    v, a = rule.rates(q, q_old, v_old, a_old)
    if misprinted:
        q = q + h * (v - v_old)
    return np.stack([q, v, a], axis=1)


def explicit_maps(h: float, c: Floats, k: Floats, update: UpdateName) -> Floats:
    """As `newmark_maps`, for the explicit schemes."""
    one, zero = np.ones_like(c), np.zeros_like(c)
    half = np.stack([zero, one, h / 2 * one], axis=-1)
    q = np.stack([one, zero, zero], axis=-1) + h * half
    J = one if update == "lagged" else 1 + h / 2 * c
    a = -(k[:, None] * q + c[:, None] * half) / J[:, None]
    return np.stack([q, half + h / 2 * a, a], axis=1)


def spectral_radii(maps: Floats) -> Floats:
    """Largest magnitude of the eigenvalues of every map (r, m, m)."""
    return np.asarray(np.abs(np.linalg.eigvals(maps)).max(axis=-1))
