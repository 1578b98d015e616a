"""How many updates of the pressure every law takes, and where the scalar law diverges.

Paper 000, section 3.3: "strains of order 0.3 % to 15 % solve to 1 % in a maximum of 1 update".
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Chart, Entry, Exhibit, NumberTable, Series
from validate.errors import SceneError
from validate.fem.system import Responses
from validate.fem.system import build as build_system
from validate.pipeline.experiment.experiment import Progress
from validate.pipeline.experiment.tree import Tree
from validate.scene.geometries.hollow_block import HollowBlock
from validate.solve.fluid.cavities import ExactPressure
from validate.solve.fluid.pressure_curve import tuned_gain
from validate.solve.fluid.pressure_loop import PressureLoop
from validate.solve.types import Scheme, State

from .block import ToolName, slab

TOLERANCES = (1e-2, 1e-3, 1e-12)
TOOLS: tuple[ToolName, ...] = ("needle", "patch", "plate")
_MOST = 500
_ONE = (
    PressureLoop(update="proportional", max_updates=_MOST),
    PressureLoop(update="retuned", max_updates=_MOST),
    PressureLoop(update="piecewise", max_updates=_MOST),
    PressureLoop(update="secant", max_updates=_MOST),
    PressureLoop(update="newton", max_updates=_MOST),
    PressureLoop(update="golden", max_updates=_MOST),
)
_OF_ONE_CAVITY = ("piecewise", "golden")
_SEPTA = (0.25, 0.5, 1.0, 2.0)  # of the septum as set


def pressed(p: Tree, tool: ToolName, finer: int = 1, **cavities: Any) -> Responses:
    """The block of linear triangles under a tool, on a mesh so many times as fine."""
    body: HollowBlock = p.scene.body
    made = replace(body.cavities, **cavities)
    scene = slab(p, tool, {"body.cells": finer * body.cells, "body.cavities": made})
    return Responses.of(build_system(scene))


def updates_exhibit(p: Tree, progress: Progress) -> tuple[Exhibit, dict[str, float]]:
    """Tables of updates by law and strain for each tool, a chart, and the printed claims."""
    tables: list[NumberTable] = []
    lines: list[Series] = []
    numbers: dict[str, float] = {}
    for tool in TOOLS:
        progress(f"updates under a {tool}")
        r = pressed(p, tool)
        cold = _cold(r, p)
        tables.append(_table(tool, p.settings.strains, cold))
        lines.append(Series(f"{tool}, the paper's law to 1 %", 100 * np.array(p.settings.strains),
                            _seen(cold["proportional", 1e-2]), "points"))  # fmt: skip
        numbers |= {f"{tool}.cold": max(_seen(cold["proportional", 1e-2]))}
        tables.append(_warm_table(tool, r, p))
        numbers |= {f"{tool}.warm": max(_seen(_warm(PressureLoop(tolerance=1e-3), r, p)))}
    chart = Chart(
        "updates", "Updates of the paper's law from a cold start", "strain / %", "updates / 1",
        tuple(lines), levels=(("the paper's claim", 1.0),),
    )  # fmt: skip
    words = (
        "Strain is taken as the tool's displacement over the block's height; the paper does "
        "not define it. A cold start begins at pressure zero, a warm start at the pressure of "
        "the last state.",
        "A needle is one node of the mesh: the volume it displaces shrinks with the mesh.",
        "exact: the root of the volume's polynomial, in Newton steps on one number; the "
        "others evaluate the full wall once per update.",
    )
    return Exhibit("updates", "Updates of the pressure", words, tuple(tables), (chart,)), numbers


def _laws(p: Tree) -> tuple[PressureLoop, ...]:
    several = p.scene.body.cavities.count > 1
    return tuple(law for law in _ONE if not (several and law.update in _OF_ONE_CAVITY))


def _cold(r: Responses, p: Tree) -> dict[tuple[str, float], list[State]]:
    """States by law and tolerance at every strain, each from rest."""
    found: dict[tuple[str, float], list[State]] = {}
    for law in _laws(p):
        for tolerance in TOLERANCES:
            loop = replace(law, tolerance=tolerance, warm_start=False)
            found[law.update, tolerance] = _states(loop, r, p)
    found["exact", 1e-12] = _states(ExactPressure(), r, p)
    return found


def _states(scheme: Scheme, r: Responses, p: Tree) -> list[State]:
    stepper = scheme.on(r)  # type: ignore[attr-defined]
    return [
        stepper.step(stepper.rest(), np.array([s * p.scene.body.height]))
        for s in p.settings.strains
    ]


def _seen(states: Sequence[State]) -> Floats:
    return np.array([float(s.updates) for s in states])


def _table(
    tool: str, strains: Sequence[float], cold: dict[tuple[str, float], list[State]]
) -> NumberTable:
    rows: list[tuple[Entry, ...]] = []
    for (name, tolerance), states in cold.items():
        ends = sorted({s.failure[0] for s in states if s.failure})
        rows.append((name, f"{tolerance:g}", *(None if s.failure else s.updates for s in states),
                     ", ".join(ends) or "all settled"))  # fmt: skip
    heads = ("law", "tolerance of V/V0", *(f"{100 * s:g} %" for s in strains), "outcome")
    return NumberTable(f"updates_{tool}", f"Updates from a cold start under a {tool}.", heads,
                       tuple(rows))  # fmt: skip


def _warm(scheme: Scheme, r: Responses, p: Tree) -> list[State]:
    """States along the strains, each begun at the last one's pressure, until one fails."""
    stepper = scheme.on(r)  # type: ignore[attr-defined]
    found = [stepper.rest()]
    for s in p.settings.strains:
        found.append(stepper.step(found[-1], np.array([s * p.scene.body.height])))
        if found[-1].failure:
            break
    return found[1:]


def _warm_table(tool: str, r: Responses, p: Tree) -> NumberTable:
    loops: list[tuple[str, float, Scheme]] = [
        (law.update, tolerance, replace(law, tolerance=tolerance))
        for law in _laws(p)
        for tolerance in TOLERANCES
    ]
    rows: list[tuple[Entry, ...]] = []
    for name, tolerance, scheme in (*loops, ("exact", 1e-12, ExactPressure())):
        states = _warm(scheme, r, p)
        counts: list[Entry] = [None if s.failure else s.updates for s in states]
        counts += [None] * (len(p.settings.strains) - len(counts))
        ends = "all settled" if states[-1].failure is None else states[-1].failure[0]
        rows.append((name, f"{tolerance:g}", *counts, ends))
    heads = ("law", "tolerance of V/V0", *(f"{100 * s:g} %" for s in p.settings.strains), "outcome")
    return NumberTable(f"updates_warm_{tool}", f"Under a {tool}, each begun at the last pressure.",
                       heads, tuple(rows), folded=True)  # fmt: skip


# --- several cavities -----------------------------------------------------------------------------


def several_exhibit(p: Tree, progress: Progress) -> tuple[Exhibit, dict[str, float]]:
    """One to three cavities and thinner septa: scalar gains, one common, the matrix."""
    progress("several cavities")
    rows: list[tuple[Entry, ...]] = []
    numbers = {}
    alone = tuned_gain(pressed(p, "plate", 2, count=1))
    loops = {g: PressureLoop(gains=g, max_updates=_MOST) for g in ("own", "common", "matrix")}
    loops["one cavity's"] = PressureLoop(gain=alone, max_updates=_MOST)
    septum = p.scene.body.cavities.septum
    for count in (1, 2, 3):
        for share in _SEPTA if count > 1 else (1.0,):
            try:
                r = pressed(p, "plate", 2, count=count, septum=share * septum)
            except SceneError as refused:
                rows.append((count, 1e3 * share * septum, "-", None, None, str(refused)))
                continue
            for gains, loop in loops.items():
                row, radius = _row(r, p, gains, loop)
                rows.append((count, 1e3 * share * septum, *row))
                numbers[f"{count}.{share:g}.{gains}"] = radius
    table = NumberTable(
        "several", "The plate at the largest strain, to 1 % from a cold start.",
        ("cavities", "septum / mm", "gains", "spectral radius / 1", "updates", "outcome"),
        tuple(rows),
        "Spectral radius of I - (dV/dP / V0) G at the solution: above 1 the law diverges.",
    )  # fmt: skip
    words = (
        "A pressure in one cavity expands the others through a thin wall. Scalar gains ignore "
        "this; the matrix of the rest shape includes it.",
        "Gains tuned on each cavity with its neighbours converge more slowly as the septum "
        "becomes thinner, but do not diverge: they are Jacobi's iteration on a positive "
        "matrix. The gain of a single cavity in the block ignores thin walls and diverges "
        "there.",
    )
    return Exhibit("several", "Several cavities", words, (table,)), numbers


def _row(r: Responses, p: Tree, gains: str, loop: PressureLoop) -> tuple[tuple[Entry, ...], float]:
    drive = np.array([p.settings.strains[-1] * p.scene.body.height])
    exact = ExactPressure().on(r)
    solved = exact.step(exact.rest(), drive)
    z = np.concatenate([[1.0], solved.inner.z])
    radius = loop.spectral_radius(r, z)
    stepper = loop.on(r)
    state = stepper.step(stepper.rest(), drive)
    ends = "settled" if state.failure is None else f"{state.failure[0]}: {state.failure[1]}"
    return (gains, radius, None if state.failure else state.updates, ends), radius
