"""Energy of a force that a device keeps from tick to tick, against the true one that changes.

A device keeps its force until the next tick while the hand moves on; even a true force sampled
at ticks gives a hand energy that way (Colgate & Schenkel 1997: a spring k held for T needs a
damper of k T/2). What is given beyond the true force's work is energy created; a passive device
never gives more than it has taken (Hannaford & Ryu 2002).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from validate.arrays import Floats, checked
from validate.errors import ComparisonError


@dataclass(frozen=True)
class HeldForce:
    """Of ticks dt s apart: places x (nt, d) m of the hand, force `given` (nt, d) N on it from each
    tick to the next, and the `true` one (nt, d) N at the ticks, linear in between."""

    x: Floats
    given: Floats
    true: Floats
    dt: float

    def __post_init__(self) -> None:
        shape = np.shape(self.x)
        for name in ("x", "given", "true"):
            checked(getattr(self, name), f"held force, {name}", shape, error=ComparisonError)
        if len(self.x) < 2:
            raise ComparisonError(f"{len(self.x)} ticks of a held force; at least 2 are needed")

    @cached_property
    def off(self) -> Floats:
        """Given less true, (nt,) N in size."""
        return np.asarray(np.linalg.norm(self.given - self.true, axis=1))

    @property
    def peak(self) -> float:
        return float(self.off.max())

    @property
    def rms(self) -> float:
        return float(np.sqrt(np.mean(self.off**2)))

    @cached_property
    def created(self) -> Floats:
        """(nt,) J given to the hand since the first tick beyond what the true force gave."""
        return self._work(self.given[:-1]) - self._work((self.true[:-1] + self.true[1:]) / 2)

    @cached_property
    def taken(self) -> Floats:
        """(nt,) J that the hand has put into the device since the first tick."""
        return -self._work(self.given[:-1])

    @property
    def least(self) -> float:
        """J, the least that the device had taken: below 0 it gave what it never had."""
        return float(self.taken.min()) + 0.0  # no minus before nothing

    @property
    def damper(self) -> float:
        """N s/m that would have eaten what was created over the whole way; 0 where none was."""
        eaten = float((np.diff(self.x, axis=0) ** 2).sum()) / self.dt
        return max(float(self.created[-1]), 0.0) / eaten if eaten else 0.0

    def _work(self, force: Floats) -> Floats:
        steps = (force * np.diff(self.x, axis=0)).sum(axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])
