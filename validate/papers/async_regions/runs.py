"""Runs of paper 004's bodies under a pushed probe, with the energy that their borders make."""

from dataclasses import dataclass
from time import thread_time
from typing import cast

import numpy as np

from validate.arrays import Floats
from validate.fem.system import build
from validate.papers.async_regions.bodies import PROBE
from validate.scene.scene import Scene
from validate.solve.region_march import spectral_radius
from validate.solve.regions import AsyncRegions, RegionStepper


@dataclass(frozen=True)
class Pushed:
    """Force (nt,) N on the hand along x, CPU time of the ticks (nt,) s, layers (nt,) of the primary
    region.

    `made` J is the largest energy of body and spring beyond what the hand put in and damping took;
    `put` J the largest that the hand had put in. `words` on rounding and how it ended.
    """

    force: Floats
    tick_s: Floats
    layers: Floats
    made: float
    put: float
    words: tuple[str, ...]


def stepper_of(scene: Scene, settings: AsyncRegions) -> RegionStepper:
    return cast(RegionStepper, settings.prepare(build(scene)))


def pushed(scene: Scene, settings: AsyncRegions, depth: Floats, account: bool = False) -> Pushed:
    """Walks a probe that is pushed by `depth` (nt,) m along -x; `account`: with energies."""
    stepper = stepper_of(scene, settings)
    state, d, h = stepper.rest(), scene.mesh.dimension, settings.dt
    force, seconds, layers = [], [], []
    m, c, K = stepper.body.body.m, stepper.body.body.c, stepper.body.body.K
    ledger, before, last_x = [(0.0, 0.0)], stepper.body.still, 0.0
    put = lost = 0.0
    for x in depth:
        start = thread_time()
        state = stepper.step(state, np.array([-x, *[0.0] * (d - 1)]))
        seconds.append(thread_time() - start)
        if state.failure:
            break
        force.append(state.numbers[f"{PROBE}.force.x"])
        layers.append(state.numbers[f"{PROBE}.layers"])
        if account:
            u = state.inner.motion.visible
            v = (u - before) / h
            lost += h * float(c @ v**2)
            put += (force[-1] + (force[-2] if len(force) > 1 else 0.0)) / 2 * (x - last_x)
            spring = force[-1] ** 2 / (2 * settings.spring) if settings.spring else 0.0
            ledger.append((float(m @ v**2 + u @ (K @ u)) / 2 + spring + lost - put, put))
            before, last_x = u, float(x)
    ends = (state.failure[1],) if state.failure else ()
    made, given = np.array(ledger).max(axis=0)
    return Pushed(
        np.array(force), np.array(seconds), np.array(layers), float(made), float(given),
        stepper.notices(state) + ends,
    )  # fmt: skip


def growth(scene: Scene, settings: AsyncRegions) -> float:
    """Spectral radius over a common period, a tick (the period's root), with the probe held."""
    stepper = stepper_of(scene, settings)
    state = stepper.step(stepper.rest(), np.zeros(scene.mesh.dimension))
    held, regions = state.inner.held, state.inner.regions
    pull = np.stack([stepper.probe.nodal(held, np.array(stepper.tool.tip), u)
                     for u in np.eye(len(stepper.body.at))], axis=1)  # fmt: skip

    def forces(visible: Floats) -> Floats:
        return np.asarray(pull @ visible)

    return float(spectral_radius(regions.coupled, forces) ** (1 / regions.coupled.common))


def peak(force: Floats, t: Floats, around: float, within: float) -> float:
    """Largest force N in `around` +- `within` s."""
    return float(force[np.abs(t[: len(force)] - around) <= within].max())


def off(force: Floats, whole: Floats) -> float:
    """Rms of the difference over the rms of the whole solve's force."""
    return float(np.sqrt(np.mean((force - whole) ** 2) / np.mean(whole**2)))
