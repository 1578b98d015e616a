"""What `async_line` shows of paper 004: Tables 1 and 2, impedance, energy and stability."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, cast

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Entry, Exhibit, Heat, NumberTable
from validate.papers.async_regions.bodies import growing, pad_of
from validate.papers.async_regions.methods import LINE
from validate.papers.async_regions.runs import growth, off, peak, pushed
from validate.papers.async_regions.tables import ENERGY, FORCE, energy_table, force_table
from validate.replay.experiment import Progress, Told
from validate.replay.followed import Cases, Followed
from validate.replay.tree import Tree

from .claims import DEEP, HALF, HZ, STIFF, claims
from .continuous import impedance
from .line import bar, sets, whole_of, with_cells

_SHORT, _NEAR = 10, 3  # free nodes and primary layers of the bar whose stability is mapped
_RATIOS = (1, 2, 5, 10, 20, 50, 100, 200)


def tell(parameters: Any, cases: Cases, progress: Progress) -> Told:
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
    return Told((tables, bounds), {**numbers, **more, **sentences})


_BORDERS = (
    ENERGY,
    "Growth is the spectral radius over a common period, per tick, with the probe held: above "
    "1 a motion grows without bound.",
)


def spring_words(tree: Tree) -> tuple[str, ...]:
    """A warning where the probe's spring is too stiff for the whole solve: it oscillates."""
    p = tree.settings
    grows = growth(bar(tree), whole_of(tree))
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


def _impedances(tree: Tree, main: Mapping[str, Followed]) -> NumberTable:
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


def _energies(tree: Tree, main: Mapping[str, Followed]) -> NumberTable:
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
        [growth(scene, replace(s, rates=(1 / (dt * ratio),))) for ratio in _RATIOS]
        for s in kinds.values()
    ]
    return Heat(
        "growth", f"Growth of a tick, bar of {_SHORT} nodes with {_NEAR} of them near",
        "period of the far region over a tick / 1", "borders and solvers",
        tuple(str(r) for r in _RATIOS), tuple(kinds), np.array(values), "growth a tick / 1", 1.0,
    )  # fmt: skip
