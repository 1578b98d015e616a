"""What `bending_rod` shows of paper 002, figures 9 and 10, and on which mesh its 4.2 s hold."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, cast

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Chart, Entry, Exhibit, NumberTable, Series
from validate.compare.shapes.two_fields import FieldScores
from validate.fem.system import System
from validate.fem.system import build as build_system
from validate.pipeline.experiment.experiment import Progress, ReportAdditions
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.method_run import Cases
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.scene import Scene
from validate.solve.march import march

from ..needle_block.benchmark import FIVE, IMPLICIT
from ..needle_block.errors import (
    LIMIT_HEADS,
    RIVALS,
    TABLED,
    Errors,
    at_instants,
    errors_exhibit,
    errors_on,
    instants_table,
    limit_row,
    mesh_words,
    ordered_share,
    read_off,
    shape_maps,
    static_exhibit,
    sum_ratio,
    switches_exhibit,
)
from ..needle_block.further_exhibits import PaperBody, beyond
from ..needle_block.penalty import NEARLY, Squeezed
from ..needle_block.sensitivity import (
    TurnedBench,
    material_turns,
    mesh_turn,
    moved_nodes,
)
from .body import GRAVITY, MP3, SIZE, bending_rod, gravity_inputs

_FIGURES = {
    "E_n": "The paper draws E_i only; E_n is added here.",
    "E_s": "Exact volumes of the symmetric difference of the bodies.",
    "E_i": "As figures 9 and 10: quasi-static dips where the rod swings through its steady state.",
    "E_i_linear": "As figure 9, linear.",
}
_LONG = 900  # steps: 30 s
_MESHES = (1, 2, 3, 4, 6)  # cells across
_SEEN = 180  # steps: 6 s, beyond the first crossing on every mesh
_MOVING = 4.0  # s: until here the rod falls


def tell(parameters: Any, cases: Cases, progress: Progress) -> ReportAdditions:
    """All exhibits of the rod, and the numbers of its printed figures."""
    p, main = cast(Tree, parameters), cases[""]
    progress("errors over time")
    errors = errors_on(main, TABLED, RIVALS)
    shown = errors_exhibit(errors, 3, _FIGURES, _words(errors))
    switches, ratio = switches_exhibit(main, 3)
    progress("static solution")
    t: Floats = p.settings.clock.dt * np.arange(1, _LONG + 1, dtype=np.float64)
    system = build_system(main["implicit"].body)
    still, end = static_exhibit(system, FIVE, p.settings.clock.dt, _LONG, gravity_inputs(t))
    progress("first crossing by mesh")
    dip, crossings = _dips()
    progress("meshes")
    frames = at_instants(cases["finer_mesh"]["implicit"].run)
    finer = errors_on(cases["finer_mesh"], ("E_n", "E_i"), ("implicit", *RIVALS), frames)
    more, found = beyond(_FURTHER, progress)
    quasi = errors["quasi_static"]
    numbers = {
        "ordered": ordered_share(errors, until=_MOVING),
        "ordered.all": ordered_share(errors),
        "sum": sum_ratio(errors)[0],
        "explicit.over.lumped": sum_ratio(errors)[1],
        "restriction.over.lumping": ratio,
        "static.end": end,
        **read_off(errors),
        "quasi.dip": _dip_of(quasi),
        **crossings,
        **found,
    }
    shapes = Exhibit(
        "shapes", "Deformed shapes", maps=tuple(shape_maps(main, ("implicit", "quasi_static"), 1.0))
    )
    mesh = _mesh_error(finer, mesh_words(finer, errors))
    return ReportAdditions((shown, shapes, switches, still, dip, _limits(p), mesh, *more), numbers)


def _words(errors: Mapping[str, Errors]) -> tuple[str, ...]:
    ratio, part = sum_ratio(errors)
    return (
        "The paper's order in E_i (explicit, then the lumped methods, then quasi-static) "
        f"holds at {100 * ordered_share(errors, until=_MOVING):.0f} % of the compared times "
        f"after the first step and up to {_MOVING:g} s, {100 * ordered_share(errors):.0f} % of "
        "all: the quasi-static solver is at rest and is accurate whenever the rod swings "
        "through rest.",
        f"Explicit with lumped masses has {ratio:.2f} times the sum of the two errors it "
        f"combines (median); but the explicit part is {part:.2g} of the lumped one, so this "
        "shows little.",
    )


def _dip_of(quasi: Errors) -> float:
    """Time s at which quasi-static's E_i first has a minimum: the rod passes its steady state."""
    y = quasi.values["E_i"]
    low = np.flatnonzero((y[1:-1] < y[:-2]) & (y[1:-1] < y[2:]))
    return float(quasi.t[1 + low[0]]) if len(low) else 0.0


def _dips() -> tuple[Exhibit, dict[str, float]]:
    """First crossing of the static tip by mesh, and the tips of beam theory beside."""
    t: Floats = IMPLICIT.dt * np.arange(1, _SEEN + 1, dtype=np.float64)
    rows: list[tuple[Entry, ...]] = []
    lines, numbers = [], {}
    for n in _MESHES:
        system = build_system(bending_rod(n))
        tip, static = _tips(system, t)
        crossing = first_crossing(t, tip, static)
        rows.append((n, len(system.scene.mesh.cells), -1e3 * static, crossing))
        lines.append(Series(f"{2 * n} x {n} x {n}", t, 1e3 * (tip - static)))
        numbers[f"crossing.{n}"] = crossing or 0.0
        numbers[f"static.{n}"] = -static
    rows.append(("Euler-Bernoulli", None, 1e3 * beam(shear=False), None))
    rows.append(("Timoshenko", None, 1e3 * beam(shear=True), None))
    table = NumberTable(
        "crossing", "First time at which the tip passes below its static position, implicit run.",
        ("cells across", "cells", "static tip / mm", "first crossing / s"), tuple(rows),
        "The tip is the middle of the end face. Beam theory gives only the static tip, not the "
        "crossing.",
    )  # fmt: skip
    chart = Chart(
        "crossing", "Tip above its static position", "time / s", "u_z − static / mm",
        tuple(lines), levels=(("static", 0.0),),
        caption="The crossing depends on the mesh; the paper's 4.2 s is that of a coarse mesh.",
    )  # fmt: skip
    words = (
        "The rod is heavily damped (0.70 of critical): the first crossing is a test quantity, "
        "a period is not.",
    )
    return Exhibit("crossing", "First crossing of the static position", words, (table,),
                   (chart,)), numbers  # fmt: skip


def _tips(system: System, t: Floats) -> tuple[Floats, float]:
    inputs = gravity_inputs(t)
    tip = march("implicit", IMPLICIT.prepare(system), t, inputs, np.array([0]), 0.0)
    rest = FIVE["quasi_static"].settings.prepare(system)
    still = march("static", rest, t[:1], inputs[:1], np.array([0]), 0.0)
    return tip.traces["tip.z"].y, float(still.traces["tip.z"].y[0])


def first_crossing(t: Floats, tip: Floats, static: float) -> float | None:
    """Time s at which the tip (nt,) m first falls below `static` m, between steps; None: never."""
    below = tip < static
    if not below.any():
        return None
    k = int(np.argmax(below))
    return float(t[k - 1] + (t[k] - t[k - 1]) * (static - tip[k - 1]) / (tip[k] - tip[k - 1]))


def beam(*, shear: bool) -> float:
    """Tip m of a cantilever under its weight; the shear coefficient is Cowper's for a square."""
    assert MP3.rho is not None
    length, b, h = SIZE
    q, inertia = MP3.rho * GRAVITY * b * h, b * h**3 / 12
    bending = q * length**4 / (8 * MP3.E * inertia)
    kappa = 10 * (1 + MP3.nu) / (12 + 11 * MP3.nu)
    return bending + (q * length**2 / (2 * kappa * MP3.shear_modulus * b * h) if shear else 0.0)


def _limits(p: Tree) -> Exhibit:
    rows = [
        limit_row(f"n = {n}", build_system(bending_rod(n)), p.settings.clock.dt)
        for n in _MESHES[:-1]
    ]
    table = NumberTable(
        "limits", "Critical steps of the explicit schemes with full C, exact.", LIMIT_HEADS,
        tuple(rows),
    )  # fmt: skip
    words = ("The paper's step of 33.3 ms is stable as printed up to n = 3 across, not for n = 4.",)
    return Exhibit("limits", "Critical steps", words, (table,))


def _mesh_error(finer: Mapping[str, Errors], said: str) -> Exhibit:
    table = instants_table(
        "mesh_error", "Against the implicit run on a mesh twice as fine.", finer,
        ("E_n", "E_i"), FieldScores.units(3),
    )  # fmt: skip
    return Exhibit("mesh-error", "Errors of the mesh", (said,), (table,))


def _squeezed_rod() -> Squeezed:
    """Under its weight."""
    unlocked = replace(bending_rod(3, replace(MP3, nu=NEARLY)), dilatation="mixed")

    def make(n: int, material: Material) -> Scene:
        return bending_rod(n, material, box)

    return Squeezed(make, MP3, 3, 4, ("mixed hexahedra", unlocked))


def _turned_rod() -> TurnedBench:
    base = bending_rod(3)
    turns = (
        *material_turns(base, 0.1),
        mesh_turn("cells, along all edges", base, (6, 3, 3), (4, 2, 2)),
        mesh_turn("cells, along the rod alone", base, (6, 3, 3), (5, 3, 3)),
    )
    beside = {"inner nodes moved by up to a fifth of a cell": moved_nodes(base)}
    return TurnedBench(base, gravity_inputs, turns, beside)


_FURTHER = PaperBody(lambda: bending_rod(3), gravity_inputs, _squeezed_rod, _turned_rod)
