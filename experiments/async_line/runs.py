"""Runs of paper 004's bodies under a pushed probe, with the energy that their borders make."""

from dataclasses import dataclass, replace
from time import thread_time

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats
from validate.fem.system import System, build
from validate.scene.scene import Scene
from validate.solve.regions.krylov import TouchedKrylov
from validate.solve.regions.scheme import AsyncRegions

from .probe import PROBE


@dataclass(frozen=True)
class Pushed:
    """Force (nt,) N on the hand along x, CPU time of the ticks (nt,) s, layers (nt,) of the primary
    region (0: there is none).

    `made` J is the largest energy of body and spring beyond what the hand put in and damping took,
    `lost` J the most that they lacked of it; `put` J the largest that the hand had put in.
    `changed` (nt,): whether regions or contact changed in the tick. `words` on rounding and
    how it ended.
    """

    force: Floats
    tick_s: Floats
    layers: Floats
    made: float
    put: float
    lost: float
    changed: NDArray[np.bool_]
    words: tuple[str, ...]


def pushed(
    scene: Scene, settings: AsyncRegions | TouchedKrylov, path: Floats, account: bool = False
) -> Pushed:
    """Walks a probe along `path` (nt, d) m, or by (nt,) m along -x; `account`: with energies."""
    stepper = settings.prepare(build(scene))
    if path.ndim == 1:
        path = np.pad(-path[:, None], [(0, 0), (0, scene.mesh.dimension - 1)])
    state, ledger = stepper.rest(), Ledger.of(scene, settings) if account else None
    forces, seconds, layers, changed = [], [], [], []
    names = [f"{PROBE}.force.{a}" for a in "xyz"[: path.shape[1]]]
    for x in path:
        start = thread_time()
        state = stepper.step(state, x)
        seconds.append(thread_time() - start)
        if state.failure:
            break
        forces.append([state.numbers[name] for name in names])
        layers.append(state.numbers.get(f"{PROBE}.layers", 0.0))
        changed.append(state.numbers.get(f"{PROBE}.changed", 0.0) > 0)
        if ledger:
            ledger = ledger.after(stepper.field(state), x, np.array(forces[-1]))
    words = stepper.notices(state) if hasattr(stepper, "notices") else ()
    ends = (state.failure[1],) if state.failure else ()
    return Pushed(
        np.array(forces).reshape(-1, len(names))[:, 0], np.array(seconds), np.array(layers),
        ledger.made if ledger else 0.0, ledger.most if ledger else 0.0,
        ledger.missing if ledger else 0.0, np.array(changed, dtype=np.bool_), words + ends,
    )  # fmt: skip


@dataclass(frozen=True)
class Ledger:
    """Energies J of a linear body and the probe's spring: `put` in by the hand, `lost` to damping;
    `made`, `missing` and `most` are the largest made, lacked and put in so far. `u` (N,), `x` (d,),
    `f` (d,) N of the last tick."""

    system: System
    spring: float
    h: float
    u: Floats
    x: Floats
    f: Floats
    put: float = 0.0
    lost: float = 0.0
    made: float = 0.0
    most: float = 0.0
    missing: float = 0.0

    @classmethod
    def of(cls, scene: Scene, settings: AsyncRegions | TouchedKrylov) -> "Ledger":
        zero = np.zeros(scene.mesh.dimension)
        system = build(scene)
        return cls(system, settings.spring, settings.dt, np.zeros(len(system.moves)), zero, zero)

    def after(self, u: Floats, x: Floats, f: Floats) -> "Ledger":
        """After a tick that ends with u (n, d) m, the probe at x (d,) m and the force f (d,) N."""
        u, m = u.ravel(), self.system.masses
        v = (u - self.u) / self.h
        lost = self.lost + self.h * self.system.scene.material.mass_damping * float(m @ v**2)
        put = self.put - float((f + self.f) @ (x - self.x)) / 2
        stretched = float(f @ f) / (2 * self.spring) if self.spring else 0.0
        held = float(m @ v**2 + u @ (self.system.K @ u)) / 2 + stretched
        return replace(
            self, u=u, x=x, f=f, put=put, lost=lost,
            made=max(self.made, held + lost - put), most=max(self.most, put),
            missing=max(self.missing, put - held - lost),
        )  # fmt: skip


def peak(force: Floats, t: Floats, around: float, within: float) -> float:
    """Largest force N in `around` +- `within` s."""
    return float(force[np.abs(t[: len(force)] - around) <= within].max())


def off(force: Floats, whole: Floats) -> float:
    """Rms of the difference over the rms of the whole solve's force."""
    return float(np.sqrt(np.mean((force - whole) ** 2) / np.mean(whole**2)))
