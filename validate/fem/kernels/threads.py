"""Number of threads of an explicit step, chosen by a measured pilot.

Threads meet at the end of every step: where another process has a core, all wait for the one that
it keeps, and a step takes several times as long as alone. So the machine is asked first, then a
few steps by each number of threads take turns, and what was chosen is watched while it runs.
"""

import os
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from time import perf_counter, sleep

CLEARLY = 0.9  # of one thread's time, by medians and by minima: less is no gain worth a risk
_ROUNDS = 15
_PILOT_S = 0.5  # s after which a pilot of long steps ends
_LOOKS, _BETWEEN_S = 5, 0.01  # at what else runs
_RECENT = 11  # steps whose median shows that the machine has become busy
_LOADAVG = Path("/proc/loadavg")


@dataclass(frozen=True)
class ThreadChoice:
    """`threads` of at most `most`; `seconds` are the medians of a step by number of threads, none
    where no core but this one was idle."""

    threads: int
    most: int
    seconds: Mapping[int, float]

    @property
    def words(self) -> str:
        taken = f"threads: {self.threads} of {self.most}"
        if not self.seconds:
            return f"{taken}; no other core is idle"
        times = ", ".join(f"{n}: {1e6 * s:.3g} us" for n, s in self.seconds.items())
        return f"{taken}, pilot {times}"


def chosen(most: int, seconds: Mapping[int, Sequence[float]]) -> ThreadChoice:
    """Return the number of threads with the least median, one unless another is clearly faster.

    `seconds` of steps by number of threads, of 1 among them; empty where no core was idle.
    """
    if not seconds:
        return ThreadChoice(1, most, {})
    medians = {n: median(own) for n, own in seconds.items()}
    pays = [
        n
        for n, own in seconds.items()
        if medians[n] <= CLEARLY * medians[1] and min(own) <= CLEARLY * min(seconds[1])
    ]
    best = min(pays, key=lambda n: medians[n], default=1)
    return ThreadChoice(best, most, medians)


def candidates(most: int, idle: int) -> tuple[int, ...]:
    """1, 2, 4, ... up to what may be taken, and that itself; empty where it is one."""
    limit = min(most, idle)
    if limit < 2:
        return ()
    powers = {2**k for k in range(limit.bit_length())}
    return tuple(sorted({n for n in powers if n <= limit} | {limit}))


def idle_of(cores: int, running: float, load: float) -> int:
    """Cores for this process: `running` processes at this instant and the `load` of the last minute
    count this one, too."""
    others = max(running, load) - 1
    return max(1, cores - max(0, round(others)))


def cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def idle_cores() -> int:
    """By the system's own account; all where it gives none, which the pilot then finds out."""
    return idle_of(cores(), _running(), os.getloadavg()[0] if hasattr(os, "getloadavg") else 1.0)


def idle_now() -> int:
    """As `idle_cores`, at this instant: what ran in the last minute may have been ours."""
    return idle_of(cores(), _running(), 1.0)


def _running() -> float:
    """Median of what runs at some instants; 1 where the system does not say."""
    found = []
    for _ in range(_LOOKS):
        try:
            found.append(int(_LOADAVG.read_text("ascii").split()[3].partition("/")[0]))
        except (OSError, ValueError, IndexError):
            return 1.0
        sleep(_BETWEEN_S)
    return float(median(found))


def pilot(step: Callable[[int], object], most: int, idle: int) -> ThreadChoice:
    """Times `step(threads)`; numbers of threads take turns, so that a busy machine slows all."""
    numbers = candidates(most, idle)
    seconds: dict[int, list[float]] = {n: [] for n in numbers}
    for n in numbers:
        step(n)  # compiles
    start = perf_counter()
    while numbers and len(seconds[1]) < _ROUNDS:
        for n in numbers:
            begin = perf_counter()
            step(n)
            seconds[n].append(perf_counter() - begin)
        if perf_counter() - start > _PILOT_S and len(seconds[1]) > 2:
            break
    return chosen(most, seconds)


@dataclass
class Team:
    """The threads of a run: those chosen, until their steps take longer than one thread's did."""

    choice: ThreadChoice
    threads: int = field(init=False)
    said: str = ""
    _recent: deque[float] = field(default_factory=lambda: deque(maxlen=_RECENT))

    def __post_init__(self) -> None:
        self.threads, self.said = self.choice.threads, self.choice.words

    def saw(self, seconds: float) -> None:
        """After a step: one thread from now on, if the last steps were slower than one thread's."""
        if self.threads == 1:
            return
        self._recent.append(seconds)
        now, alone = median(self._recent), self.choice.seconds[1]
        if len(self._recent) == _RECENT and now > alone:
            self.threads = 1
            self.said += (
                f"; then 1, as {self.choice.threads} took {1e6 * now:.3g} us, because the "
                "machine became busy"
            )
