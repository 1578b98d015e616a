"""The twin of the bar: a continuous bar behind the probe's spring.

It is exact in the frequency domain: another model than the methods', without elements, time steps
or regions.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats
from validate.parameters import with_given
from validate.pipeline.experiment.experiment import Progress
from validate.pipeline.experiment.tree import Built, Tree
from validate.recording.types import Recording
from validate.register.registration import Registered
from validate.scene.scene import Scene
from validate.solve.regions.scheme import AsyncRegions

from .probe import HapticTest, chirp, pad_of, probed


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


def bar(tree: Tree, given: Mapping[str, Any] | None = None) -> Scene:
    """The bar with the probe, with other values by path where given."""
    return Built()(None, with_given(tree, given or {}))


def with_cells(tree: Tree, cells: int) -> Scene:
    """The bar in so many square cells, of the same length and area."""
    length, height = tree.scene.body.size
    side = length / cells
    area = tree.scene.thickness * height
    return bar(
        tree, {"body.cells": (cells, 1), "body.size": (length, side), "thickness": area / side}
    )


def record(tree: Tree, progress: Progress) -> Recording:
    """Signals "probe" (m, along x and y) at every tick and "force" (N, on the hand)."""
    progress("simulate")
    own: HapticTest = tree.settings
    t: Floats = own.dt * np.arange(round(own.probe.seconds / own.dt) + 1, dtype=np.float64)
    depth = chirp(t, own.probe.depth, own.probe.lowest, own.probe.highest)
    force = exact_force(bar(tree), own.probe.spring, t, depth)
    path = np.stack([-depth, np.zeros(len(t))], axis=1)
    law = "continuous linear bar, frequency domain"
    return probed("async_line", t, path, force, own.twin, same=False, law=law)


def sets(tree: Tree, seen: Registered) -> Mapping[str, Any]:
    own: HapticTest = tree.settings
    return {"dt": own.dt, "spring": own.probe.spring, "pad": pad_of(bar(tree))}


def whole_of(tree: Tree) -> AsyncRegions:
    """The whole solve at every tick, as the experiment sets it."""
    own: HapticTest = tree.settings
    return AsyncRegions(own.dt, (), (), spring=own.probe.spring, pad=pad_of(bar(tree)))
