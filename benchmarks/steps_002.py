"""Microseconds per implicit step of paper 002's rod by every solver, in one run, one thread.

python benchmarks/steps_002.py [N ...]    cells across (default 4 8 12: 600, 3888, 12168 unknowns)

The first column after the times is the ratio to scipy's own prefactored solve (SuperLU with its
default ordering, one solve and the products of a step) measured in the same run.
"""

import os
import sys

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy loads its BLAS
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from scipy.sparse.linalg import splu

from experiments.bending_rod.body import GRAVITY, bending_rod
from validate.errors import SceneError
from validate.fem.system import System, build
from validate.solve.dynamic.modal import Modal
from validate.solve.dynamic.newmark import Newmark
from validate.solve.types import Scheme

DT = 1 / 30  # s, as printed
BUDGET = 3.0  # s of steps per solver
MOST = 200  # steps
INPUT = np.array([GRAVITY])


@dataclass(frozen=True)
class Baseline:
    name: str
    scheme: Scheme
    field: bool = False


BASELINES = (
    Baseline("prefactored sparse", Newmark(DT)),
    Baseline("dense inverse", Newmark(DT, solver="dense_inverse")),
    Baseline("CG, warm start", Newmark(DT, solver="cg")),
    Baseline("Gauss-Seidel, warm start", Newmark(DT, solver="gauss_seidel")),
    Baseline("modal 40, amplitudes", Modal(DT, modes=40)),
    Baseline("modal 40, all displacements", Modal(DT, modes=40), True),
)


def repeated(step: Callable[[], None]) -> tuple[float, int]:
    """Median seconds of a step, and how many were timed; the first warms up."""
    step()
    seconds: list[float] = []
    while len(seconds) < MOST and (len(seconds) < 3 or sum(seconds) < BUDGET):
        start = perf_counter()
        step()
        seconds.append(perf_counter() - start)
    return float(np.median(seconds)), len(seconds)


def scipy_step(system: System) -> tuple[float, float, int]:
    """Set-up s, step s and steps of average acceleration written down with scipy alone."""
    start, free, h = perf_counter(), system.free, DT
    M, C, K = (X[free][:, free].tocsc() for X in (system.M, system.C, system.K))
    lu = splu((M + h / 2 * C + h * h / 4 * K).tocsc())
    f = system.loads[free] @ INPUT
    setup = perf_counter() - start
    u = v = np.zeros(len(free))
    a = np.zeros(len(free))
    state = [u, v, a]

    def step() -> None:
        u, v, a = state
        half = v + h / 2 * a
        new = lu.solve(f - C @ half - K @ (u + h * v + h * h / 4 * a))
        state[:] = [u + h * v + h * h / 4 * (a + new), half + h / 2 * new, new]

    return setup, *repeated(step)


def ours(baseline: Baseline, system: System) -> tuple[float, float, int]:
    """Set-up s, step s and steps of one baseline."""
    start = perf_counter()
    stepper = baseline.scheme.prepare(system)
    setup, state = perf_counter() - start, [stepper.rest()]

    def step() -> None:
        state[0] = stepper.step(state[0], INPUT)
        if baseline.field:
            stepper.field(state[0])

    return setup, *repeated(step)


def main(sizes: list[int]) -> None:
    for n in sizes:
        system = build(bending_rod(n))
        for matrix in (system.K, system.M, system.C):  # assembled once, outside every set-up
            matrix.sum()
        print(f"\nrod {2 * n} x {n} x {n} hexahedra, {len(system.free)} unknowns")
        print(f"{'solver':30} {'set-up ms':>10} {'step us':>10} {'of scipy':>9} {'steps':>6}")
        setup, first, count = scipy_step(system)
        print(f"{'scipy splu, prefactored':30} {1e3 * setup:10.1f} {1e6 * first:10.1f} "
              f"{1.0:9.3f} {count:6d}", flush=True)  # fmt: skip
        for baseline in BASELINES:
            try:
                setup, step, count = ours(baseline, system)
            except SceneError as error:
                print(f"{baseline.name:30} refused: {error}")
                continue
            print(f"{baseline.name:30} {1e3 * setup:10.1f} {1e6 * step:10.1f} "
                  f"{step / first:9.3f} {count:6d}", flush=True)  # fmt: skip


if __name__ == "__main__":
    main([int(a) for a in sys.argv[1:]] or [4, 8, 12])
