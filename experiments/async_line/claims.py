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
from validate.papers.async_regions.bodies import chirp, growing
from validate.papers.async_regions.runs import peak, pushed
from validate.replay.tree import Tree
from validate.solve.regions import AsyncRegions

from .line import bar, whole_of

STIFF, HZ, DEEP = 25e3, 0.3, 0.05  # Pa, Hz, m: Table 2
HALF = 1.0  # s around the middle in which the paper's "approximately 20th second" is read


def claims(tree: Tree, errors: Mapping[str, float]) -> dict[str, float]:
    """Numbers by name; `errors` are Table 1's, in %."""
    whole = whole_of(tree)
    top, far = _stiffer(tree, whole)
    return {
        "stiff.whole": top,
        "stiff.error": far,
        "stiff.over.soft": far / errors["error.n5_f5"],
        "size.over.rate": errors["error.n5_f500"] / errors["error.n30_f50"],
        "error.by.size": _by_size(tree, whole),
        "eq4": _step_by_eq_4(tree),
    }


def _stiffer(tree: Tree, whole: AsyncRegions) -> tuple[float, float]:
    """Peak N of the whole solve near the middle of the chirp, and the error of (5, 5) in %, both of
    the stiff bar (figure 7b and d)."""
    p = tree.settings
    t: Floats = p.dt * np.arange(1, round(p.probe.seconds / p.dt) + 1, dtype=np.float64)
    middle = p.probe.seconds / 2
    seen = t <= middle + HALF
    depth = chirp(t, p.probe.depth, p.probe.lowest, p.probe.highest)[seen]
    scene = bar(tree, {"material.E": STIFF})
    far = replace(whole, layers=(5,), rates=(5.0,))
    one, other = (peak(pushed(scene, s, depth).force, t[seen], middle, HALF) for s in (whole, far))
    return one, 100 * (other / one - 1)


def _by_size(tree: Tree, whole: AsyncRegions) -> float:
    """Relative error of a fixed region's peak under a push, over that under half of it."""
    dt = tree.settings.dt
    t: Floats = dt * np.arange(1, round(1 / HZ / dt) + 1, dtype=np.float64)
    scene = bar(tree, {"material.E": STIFF})
    fixed = replace(whole, layers=(10,), rates=(50.0,))
    off = []
    for depth in (0.5 * DEEP, DEEP):
        one, other = (
            float(pushed(scene, s, growing(t, depth, HZ)).force.max()) for s in (whole, fixed)
        )
        off.append(other / one - 1)
    return off[1] / off[0]


def _step_by_eq_4(tree: Tree) -> float:
    """l sqrt(rho/E) over the exact critical step of the bar with lumped masses."""
    body, material = tree.scene.body, tree.scene.material
    system = build(bar(tree))
    K = system.K[system.free][:, system.free]
    exact = lanczos_step(lambda x: K @ x, system.masses[system.free], products=60).limit
    edge: float = body.size[0] / body.cells[0]
    return edge * float(np.sqrt((material.rho or 0.0) / material.E)) / exact
