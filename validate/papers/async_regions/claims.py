"""Sentences of paper 004 that are no tables, each turned into a number of ours.

Its figure 7: the bar of 25 kPa beside that of 5 kPa; its eq 4; and that the force error grows with
the deformation, which in a linear model the relative one cannot.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from validate.arrays import Floats
from validate.fem.critical import lanczos_step
from validate.fem.system import build
from validate.papers.async_regions.bodies import DENSITY, LENGTH, bar, chirp, growing, pad_of
from validate.papers.async_regions.line import TouchedLine
from validate.papers.async_regions.runs import peak, pushed
from validate.solve.regions import AsyncRegions

STIFF, HZ, DEEP = 25e3, 0.3, 0.05  # Pa, Hz, m: Table 2
HALF = 1.0  # s around the middle in which the paper's "approximately 20th second" is read


def claims(p: TouchedLine, errors: Mapping[str, float]) -> dict[str, float]:
    """Numbers by name; `errors` are Table 1's, in %."""
    whole = AsyncRegions(p.dt, (), (), spring=p.probe.spring, pad=pad_of(p.body.cells))
    top, far = _stiffer(p, whole)
    return {
        "stiff.whole": top,
        "stiff.error": far,
        "stiff.over.soft": far / errors["error.n5_f5"],
        "size.over.rate": errors["error.n5_f500"] / errors["error.n30_f50"],
        "error.by.size": _by_size(p, whole),
        "eq4": _step_by_eq_4(p),
    }


def _stiffer(p: TouchedLine, whole: AsyncRegions) -> tuple[float, float]:
    """Peak N of the whole solve near the middle of the chirp, and the error of (5, 5) in %, both of
    the stiff bar (figure 7b and d)."""
    t: Floats = p.dt * np.arange(1, round(p.probe.seconds / p.dt) + 1, dtype=np.float64)
    middle = p.probe.seconds / 2
    seen = t <= middle + HALF
    depth = chirp(t, p.probe.depth, p.probe.lowest, p.probe.highest)[seen]
    scene = bar(STIFF, p.body.cells, p.body.damping)
    far = replace(whole, layers=(5,), rates=(5.0,))
    one, other = (peak(pushed(scene, s, depth).force, t[seen], middle, HALF) for s in (whole, far))
    return one, 100 * (other / one - 1)


def _by_size(p: TouchedLine, whole: AsyncRegions) -> float:
    """Relative error of a fixed region's peak under a push, over that under half of it."""
    t: Floats = p.dt * np.arange(1, round(1 / HZ / p.dt) + 1, dtype=np.float64)
    scene = bar(STIFF, p.body.cells, p.body.damping)
    fixed = replace(whole, layers=(10,), rates=(50.0,))
    off = []
    for depth in (0.5 * DEEP, DEEP):
        one, other = (
            float(pushed(scene, s, growing(t, depth, HZ)).force.max()) for s in (whole, fixed)
        )
        off.append(other / one - 1)
    return off[1] / off[0]


def _step_by_eq_4(p: TouchedLine) -> float:
    """l sqrt(rho/E) over the exact critical step of the bar with lumped masses."""
    system = build(bar(p.body.E, p.body.cells, p.body.damping))
    K = system.K[system.free][:, system.free]
    exact = lanczos_step(lambda x: K @ x, system.masses[system.free], products=60).limit
    return LENGTH / p.body.cells * float(np.sqrt(DENSITY / p.body.E)) / exact
