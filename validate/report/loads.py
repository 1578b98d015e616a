"""The simulation between its loads: a run keeps displacements at its output frames only.

Where these are the holds, u is interpolated between them; a run over time keeps enough of them.
Between two holds u is interpolated linearly in the stage's displacement. That is exact for a model
that is linear in its inputs when these are proportional to the stage, and an approximation else;
whoever shows it says so.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from validate.arrays import Floats
from validate.register.observe import Hold, Registered
from validate.solve.types import Run

HOW = "between the loads interpolated linearly in stage displacement"


@dataclass(frozen=True)
class Instant:
    """Displacements u (n, d) m at time t s and stage (m or N); `hold` None: none of the loads.

    `computed` is False where it was interpolated.
    """

    t: float
    stage: float
    u: Floats
    hold: Hold | None
    computed: bool = True


def at_holds(registered: Registered, run: Run) -> bool:
    """The run's output frames are the holds: frame i belongs to hold i. Else they follow time."""
    if not registered.holds:
        return False
    steps = np.sort(registered.steps_at_holds())[: len(run.at)]
    return bool(np.array_equal(np.sort(run.at), steps))


def held(registered: Registered, run: Run) -> tuple[Instant, ...]:
    """The instants that the run computed, in order of time."""
    if not at_holds(registered, run):
        times = run.t[run.at]
        stage = np.interp(times, registered.stage.t, registered.stage.y[:, 0])
        rows = zip(times.tolist(), stage.tolist(), run.u, strict=True)
        return tuple(Instant(t, q, u, None) for t, q, u in rows)
    pairs = zip(registered.holds, run.u, strict=False)  # a run that ended early has fewer
    return tuple(sorted((Instant(h.t, h.stage, u, h) for h, u in pairs), key=lambda i: i.t))


def at_times(registered: Registered, run: Run, times: Floats) -> tuple[Instant, ...]:
    """Instants at the holds and at those of `times` (k,) s that lie between them, in order.

    Of a run over time the frames nearest to `times`, none interpolated.
    """
    known = held(registered, run)
    if known and not at_holds(registered, run):
        at = np.array([i.t for i in known])
        return tuple(known[i] for i in np.unique([np.abs(at - t).argmin() for t in times]))
    found = list(known)
    for a, b in pairwise(known):
        inside = times[(times > a.t) & (times < b.t)]
        stage = np.interp(inside, registered.stage.t, registered.stage.y[:, 0])
        found += [_between(a, b, *pair) for pair in zip(inside.tolist(), stage, strict=True)]
    return tuple(sorted(found, key=lambda i: i.t))


def in_steps(registered: Registered, run: Run, steps: int) -> tuple[Instant, ...]:
    """Instants at the holds and at `steps` - 1 equal steps of the stage between neighbours."""
    known = held(registered, run)
    found = list(known[:1])
    for a, b in pairwise(known):
        shares = np.arange(1, steps) / steps
        found += [_mixed(a, b, float(w), a.t + float(w) * (b.t - a.t)) for w in shares]
        found.append(b)
    return tuple(found)


def _between(a: Instant, b: Instant, t: float, stage: float) -> Instant:
    way = b.stage - a.stage
    share = (stage - a.stage) / way if way else 0.0
    return _mixed(a, b, float(np.clip(share, 0.0, 1.0)), t)


def _mixed(a: Instant, b: Instant, share: float, t: float) -> Instant:
    stage = a.stage + share * (b.stage - a.stage)
    return Instant(t, stage, a.u + share * (b.u - a.u), None, computed=False)
