"""Nonlinear filters against the plain explicit step, all in one run, beside the real-time factor.

OMP_NUM_THREADS=1 python benchmarks/filters.py [STEPS]    STEPS of each filter (default 2000)

Steps of the filters take turns with plain ones, so that a busy machine slows both; times are
medians of steps without and with a measurement, ratios those of the mean step at 200 Hz. Counted
in flop, a node EKF is 1.47 plain steps, its 3 x 3 block 1.76 (`benchmarks/explicit.py` counts the
element loops; an unknown adds 10, a 3 x 3 node 110); what is done besides is alike in both.
"""

import sys
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np
from scipy import sparse

from validate.arrays import Floats
from validate.estimate.extended.node_ekf import NodeEKF
from validate.estimate.filters import Filter
from validate.estimate.measurements import Measurements
from validate.estimate.reduced.reduced_ekf import ReducedEKF
from validate.fem.critical import CriticalStep
from validate.fem.system import System, build
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.scene import Load, Scene, Support
from validate.solve.explicit.central import CentralDifference
from validate.solve.haptic.rates import RealTime
from validate.solve.types import State, Stepper

CELLS = (8, 8, 10)  # 3840 tetrahedra
RATE = 200.0  # Hz, of node A
_UNTIMED = 50


@dataclass(frozen=True)
class Timed:
    """Seconds of steps without and with a measurement, and of the plain steps between them."""

    quiet: float
    measured: float
    plain: float

    def mean(self, gap: int) -> float:
        return self.quiet + (self.measured - self.quiet) / gap


def cube() -> System:
    """Paper 003's cube: 0.1 m, E 30 kPa, nu .49, 1000 kg/m3, held at z0, pushed at x0."""
    material = Material(30e3, 0.49, "svk", 1000.0)
    loads = (Load("push", "x0", (1.0, 0.0, 0.0)),)
    supports = (Support("z0", (0, 1, 2)),)
    return build(Scene(box((0.1, 0.1, 0.1), CELLS), material, supports, loads=loads))


def readings(system: System, dt: float, gap: int, steps: int) -> Measurements:
    """Zero displacement of node A with every `gap`-th step; the arithmetic is what is timed."""
    node = system.scene.mesh.nearest_node(np.array([0.0, 0.05, 0.05]))
    H = sparse.csr_array(sparse.eye_array(len(system.moves)).tocsr()[3 * node : 3 * node + 3])
    t = dt * gap * np.arange(1, steps // gap + 1)
    names = ("A.x", "A.y", "A.z")
    return Measurements(t, H, np.zeros((len(t), 3)), np.full(3, 3e-5), names)


def timed(stepper: Stepper, plain: Stepper, gap: int, steps: int) -> Timed:
    """Medians over steps that take turns with plain ones."""
    inputs = np.full(1, 0.1)
    seconds: dict[str, list[float]] = {"quiet": [], "measured": [], "plain": []}
    state, other = stepper.rest(), plain.rest()
    for k in range(1, steps + 1):
        state, own = _clocked(stepper, state, inputs)
        other, base = _clocked(plain, other, inputs)
        if k > _UNTIMED:
            seconds["plain"].append(base)
            seconds["quiet" if k % gap else "measured"].append(own)
    quiet = seconds["quiet"] or seconds["measured"]
    return Timed(*(float(np.median(s)) for s in (quiet, seconds["measured"], seconds["plain"])))


def _clocked(stepper: Stepper, state: State, inputs: Floats) -> tuple[State, float]:
    start = perf_counter()
    after = stepper.step(state, inputs)
    took = perf_counter() - start
    if after.failure:
        raise RuntimeError(f"step {state.k + 1}: {after.failure[1]}")
    return after, took


def filters(dt: float) -> dict[str, tuple[Filter, bool]]:
    """Settings by name, and whether they are measured at every step as in the paper."""
    node = NodeEKF(dt, overflow="hold")
    reduced = ReducedEKF(dt)
    return {
        "node EKF, component (printed)": (node, True),
        "node EKF, 3 x 3 block": (replace(node, block="node"), True),
        "node EKF, companion": (replace(node, block="companion"), True),
        "reduced EKF, 20 modes + bias": (reduced, False),
        "reduced EKF, 20 modes, steady gain": (replace(reduced, gains="steady"), False),
        "reduced EKF, 5 POD + bias": (replace(reduced, basis="pod", shapes=5), False),
    }


def table(steps: int) -> str:
    """The whole table in Markdown."""
    system = cube()
    limit = CriticalStep.of(system)
    gap = int(np.ceil(1 / RATE / limit.recommended))
    dt = 1 / RATE / gap
    plain = CentralDifference(dt).prepare(system)
    head = ("filter", "quiet us", "measured us", "plain us", "ratio", "Hz", "dt/dt_crit", "x real")
    lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    for name, (settings, always) in filters(dt).items():
        every = 1 if always else gap
        stepper = settings.prepare(system, readings(system, dt, every, steps))
        found = timed(stepper, plain, every, steps)
        mean = found.mean(every)
        real = RealTime(1 / mean, dt, limit.lanczos)
        cells = [name, *(f"{1e6 * s:.1f}" for s in (found.quiet, found.measured, found.plain))]
        cells += [f"{mean / found.plain:.2f}", f"{real.rate_hz:.0f}", f"{real.ratio:.2f}"]
        lines.append("| " + " | ".join([*cells, f"{real.factor:.2f}"]) + " |")
    return "\n".join(lines)


def main() -> None:
    steps = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    print(table(steps))


if __name__ == "__main__":
    main()
