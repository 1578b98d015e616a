"""What `async_line` shows of paper 004: Tables 1 and 2, impedance, energy and stability."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, cast

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Entry, Exhibit, Heat, NumberTable
from validate.papers.async_regions.bodies import bar, growing, impedance, pad_of
from validate.papers.async_regions.claims import DEEP, HALF, HZ, STIFF, claims
from validate.papers.async_regions.line import TouchedLine
from validate.papers.async_regions.methods import LINE
from validate.papers.async_regions.runs import growth, off, peak, pushed
from validate.papers.async_regions.tables import ENERGY, FORCE, energy_table, force_table
from validate.replay.experiment import Progress, Told
from validate.replay.followed import Cases, Followed
from validate.solve.regions import AsyncRegions

_SHORT, _NEAR = 10, 3  # free nodes and primary layers of the bar whose stability is mapped
_RATIOS = (1, 2, 5, 10, 20, 50, 100, 200)


def tell(parameters: Any, cases: Cases, progress: Progress) -> Told:
    """Both tables, the oracle beside, energies of borders, and growth over the step ratio."""
    p, main = cast(TouchedLine, parameters), cases[""]
    middle = p.probe.seconds / 2
    title = f"Table 1: peak force within {HALF:g} s of {middle:g} s, against the whole solve."
    first, numbers = force_table("table_1", title, main, middle, HALF)
    progress("growing push")
    second, more = _table_2(p)
    progress("the paper's sentences")
    sentences = claims(p, numbers)
    progress("energy of borders")
    energy = _energies(p, main)
    progress("stability")
    maps = _stability(p)
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
        (*_BORDERS, *spring_words(p)),
        (_impedances(p, main), energy),
        heats=(maps,),
    )
    return Told((tables, bounds), {**numbers, **more, **sentences})


_BORDERS = (
    ENERGY,
    "Growth is the spectral radius over a common period, per tick, with the probe held: above "
    "1 a motion grows without bound.",
)


def spring_words(p: TouchedLine) -> tuple[str, ...]:
    """A warning where the probe's spring is too stiff for the whole solve: it oscillates."""
    whole = AsyncRegions(p.dt, (), (), spring=p.probe.spring, pad=pad_of(p.body.cells))
    grows = growth(bar(p.body.E, p.body.cells, p.body.damping), whole)
    if grows <= 1:
        return ()
    return (
        f"Warning: the spring of {p.probe.spring:g} N/m is too stiff for ticks of {p.dt:g} s: with "
        f"the probe held the whole solve grows by {grows:.4g} a tick, the force oscillates; take a "
        "softer spring or shorter ticks.",
    )


def _table_2(p: TouchedLine) -> tuple[NumberTable, dict[str, float]]:
    """A growing push on the stiff bar: whole, fixed and adaptable primary region."""
    t: Floats = p.dt * np.arange(
        1, round(9.25 / HZ / p.dt) + 1, dtype=np.float64
    )  # ends on its tenth peak
    depth, scene = growing(t, DEEP, HZ), bar(STIFF, p.body.cells, p.body.damping)
    whole = AsyncRegions(p.dt, (), (), spring=p.probe.spring, pad=pad_of(p.body.cells))
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


def _impedances(p: TouchedLine, main: Mapping[str, Followed]) -> NumberTable:
    """Peak force by frequency of the chirp, against the continuous bar's impedance."""
    rise = (p.probe.highest - p.probe.lowest) / p.probe.seconds
    hz = p.probe.lowest + (p.probe.highest - p.probe.lowest) * np.array([0.3, 0.5, 0.7, 0.9])
    exact = p.probe.depth * impedance(p.body.E, p.probe.spring, hz)
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


def _energies(p: TouchedLine, main: Mapping[str, Followed]) -> NumberTable:
    """The first tenth of the chirp's time, at its highest frequency."""
    t: Floats = p.dt * np.arange(1, round(min(4.0, p.probe.seconds) / p.dt) + 1, dtype=np.float64)
    depth = p.probe.depth * np.sin(2 * np.pi * p.probe.highest * t)
    given = {"dt": p.dt, "spring": p.probe.spring, "pad": pad_of(p.body.cells)}
    rivals = {main[n].label: LINE[n].given(given) for n in main if n in LINE}
    scene = bar(p.body.E, p.body.cells, p.body.damping)
    return energy_table(f"Energy at {p.probe.highest:g} Hz.", scene, rivals, depth)


def _stability(p: TouchedLine) -> Heat:
    """Growth a tick over the step ratio, by border and solvers."""
    scene = bar(p.body.E, _SHORT, p.body.damping)
    base = AsyncRegions(p.dt, (_NEAR,), (50.0,), spring=p.probe.spring, pad=pad_of(_SHORT))
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
        [growth(scene, replace(s, rates=(1 / (p.dt * ratio),))) for ratio in _RATIOS]
        for s in kinds.values()
    ]
    return Heat(
        "growth", f"Growth of a tick, bar of {_SHORT} nodes with {_NEAR} of them near",
        "period of the far region over a tick / 1", "borders and solvers",
        tuple(str(r) for r in _RATIOS), tuple(kinds), np.array(values), "growth a tick / 1", 1.0,
    )  # fmt: skip
