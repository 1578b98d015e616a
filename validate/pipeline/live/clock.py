"""Real-time loop: position in, one step of the model, force out, with deadlines.

A tick that is not there when the next one is due is missed, and counted. Whatever comes in, no
force beyond the model's own limit goes out; without a new place it fades to zero.
"""

import gc
import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import perf_counter, sleep
from typing import Protocol

import numpy as np

from validate.arrays import Floats
from validate.errors import UsageError
from validate.pipeline.live.listener import CONTACT, FADED, LIMITED, NO_ANSWER
from validate.solve.haptic.rates import TickTimes
from validate.solve.types import HandStepper, State

_HELD, _ZERO = 0.02, 0.10  # s without a new place: the force is held, then fades to nothing
_AXES = "xyz"


class Places(Protocol):
    """Where places come from and forces go."""

    @property
    def kind(self) -> str: ...

    @property
    def rate(self) -> float: ...

    @property
    def findings(self) -> Mapping[str, int]: ...

    def due(self, k: int) -> float | None: ...

    def after(self, k: int, now: float) -> int: ...

    def place(self, k: int, now: float) -> Floats | None: ...

    def give(self, force: Floats, flags: int) -> None: ...


@dataclass(frozen=True)
class LiveRun:
    """What a live loop did. Every tick: `due` (n,) s, `late` (n,) s from then until the force was
    there, `work` (n,) s of it the loop's own, `changed` (n,) whether the contact changed. Ticks
    with a place that the model answered: `t` (m,) s, tip `x` (m, d) m, force given `F` (m, d) N.
    `skipped` ticks were over before their turn; `findings` are counts by what was found.
    """

    kind: str
    rate: float
    due: Floats
    late: Floats
    work: Floats
    changed: Floats
    t: Floats
    x: Floats
    F: Floats
    skipped: int
    findings: Mapping[str, int]

    @property
    def missed(self) -> int:
        """Ticks whose force came after the next tick was due, and those that were skipped."""
        return self.skipped + TickTimes(self.late).missed(1 / self.rate)

    @property
    def ticks(self) -> int:
        return self.skipped + len(self.due)


@dataclass(frozen=True)
class _Ticked:
    ticks: list[tuple[float, float, float, float]] = field(default_factory=list)
    places: list[tuple[float, Floats, Floats]] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)


@contextmanager
def quiet() -> Iterator[None]:
    """No collection of garbage in between: what exists is frozen."""
    gc.collect()
    gc.freeze()
    on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if on:
            gc.enable()
        gc.unfreeze()


@contextmanager
def realtime(*, wanted: bool) -> Iterator[None]:
    """This process before all that are scheduled as usual, where `wanted`; what it starts is not,
    but for the threads of a stepper (`live`), which come right behind it.

    Raises `UsageError` where the system has no such scheduling or refuses it.
    """
    if not wanted:
        yield
        return
    try:
        policy, before = os.sched_getscheduler(0), os.sched_getparam(0)
        first = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, first, os.sched_param(_behind() + 1))
    except (AttributeError, OSError) as error:
        raise UsageError(
            f"--realtime: {error}; it needs Linux and the permission (CAP_SYS_NICE, or ulimit -r)"
        ) from error
    try:
        yield
    finally:
        os.sched_setscheduler(0, policy, before)


def _behind() -> int:
    """The priority of a stepper's own threads, below the loop's."""
    return os.sched_get_priority_min(os.SCHED_FIFO)


def _first_too(threads: tuple[int, ...]) -> None:
    """The stepper's own threads behind the loop and before all others, where the loop is first."""
    if not (threads and hasattr(os, "sched_getscheduler")):
        return
    if os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO:
        for thread in threads:
            os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(_behind()))


def live(
    stepper: HandStepper,
    source: Places,
    seconds: float | None = None,
    clock: Callable[[], float] = perf_counter,
    wait: Callable[[float], None] = sleep,
) -> LiveRun:
    """Run until the source ends, or for so many seconds; an interruption ends it, too."""
    stepper.warm()
    _first_too(stepper.threads)
    kept, skipped = _Ticked(), 0
    with quiet():
        try:
            skipped = _run(_Model(stepper, kept), source, seconds, clock, wait)
        except KeyboardInterrupt:
            kept.counts["interrupted"] += 1
    d = len(stepper.tool.tip)
    ticks = np.array(kept.ticks).reshape(-1, 4).T
    due, late, work, changed = ticks
    return LiveRun(
        source.kind, source.rate, due, late, work, changed,
        np.array([t for t, _, _ in kept.places]),
        np.array([x for _, x, _ in kept.places]).reshape(-1, d),
        np.array([F for _, _, F in kept.places]).reshape(-1, d),
        skipped, {**source.findings, **kept.counts},
    )  # fmt: skip


def _run(
    model: "_Model",
    source: Places,
    seconds: float | None,
    clock: Callable[[], float],
    wait: Callable[[float], None],
) -> int:
    """Ticks until the end; how many were skipped."""
    k, skipped, start = 0, 0, clock()
    while (due := source.due(k)) is not None and (seconds is None or due < seconds):
        left = start + due - clock()
        if left > 0:
            wait(left)
        began = clock() - start
        changed = model.tick(due, source.place(k, began))
        source.give(model.force, model.flags)
        done = clock() - start
        model.kept.ticks.append((due, done - due, done - began, changed))
        following = source.after(k, done)
        skipped, k = skipped + following - k - 1, following
    return skipped


class _Model:
    """The stepper, its state, and the force (d,) N on the hand."""

    def __init__(self, stepper: HandStepper, kept: _Ticked) -> None:
        self.stepper, self.kept = stepper, kept
        self.state: State = stepper.rest()
        self.rest = np.array(stepper.tool.tip)
        self.force, self.flags = np.zeros(len(self.rest)), 0
        self._given, self._since = self.force, 0.0

    def tick(self, t: float, x: Floats | None) -> float:
        """The force at t s with the tip at x (d,) m; 1 where the contact changed."""
        if x is None:
            # Held for a moment, then less and less, then nothing
            self.kept.counts["ticks without a new place"] += 1
            share = (self._since + _ZERO - t) / (_ZERO - _HELD)
            self.force = self._given * min(max(share, 0.0), 1.0)
            self.flags = (self.flags & (CONTACT | LIMITED)) | (FADED if share < 1 else 0)
            return 0.0
        state = self.stepper.step(self.state, x - self.rest)
        if state.failure:
            self.force, self.flags = np.zeros(len(self.rest)), NO_ANSWER
            self._given = self.force
            self.kept.counts["no answer of the model"] += 1
            return 0.0
        self.state, self._since = state, t
        name, numbers = self.stepper.tool.name, state.numbers
        self.force = np.array([numbers[f"{name}.force.{a}"] for a in _AXES[: len(x)]])
        self._given = self.force
        touching, limited = numbers[f"{name}.contact"] > 0, numbers[f"{name}.clipped"] > 0
        self.flags = CONTACT * touching + LIMITED * limited
        self.kept.counts["force limited"] += limited
        self.kept.places.append((t, x, self.force))
        return numbers[f"{name}.changed"]
