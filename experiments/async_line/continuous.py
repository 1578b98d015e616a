"""The continuous bar behind the probe's spring, exact in the frequency domain.

No mesh, no step and no region is in it.
"""

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats
from validate.scene.scene import Scene


def transfer(bar: Scene, spring: float, hz: Floats) -> NDArray[np.complex128]:
    """Force on the hand, N per m of the probe, at frequencies (k,) Hz: the continuous bar behind
    the spring. No mesh, no step and no region is in it.

    k(w) = (EA/L) q cot q with q^2 = L^2 (w^2 - i c w) rho/E; F = k ks / (k + ks).
    """
    body = bar.material
    length, height = np.ptp(bar.mesh.nodes, axis=0).tolist()
    w = 2 * np.pi * np.asarray(hz, dtype=np.float64)
    static = np.full(w.shape, body.E * (bar.thickness * height) / length, dtype=np.complex128)
    q = length * np.sqrt((w**2 - 1j * body.mass_damping * w) * body.rho / body.E + 0j)
    moving = np.abs(q) > 0
    static[moving] *= q[moving] / np.tan(q[moving])
    return np.asarray(static * spring / (static + spring))


def impedance(bar: Scene, spring: float, hz: Floats) -> Floats:
    """Peak force N of a probe that swings by a metre, at frequencies (k,) Hz."""
    return np.abs(transfer(bar, spring, hz))


def exact_force(bar: Scene, spring: float, t: Floats, depth: Floats) -> Floats:
    """Force (nt,) N of the continuous bar under a probe's `depth` (nt,) m at even times t (nt,) s,
    by the frequency domain; 20 s of rest after the end let it die down."""
    h = float(t[1] - t[0])
    n = len(t) + round(20.0 / h)
    hz: Floats = np.arange(n // 2 + 1, dtype=np.float64) / (n * h)
    F = transfer(bar, spring, hz) * np.fft.rfft(depth, n)
    return np.asarray(np.fft.irfft(F, n)[: len(t)])
