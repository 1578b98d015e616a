"""Milliseconds per step of every linear baseline on paper 001's block, in one run, one thread.

python benchmarks/linear_steps.py [STEPS]    STEPS per baseline (default 500; the slow ones fewer)
"""

import os
import sys

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy loads its BLAS
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from dataclasses import dataclass
from time import perf_counter

import numpy as np

from validate.fem.system import System, build
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.scene import Load, Scene, Support
from validate.solve.dynamic.modal import Modal
from validate.solve.dynamic.newmark import Newmark
from validate.solve.static.quasi_static import QuasiStatic
from validate.solve.types import Scheme

LOAD = np.array([3000 * 16e-6])  # N: 3 kPa on the block's top
SLOW = 10  # steps of a baseline that takes tens of milliseconds


@dataclass(frozen=True)
class Baseline:
    """A scheme, the most steps it is given, and whether its field is formed at every step."""

    name: str
    scheme: Scheme
    at_most: int
    field: bool = False


BASELINES = (
    Baseline("Newmark, prefactored", Newmark(), 10**6),
    Baseline("Newmark, Gaussian elimination", Newmark(solver="gaussian_elimination"), SLOW),
    Baseline("Newmark, dense solve", Newmark(solver="dense_solve"), 10 * SLOW),
    Baseline("Newmark, sparse LU", Newmark(solver="sparse_lu"), 10 * SLOW),
    Baseline("Newmark, dense inverse", Newmark(solver="dense_inverse"), 10**6),
    Baseline("backward Euler, prefactored", Newmark(rule="backward_euler"), 10**6),
    Baseline("generalised alpha, prefactored", Newmark(rule="generalised_alpha", a0="zero"), 10**6),
    Baseline("modal, 525 modes with field", Modal(), 10**6, True),
    Baseline("modal, 525 modes, amplitudes", Modal(), 10**6),
    Baseline("modal, 40 modes with field", Modal(modes=40), 10**6, True),
    Baseline("modal, 40 modes, amplitudes", Modal(modes=40), 10**6),
    Baseline("quasi-static", QuasiStatic(), 10**6),
)


def block() -> System:
    """200 nodes, 672 tetrahedra, 525 free unknowns (paper 001, Table 1)."""
    return build(
        Scene(
            box((0.004, 0.004, 0.007), (4, 4, 7)),
            Material(1e4, 0.47, rho=1068.0, stiffness_damping=0.1),
            (Support("z0", (0, 1, 2)),),
            loads=(Load("pull", "z1", (0.0, 0.0, 1.0)),),
        )
    )


def measured(baseline: Baseline, system: System, steps: int) -> tuple[float, float, float]:
    """Set-up s, median and 99 % quantile s of a step."""
    start = perf_counter()
    stepper = baseline.scheme.prepare(system)
    setup, state, seconds = perf_counter() - start, stepper.rest(), []
    for _ in range(min(steps, baseline.at_most)):
        start = perf_counter()
        state = stepper.step(state, LOAD)
        if baseline.field:
            stepper.field(state)
        seconds.append(perf_counter() - start)
    p50, p99 = np.quantile(seconds, [0.5, 0.99])
    return setup, float(p50), float(p99)


def main(steps: int) -> None:
    system = block()
    for matrix in (system.K, system.M, system.C):  # assembled once, outside every set-up
        matrix.sum()
    print(f"{'baseline':34} {'set-up ms':>10} {'p50 ms':>9} {'p99 ms':>9} {'ratio':>8}")
    first = 0.0
    for baseline in BASELINES:
        setup, p50, p99 = measured(baseline, system, steps)
        first = first or p50
        row = f"{1e3 * setup:10.1f} {1e3 * p50:9.4f} {1e3 * p99:9.4f} {p50 / first:8.2f}"
        print(f"{baseline.name:34} {row}", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 500)
