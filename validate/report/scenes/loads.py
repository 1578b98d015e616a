"""Displacements between output frames: interpolation of a run at its load steps.

Where these are the loads, u is interpolated between them; a run over time keeps enough of them.
Between two loads u is interpolated linearly in the drive. That is exact for a model that is linear
in its inputs when these are proportional to the drive, and an approximation else; whoever shows it
says so.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from validate.arrays import Floats
from validate.register.registration import Registered
from validate.report.sections.observations import Held, drive, driven, holds
from validate.solve.types import Run

HOW = "between the loads interpolated linearly in the drive"


@dataclass(frozen=True)
class Instant:
    """Displacements u (n, d) m at time t s and drive in SI `unit`; `hold` None: none of the loads.

    `computed` is False where it was interpolated.
    """

    t: float
    drive: float
    unit: str
    u: Floats
    hold: Held | None
    computed: bool = True


def held(registered: Registered, run: Run) -> tuple[Instant, ...]:
    """Return the instants that the run computed, in order of time."""
    if not holds(registered):
        times = run.t[run.at]
        rows = zip(times.tolist(), driven(registered, times).tolist(), run.u, strict=True)
        return tuple(Instant(t, q, drive(registered).unit, u, None) for t, q, u in rows)
    pairs = zip(holds(registered), run.u, strict=False)  # a run that ended early has fewer
    return tuple(Instant(h.t, h.drive, h.unit, u, h) for h, u in pairs)


def at_times(registered: Registered, run: Run, times: Floats) -> tuple[Instant, ...]:
    """Instants at the loads and at those of `times` (k,) s that lie between them, in order.

    Of a run over time the frames nearest to `times`, none interpolated.
    """
    known = held(registered, run)
    if known and not holds(registered):
        at = np.array([i.t for i in known])
        return tuple(known[i] for i in np.unique([np.abs(at - t).argmin() for t in times]))
    found = list(known)
    for a, b in pairwise(known):
        inside = times[(times > a.t) & (times < b.t)]
        pairs = zip(inside.tolist(), driven(registered, inside).tolist(), strict=True)
        found += [_between(a, b, *pair) for pair in pairs]
    return tuple(sorted(found, key=lambda i: i.t))


def _between(a: Instant, b: Instant, t: float, q: float) -> Instant:
    way = b.drive - a.drive
    share = (q - a.drive) / way if way else 0.0
    return _mixed(a, b, float(np.clip(share, 0.0, 1.0)), t)


def _mixed(a: Instant, b: Instant, share: float, t: float) -> Instant:
    q = a.drive + share * (b.drive - a.drive)
    return Instant(t, q, a.unit, a.u + share * (b.u - a.u), None, computed=False)
