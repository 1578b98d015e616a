"""Ticks of `needle_pocket` against 512 Hz beside a busy core, and the rate of 500 boundary nodes.

python benchmarks/needle_ticks.py [SECONDS] [--realtime]    of live running (default 10)

First the model runs live along the shipped path, again and again, while a second process keeps
another core busy with dense products; told are ticks met and quantiles. With --realtime this
process asks the system for real-time scheduling (Linux, needs the right to it). Then a cube in 3-D
whose upper side and pocket have about 500 nodes is touched and let go as fast as it goes.
"""

import os
import sys

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy loads its BLAS
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from dataclasses import replace
from multiprocessing import get_context
from time import perf_counter

import numpy as np

from experiments.needle_pocket.hand import Hand
from validate.arrays import Floats
from validate.fem.system import build
from validate.pipeline import load
from validate.pipeline.experiment.options import Options
from validate.pipeline.experiment.tree import Built
from validate.pipeline.live import LiveRun, RecordedPath, live, prepared, realtime
from validate.pipeline.live.clock import quiet
from validate.scene.contact import Needle
from validate.solve.haptic.needle import NeedleLoop, NeedleStepper
from validate.solve.haptic.rates import DEVICE_HZ, TickTimes

METHODS = ("p2_exact", "paper")
CELLS = 18  # along an edge of the cube: its upper side has 361 nodes
ROUNDS = 20


def busy() -> None:
    """Until it is ended."""
    a = np.random.default_rng(0).normal(size=(300, 300))
    while True:
        a = a @ a / 300


def told(name: str, seconds: Floats, deadline: float) -> None:
    times = TickTimes(seconds)
    us = " ".join(f"{1e6 * q:8.1f}" for q in times.quantiles)
    met = 100 * (1 - times.missed(deadline) / len(seconds))
    print(f"{name:44} {len(seconds):7} {us}   {met:8.3f}")


def head(deadline: float) -> None:
    names = " ".join(f"{100 * q:7g}%" for q in TickTimes.shares)
    print(f"{'microseconds':44} {'ticks':>7} {names}  longest   met {1e6 * deadline:.0f} us / %")


def run_live(method: str, seconds: float) -> LiveRun:
    made = prepared(load("needle_pocket"), Options({}), method)
    t, x = made.path.t - made.path.t[0], made.path.x
    times = int(np.ceil(seconds / t[-1]))
    turn = t[-1] + t[1]
    long = RecordedPath(
        np.concatenate([t + k * turn for k in range(times)]), np.tile(x, (times, 1))
    )
    return live(made.stepper, long, seconds)


def beside_a_busy_core(seconds: float) -> None:
    other = get_context("spawn").Process(target=busy, daemon=True)
    other.start()
    try:
        print(f"live at {DEVICE_HZ:g} Hz beside a busy process, {os.cpu_count()} cores, "
              f"load {os.getloadavg()[0]:.1f}")  # fmt: skip
        head(1 / DEVICE_HZ)
        for method in METHODS:
            done = run_live(method, seconds)
            told(f"{method}, due to force", done.late, 1 / DEVICE_HZ)
            told(f"{method}, work of the loop", done.work, 1 / DEVICE_HZ)
            told(f"{method}, changes of contact", done.work[done.changed > 0], 1 / DEVICE_HZ)
    finally:
        other.terminate()
        other.join()


def large() -> NeedleStepper:
    body = {"body.space": "solid", "body.solid": CELLS}
    scene = Built()(None, load("needle_pocket").parameters, body)
    needle = Needle("needle", "top", (0.0031, 0.003, 0.002), (0.0, -1.0, 0.0))
    stepper = NeedleLoop(grip=0.05).prepare(build(replace(scene, tools=(needle,))))
    assert isinstance(stepper, NeedleStepper)
    return stepper


def as_fast_as_it_goes() -> None:
    stepper = large()
    rest = np.array(stepper.tool.tip)
    _, x = Hand(0.004, (0.0031, 0.0, 0.002), DEVICE_HZ, 2e-5, 1).path()
    stepper.warm()
    seconds, changed, touching = [], [], []
    with quiet():
        state = stepper.rest()
        for place in np.tile(x, (ROUNDS, 1)):
            start = perf_counter()
            state = stepper.step(state, place - rest)
            seconds.append(perf_counter() - start)
            changed.append(state.numbers["needle.changed"] > 0)
            touching.append(state.numbers["needle.contact"] > 0)
    nodes, deadline = len(stepper.small.nodes), 1e-4
    took, change, touch = np.array(seconds), np.array(changed), np.array(touching)
    print(f"\ncube with {nodes} boundary nodes, {len(stepper.scene.mesh.nodes)} in all")
    head(deadline)
    told("all", took, deadline)
    told("in contact", took[touch & ~change], deadline)
    told("free: the search alone", took[~touch & ~change], deadline)
    told("changes of contact", took[change], deadline)
    print(f"median rate in contact {1e-3 / np.median(took[touch & ~change]):.1f} kHz, "
          f"of all {1e-3 / np.median(took):.1f} kHz")  # fmt: skip


def main() -> None:
    given = [a for a in sys.argv[1:] if a != "--realtime"]
    with realtime(wanted="--realtime" in sys.argv):
        beside_a_busy_core(float(given[0]) if given else 10.0)
        as_fast_as_it_goes()


if __name__ == "__main__":
    main()
