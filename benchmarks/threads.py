"""Threads of an explicit step, alone and beside a busy process: one, two, and what a pilot takes.

OMP_NUM_THREADS=1 python benchmarks/threads.py [STEPS]    steps of each, of 10 substeps (default 60)

Each kind of step takes turns with the others, so that what else runs slows all; us a step, medians.
"Two" are two threads whatever the machine does; "chosen" is `CentralDifference(threads=2)`.
"""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from statistics import median
from time import perf_counter

import numpy as np
from explicit import SUBSTEPS, system

from validate.fem.kernels.threads import cores
from validate.fem.system import System
from validate.solve.explicit.central import CentralDifference, CentralStepper

CELLS = (12, 12, 10)  # 8640 tetrahedra


@contextmanager
def busy(processes: int) -> Iterator[None]:
    """So many others that keep a core each."""
    started = [
        subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(processes)
    ]
    try:
        yield
    finally:
        for process in started:
            process.kill()
            process.wait()


def prepared(of: System, threads: int) -> CentralStepper:
    settings = CentralDifference(1e-5 * SUBSTEPS, SUBSTEPS, watch=10**9, threads=threads)
    stepper = settings.prepare(of)
    assert isinstance(stepper, CentralStepper)
    return stepper


def measured(of: System, steps: int) -> tuple[dict[str, float], str]:
    """us a step by kind, and what the chosen one says."""
    kinds = {"one": prepared(of, 1), "two": prepared(of, 1), "chosen": prepared(of, 2)}
    kinds["two"].body.share(2)
    states = {name: stepper.rest() for name, stepper in kinds.items()}
    seconds: dict[str, list[float]] = {name: [] for name in kinds}
    for _ in range(steps):
        for name, stepper in kinds.items():
            start = perf_counter()
            states[name] = stepper.step(states[name], np.array([1e-6]))
            seconds[name].append(perf_counter() - start)
    (said,) = kinds["chosen"].notices(states["chosen"])
    return {name: 1e6 * median(own) for name, own in seconds.items()}, said


def main(steps: int) -> None:
    of = system(CELLS, "svk")
    print("| busy processes beside | one us | two us | chosen us | load average | said |")
    print("| --- | --- | --- | --- | --- | --- |")
    for others in (0, 1, cores()):
        with busy(others):
            found, said = measured(of, steps)
        times = " | ".join(f"{us:.0f}" for us in found.values())
        print(f"| {others} | {times} | {os.getloadavg()[0]:.1f} | {said} |", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 60)
