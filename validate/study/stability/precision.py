"""Errors of single precision against double, and of energy over 1e5 steps."""

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from validate.arrays import Floats
from validate.fem.system import System
from validate.solve.study_entries import Rates, Stepping

STEPS = 1000  # of an explicit run in both precisions
_FORMS = (True, False)  # in positions, in velocities
DRIFT_STEPS = 100_000
_SHARE = 0.02  # of the critical step: positions lose their digits where steps are small


@dataclass(frozen=True)
class Rounding:
    """float32 less float64, relative to the largest displacement; None where it is not finite.

    Of a static solution, and of 1000 explicit steps with lumped mass at 2 % of the critical step:
    written in positions (u'' = 2 u' - u + ...), and in velocities.
    """

    static: float | None
    positions: float | None
    velocities: float | None


def rounding(system: System, limit: float) -> Rounding:
    """Of the body under its one load, switched on at t = 0; `limit` is its critical step s."""
    free = system.free
    K, f = sparse.csr_array(system.K[free][:, free]), system.loads[free, 0]
    static = _distance(*(_solved(K.astype(t), f.astype(t)) for t in (np.float32, np.float64)))
    masses, h = system.masses[free], _SHARE * limit
    runs = [
        [_stepped(K.astype(t), f.astype(t), (h * h / masses).astype(t), form) for form in _FORMS]
        for t in (np.float32, np.float64)
    ]
    return Rounding(static, _distance(runs[0][0], runs[1][0]), _distance(runs[0][1], runs[1][1]))


def _solved(K: sparse.csr_array, f: Floats) -> Floats:
    try:
        return np.asarray(splu(K.tocsc()).solve(f))
    except RuntimeError:  # singular in this precision
        return np.full(len(f), np.nan)


def _stepped(K: sparse.csr_array, f: Floats, gain: Floats, positions: bool) -> Floats:
    """Displacements (m,) after 1000 steps from rest, in the precision given; `gain` is h^2/m."""
    u, old, d = (np.zeros_like(f) for _ in range(3))
    for k in range(STEPS):
        push = gain * (f - K @ u) * f.dtype.type(0.5 if k == 0 else 1.0)
        if positions:
            u, old = 2 * u - old + push, u
        else:
            d = d + push
            u = u + d
    return u


def _distance(single: Floats, double: Floats) -> float | None:
    size = float(np.abs(double).max())
    apart = float(np.abs(single.astype(np.float64) - double).max())
    return apart / size if np.isfinite(apart) and size > 0 else None


@dataclass(frozen=True)
class Drift:
    """Energy after 1e5 undamped steps over that at the start, in both precisions.

    Of explicit schemes the energy that they keep exactly (of half steps), else strain + kinetic.
    """

    scheme: str
    dt: float
    double: float | None
    single: float | None


def drift(scheme: Stepping, h: float, omegas: Floats) -> Drift:
    """All modes (r,) 1/s, each from amplitude 1/w at rest, stepped 1e5 times by the step map."""
    rates = Rates(omegas * h, 0.0, 0.0)
    maps = scheme.maps(rates)
    start = _start(rates.x, maps.shape[-1])
    found = []
    for kind in (np.float64, np.float32):
        state = start.astype(kind)
        steps = np.ascontiguousarray(maps.astype(kind).transpose(1, 2, 0))
        with np.errstate(over="ignore", invalid="ignore"):  # growth ends in None
            for _ in range(DRIFT_STEPS):
                state = (steps * state).sum(axis=1)
            energy = _energy(scheme, rates.x, state.astype(np.float64))
        ratio = energy / _energy(scheme, rates.x, start)
        found.append(float(ratio) if np.isfinite(ratio) else None)
    return Drift(scheme.name, h, *found)


def _start(x: Floats, size: int) -> Floats:
    """States (m, r) with the same strain energy in every mode, at rest and in balance."""
    q = 1 / x
    if size == 2:  # u and its last increment, from which the half step behind has rest in it
        return np.stack([q, x * x * q / 2])
    return np.stack([q, 0 * q, -x * x * q])


def _energy(scheme: Stepping, x: Floats, state: Floats) -> float:
    """Twice the energy of all modes in units of the step."""
    if len(state) == 2:
        u, d = state
        return float((d * d + x * x * u * (u - d)).sum())
    q, v = state[:2]
    stiff = x * x * (1 - x * x / 4) if scheme.explicit else x * x
    return float((v * v + stiff * q * q).sum())
