"""Tables and figures of `async_line`: Tables 1 and 2 of paper 004, impedance, energy, stability.

Sentences of the paper become numbers, too: figure 7 with the bar of 25 kPa beside that of 5 kPa,
equation 4, and a force error that grows with the deformation, which in a linear model the relative
error cannot.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, cast

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Entry, Exhibit, Heat, NumberTable
from validate.fem.critical import CriticalStep
from validate.fem.system import build
from validate.pipeline.experiment.experiment import Progress, ReportAdditions
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.method_run import Cases, MethodRun
from validate.solve.regions.scheme import AsyncRegions

from .methods import LINE
from .probe import chirp, growing, pad_of
from .runs import off, peak, pushed
from .tables import ENERGY, FORCE, energy_table, force_table
from .twin import bar, impedance, sets, whole_of, with_cells

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
    exact = CriticalStep.by_lanczos(lambda x: K @ x, system.masses[system.free], products=60).limit
    edge: float = body.size[0] / body.cells[0]
    return edge * float(np.sqrt((material.rho or 0.0) / material.E)) / exact


_SHORT, _NEAR = 10, 3  # free nodes and primary layers of the bar whose stability is mapped
_RATIOS = (1, 2, 5, 10, 20, 50, 100, 200)


def tell(parameters: Any, cases: Cases, progress: Progress) -> ReportAdditions:
    """Both tables, the oracle beside, energies of borders, and growth over the step ratio."""
    tree, main = cast(Tree, parameters), cases[""]
    middle = tree.settings.probe.seconds / 2
    title = f"Table 1: peak force within {HALF:g} s of {middle:g} s, against the whole solve."
    first, numbers = force_table("table_1", title, main, middle, HALF)
    progress("growing push")
    second, more = _table_2(tree)
    progress("the paper's sentences")
    sentences = claims(tree, numbers)
    progress("energy of borders")
    energy = _energies(tree, main)
    progress("stability")
    maps = _stability(tree)
    words = (
        "Row labels of Table 1 are lost in the text; they follow from its sentences.",
        "A peak hides the phase and a mean hides slow ticks, so the tables also give rms and "
        "the worst tick.",
        "Every variant has the exact static limit. Borders damp like a dashpot: stiffness of "
        "the slow region times its period.",
    )
    tables = Exhibit("tables", "Tables 1 and 2", words, (first, second))
    bounds = Exhibit(
        "borders",
        "Effects of borders",
        (*_BORDERS, *spring_words(tree)),
        (_impedances(tree, main), energy),
        heats=(maps,),
    )
    return ReportAdditions((tables, bounds), {**numbers, **more, **sentences})


_BORDERS = (
    ENERGY,
    "Growth is the spectral radius over a common period, per tick, with the probe held: above "
    "1 a motion grows without bound.",
)


def spring_words(tree: Tree) -> tuple[str, ...]:
    """A warning where the probe's spring is too stiff for the whole solve: it oscillates."""
    p = tree.settings
    grows = whole_of(tree).prepare(build(bar(tree))).growth()
    if grows <= 1:
        return ()
    return (
        f"Warning: the spring of {p.probe.spring:g} N/m is too stiff for ticks of {p.dt:g} s: with "
        f"the probe held the whole solve grows by {grows:.4g} a tick, the force oscillates; take a "
        "softer spring or shorter ticks.",
    )


def _table_2(tree: Tree) -> tuple[NumberTable, dict[str, float]]:
    """A growing push on the stiff bar: whole, fixed and adaptable primary region."""
    dt = tree.settings.dt
    t: Floats = dt * np.arange(1, round(9.25 / HZ / dt) + 1, dtype=np.float64)  # to its tenth peak
    depth, scene, whole = growing(t, DEEP, HZ), bar(tree, {"material.E": STIFF}), whole_of(tree)
    fixed = replace(whole, layers=(10,), rates=(50.0,))
    kinds = {"whole": whole, "fixed": fixed, "adaptable": replace(fixed, adapt="linear", most=30)}
    reference = pushed(scene, whole, depth).force
    rows: list[tuple[Entry, ...]] = []
    numbers: dict[str, float] = {}
    for name, settings in kinds.items():
        found = pushed(scene, settings, depth, account=True)
        top = float(found.force.max())
        error = 100 * (top / float(reference.max()) - 1)
        rms = 100 * off(found.force, reference)
        rows.append((name, top, error, rms, float(found.layers.max()), found.made))
        numbers |= {f"growing.{name}": top, f"growing.error.{name}": error}
    heads = ("primary region", "peak / N", "error / %", "rms / %", "layers at most / 1",
             "energy made / J")  # fmt: skip
    title = f"Table 2: a push that grows to {100 * DEEP:g} cm at {HZ:g} Hz, {STIFF / 1e3:g} kPa."
    return NumberTable("table_2", title, heads, tuple(rows)), numbers


def _impedances(tree: Tree, main: Mapping[str, MethodRun]) -> NumberTable:
    """Peak force by frequency of the chirp, against the continuous bar's impedance."""
    p = tree.settings
    rise = (p.probe.highest - p.probe.lowest) / p.probe.seconds
    hz = p.probe.lowest + (p.probe.highest - p.probe.lowest) * np.array([0.3, 0.5, 0.7, 0.9])
    exact = p.probe.depth * impedance(bar(tree), p.probe.spring, hz)
    rows: list[tuple[Entry, ...]] = [("continuous bar, steady", *exact.tolist())]
    for f in main.values():
        if f.run.finished:
            at = [(x - p.probe.lowest) / rise for x in hz]
            tops = [
                peak(f.run.traces[FORCE].y, f.run.t, a, 1 / x) for a, x in zip(at, hz, strict=True)
            ]
            rows.append((f.label, *tops))
    heads = ("method", *(f"{x:.3g} Hz / N" for x in hz))
    return NumberTable("impedance", "Peak force where the chirp passes a frequency.", heads,
                       tuple(rows))  # fmt: skip


def _energies(tree: Tree, main: Mapping[str, MethodRun]) -> NumberTable:
    """The first tenth of the chirp's time, at its highest frequency."""
    p = tree.settings
    t: Floats = p.dt * np.arange(1, round(min(4.0, p.probe.seconds) / p.dt) + 1, dtype=np.float64)
    depth = p.probe.depth * np.sin(2 * np.pi * p.probe.highest * t)
    given = sets(tree, main["whole"].registered[0])
    rivals = {main[n].label: LINE[n].given(given) for n in main if n in LINE}
    return energy_table(f"Energy at {p.probe.highest:g} Hz.", bar(tree), rivals, depth)


def _stability(tree: Tree) -> Heat:
    """Growth a tick over the step ratio, by border and solvers."""
    dt, scene = tree.settings.dt, with_cells(tree, _SHORT)
    system = build(scene)
    base = replace(whole_of(tree), layers=(_NEAR,), rates=(50.0,), pad=pad_of(scene))
    near = replace(base, beyond_limit="run")
    kinds = {
        "interpolated": base,
        "held": replace(base, border="hold"),
        "joint": replace(base, border="joint"),
        "two layers of overlap": replace(base, overlap=2),
        "far static": replace(base, solvers=("semi_implicit", "static")),
        "near explicit": replace(near, solvers=("explicit", "semi_implicit")),
        "all explicit, held": replace(near, solvers=("explicit",), border="hold"),
        "all explicit, interpolated": replace(near, solvers=("explicit",)),
    }
    values = [
        [replace(s, rates=(1 / (dt * ratio),)).prepare(system).growth() for ratio in _RATIOS]
        for s in kinds.values()
    ]
    return Heat(
        "growth", f"Growth of a tick, bar of {_SHORT} nodes with {_NEAR} of them near",
        "period of the far region over a tick / 1", "borders and solvers",
        tuple(str(r) for r in _RATIOS), tuple(kinds), np.array(values), "growth a tick / 1", 1.0,
    )  # fmt: skip
