"""How long the runs of a road will still take, from those that were made.

A guess that is shown as one: a run costs what another run of its method did, times its steps, times
its cells to a power between that of assembly (1) and that of a factorisation in space (2).
"""

from collections.abc import Hashable
from time import perf_counter

_POWER = 1.3  # of the number of cells, between assembly and factorisation


class Pace:
    """Runs that are expected, each with its method and its cost beside that method's plain one.

    `since` is when the whole work began, s of `perf_counter`.
    """

    def __init__(self, since: float) -> None:
        self._left: dict[Hashable, tuple[str, float]] = {}
        self._costs: dict[str, float] = {}  # s, of a plain run
        self._since = since

    def expect(self, key: Hashable, method: str, cells: float = 1.0, steps: float = 1.0) -> None:
        """`cells` and `steps` are how many times those of the method's plain run."""
        self._left[key] = method, cells**_POWER * steps

    def took(self, key: Hashable, seconds: float) -> None:
        """One of the runs was made; one that nobody expected teaches nothing."""
        if key in self._left:
            method, cost = self._left.pop(key)
            self._costs.setdefault(method, seconds / cost)

    @property
    def progress(self) -> tuple[int, int]:
        """Milliseconds gone and those of all; 0 of 1 while nothing is known."""
        gone = perf_counter() - self._since
        if not self._costs:
            return 0, 1
        usual = sum(self._costs.values()) / len(self._costs)
        left = sum(cost * self._costs.get(m, usual) for m, cost in self._left.values())
        return round(1e3 * gone), round(1e3 * (gone + left))
