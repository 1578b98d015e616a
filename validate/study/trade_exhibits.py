"""What a trade shows: front, what each error is made of, set-up, memory, convergence, failures."""

from collections.abc import Iterable, Sequence

import numpy as np

from validate.compare.exhibit import Chart, Entry, Exhibit, NumberTable, Series
from validate.replay.ladder import SHOWN
from validate.study.held import DEFINITION
from validate.study.ranking import SAME_TIME
from validate.study.trade import ERRORS, ParetoFront, Refinement, Trade, TradeRow
from validate.study.trade_regions import regions_exhibit

_MM, _US, _MB = 1e3, 1e6, 1e-6
_NAMES = {"error": "error", "total": "error including the law"}
_EVEN = 2.0  # of two shares neither dominates within this ratio
_CASE = ("solver", "element", "mesh", "step / ms")
_TIMES = (
    "All cells ran one after another in one process, with linear algebra on one thread; "
    "parallel cells would compete for memory. A time is the median of a step plus that of "
    "forming the displacements of all nodes. Step times are noisy on a busy machine: times "
    f"within {SAME_TIME:g} times count as equal."
)


def trade_exhibits(trade: Trade) -> tuple[Exhibit, ...]:
    """In the order of a reader's questions."""
    found = [_front_exhibit(trade), _shares(trade), _costs(trade), _convergence(trade)]
    if (sizes := regions_exhibit(trade)) is not None:
        found.insert(1, sizes)
    rest = [r for r in trade.rows if r.failed]
    return (*found, *((_failures(rest),) if rest else ()))


def case(row: TradeRow) -> tuple[Entry, ...]:
    """Which cell it is; a solver without a step of its own has none."""
    step = _MM * row.dt if row.solver.stepped else None
    return (row.solver.name, row.element, row.level, step)


def shown(value: float | None, trade: Trade) -> float | None:
    """An error in the unit that the trade shows."""
    return None if value is None else trade.scale * value


def dominant(row: TradeRow, trade: Trade) -> str:
    """Which share of the error is largest: mesh, solver, law, or none clearly."""
    shares = {"mesh": row.mesh_error, "solver": row.solver_error}
    if row.solver.law == "linear":
        shares["law"] = trade.law_error
    known = sorted(((v, k) for k, v in shares.items() if v is not None), reverse=True)
    if len(known) < 2 or known[0][0] > _EVEN * known[1][0]:
        return known[0][1] if known else "unknown"
    return f"{known[0][1]} and {known[1][1]}"


# --- the front -----------------------------------------------------------------------------------


def _front_exhibit(trade: Trade) -> Exhibit:
    scene = trade.trial
    words = [
        f"Error: {ERRORS[trade.unit]}. {len(scene.points)} points, {len(scene.frames)} frames; "
        f"the reference ({scene.reference[0]} mesh {scene.reference[1]}, no solver error) "
        f"{'moves' if trade.unit == 'm' else 'has'} {trade.shown(trade.moved, 4)} rms and has "
        f"an error of about {trade.shown(trade.floor, 2)} (Richardson): smaller errors count "
        "as equal.",
        _law_words(trade),
        _TIMES,
    ]
    words += [s for by in _NAMES for s in _dominated(trade.front(by))]
    words += [*scene.notes, *trade.locking]
    named = [by for by in _NAMES if by == "error" or trade.law_error is not None]
    fronts = [trade.front(by) for by in named]
    return Exhibit(
        "front", "Error against time per step", tuple(words),
        tables=tuple(_front_table(f, trade) for f in fronts),
        charts=tuple(_front_chart(f, trade) for f in fronts),
    )  # fmt: skip


def _law_words(trade: Trade) -> str:
    if trade.law_error is None:
        return f"The effect of large strain is not known: {trade.law_words}."
    return (
        f"Fronts of the linear law. On a coarse pair ({trade.law_words}) large strain changes "
        f"the answer by {trade.shown(trade.law_error)} rms. The second front adds that "
        "difference to the reference, so linear and large-strain solvers are compared with "
        "one truth."
    )


def _dominated(front: ParetoFront) -> Iterable[str]:
    if front.dominated:
        named = "; ".join(front.dominated)
        yield f"Dominated by {_NAMES[front.by]}, on all tested meshes and steps: {named}."


def _front_table(front: ParetoFront, trade: Trade) -> NumberTable:
    unit, whole = trade.shown_unit, "motion" if trade.unit == "m" else "reference"
    head = (*_CASE, "time / us", "rate / Hz", f"{_NAMES[front.by]} / {unit}", f"of the {whole} / %",
            f"mesh's share / {unit}", f"solver's share / {unit}", "dominates")  # fmt: skip
    rows = tuple(_front_row(r, front.by, trade) for r in front.rows)
    title = (
        f"Pareto front of {_NAMES[front.by]}, fastest first: no cell has both less error "
        "and less time"
    )
    return NumberTable(f"front_{front.by}", title, head, rows)


def _front_row(row: TradeRow, by: str, trade: Trade) -> tuple[Entry, ...]:
    time, error = row.time_s or 0.0, float(getattr(row, by))
    return (
        *case(row), _US * time, 1 / time, trade.scale * error, 100 * error / trade.moved,
        shown(row.mesh_error, trade), shown(row.solver_error, trade), dominant(row, trade),
    )  # fmt: skip


def _front_chart(front: ParetoFront, trade: Trade) -> Chart:
    rows = [*front.rows, *(r for r, _ in front.beaten)]
    series = []
    for rung in SHOWN:
        mine = [r for r in rows if r.solver.rung == rung]
        if mine:
            series.append(Series(rung, *_points(mine, front.by, trade.scale), "points"))
    series.append(Series("Pareto front", *_points(front.rows, front.by, trade.scale)))
    levels = [("error of the reference", trade.scale * trade.floor)]
    if front.by == "total":
        levels += _law_level(trade)
    return Chart(
        f"front_{front.by}", f"{_NAMES[front.by].capitalize()} against time per step",
        "time of a step with its displacements / µs", f"{_NAMES[front.by]} / {trade.shown_unit}",
        tuple(series),
        levels=tuple(levels), log="xy",
        caption="A point is one solver on one mesh with one element and one step. Levels: the "
                "error of the reference"
                + (", the error of the linear law" if len(levels) > 1 else ""),
    )  # fmt: skip


def _law_level(trade: Trade) -> list[tuple[str, float]]:
    return [] if trade.law_error is None else [("the linear law", trade.scale * trade.law_error)]


def _points(rows: Sequence[TradeRow], by: str, scale: float) -> tuple[np.ndarray, np.ndarray]:
    x = np.array([_US * (r.time_s or 0.0) for r in rows])
    return x, np.array([scale * float(getattr(r, by)) for r in rows])


# --- what an error is made of --------------------------------------------------------------------


def _shares(trade: Trade) -> Exhibit:
    """Mesh beside solver, for every solver and element over the meshes at its best step."""
    rows = _least(trade.rows)
    unit = trade.shown_unit
    head = (*_CASE, "unknowns", f"error / {unit}", f"mesh's share / {unit}",
            f"solver's share / {unit}", f"with the law's / {unit}", "dominates")  # fmt: skip
    cells = tuple(
        (*case(r), r.unknowns, shown(r.error, trade), shown(r.mesh_error, trade),
         shown(r.solver_error, trade), shown(r.total, trade), dominant(r, trade))
        for r in rows
    )  # fmt: skip
    counts: dict[str, int] = {}
    scored = [r for r in trade.rows if r.error is not None]
    for r in scored:
        counts[dominant(r, trade)] = counts.get(dominant(r, trade), 0) + 1
    named = ", ".join(f"{k} {v}" for k, v in sorted(counts.items(), key=lambda kv: -kv[1]))
    words = (
        "The mesh's share is the error of an exact solver on that mesh. The solver's share is "
        "the distance from that solution (time step, masses, damping, iterations, omitted "
        "modes). They are lengths in different directions: at most they add, and they may "
        "cancel.",
        f"Of {len(scored)} cells, the largest share is that of: {named}.",
    )
    note = (
        "One row for every solver, element and mesh: the step with the least error. "
        "cells.csv has all steps."
    )
    table = NumberTable("shares", "Components of each error", head, cells, note)
    return Exhibit("shares", "Mesh error and solver error", words, tables=(table,),
                   charts=(_mesh_chart(trade),))  # fmt: skip


def _least(rows: Iterable[TradeRow]) -> list[TradeRow]:
    best: dict[tuple[str, str, int], TradeRow] = {}
    for r in rows:
        key = (r.solver.name, r.element, r.level)
        if r.error is not None and (key not in best or r.error < (best[key].error or 0.0)):
            best[key] = r
    return list(best.values())


def _mesh_chart(trade: Trade) -> Chart:
    """Mesh error over the cells' size, one line an element."""
    series = []
    for element, levels in trade.trial.meshes.items():
        found = {r.level: r.mesh_error for r in trade.rows
                 if r.element == element and r.mesh_error}  # fmt: skip
        at = [level for level in levels if level in found]
        if at:
            x = _MM * np.array([trade.trial.size(level) for level in at])
            series.append(
                Series(element, x, trade.scale * np.array([found[level] for level in at]))
            )
    return Chart(
        "mesh_error", "Mesh error against cell size", "cell size / mm",
        f"mesh's share / {trade.shown_unit}", tuple(series),
        levels=(("error of the reference", trade.scale * trade.floor), *_law_level(trade)), log=
            "xy",
    )  # fmt: skip


# --- set-up, steps, memory -----------------------------------------------------------------------


def _costs(trade: Trade) -> Exhibit:
    head = (*_CASE, "unknowns", "set-up / ms", "assembled", "p50 / us", "p99 / us", "max / us",
            "steps timed", "field / us", "memory / MB")  # fmt: skip
    shortest = {(r.solver.name, r.element, r.level): r
                for r in trade.rows if r.step is not None}  # fmt: skip
    cells = tuple(_cost_row(r) for r in shortest.values())
    words = (
        "Set-up is from the scene to the first step, at the first of the solver's steps. "
        "Matrices are assembled at first use: K stiffness, M mass, C damping, m lumped "
        "masses. A solver without inertia has no mass matrix; an explicit one at large strain "
        "has no K.",
        f"Memory: {DEFINITION}.",
    )
    note = "One step of every solver, element and mesh; cells.csv has all."
    table = NumberTable("costs", "Set-up, time per step, memory", head, cells, note)
    return Exhibit("costs", "Set-up, steps and memory", words, tables=(table,))


def _cost_row(r: TradeRow) -> tuple[Entry, ...]:
    assert r.step is not None
    s = r.step
    return (
        *case(r), r.unknowns, _MM * r.setup_s, r.assembled, _US * s.p50, _US * s.p99, _US * s.max,
        s.n, _US * r.field_s, _MB * r.memory,
    )  # fmt: skip


# --- convergence ---------------------------------------------------------------------------------


def _convergence(trade: Trade) -> Exhibit:
    unit, whole = trade.shown_unit, "motion" if trade.unit == "m" else "reference"
    head = ("ladder", "sizes, finest first", "conduct", "observed order", "order used",
            f"last difference / {unit}", f"Richardson's error / {unit}", f"index (GCI) / {unit}",
            f"GCI of the {whole} / %")  # fmt: skip
    ladders = tuple(_ladder_row(x, trade) for x in trade.refinements)
    words = (
        "For the finest solution of each ladder: the observed order from three solutions, "
        "Richardson's estimate of its error, and the grid convergence index. The index is "
        "1.25 times that estimate if the observed order is plausible, else 3 times (Roache "
        "1994; Celik et al. 2008). Two solutions have no observed order: the theoretical one "
        "is used. Steps are refined on one mesh.",
        _compared(trade),
    )
    table = NumberTable("convergence", "Discretisation error", head, ladders)
    return Exhibit("convergence", "Observed order and grid convergence index", words,
                   tables=(table,))  # fmt: skip


def _compared(trade: Trade) -> str:
    """The meshes' largest and the steps' largest estimate side by side."""
    meshes = [x.found.error for x in trade.refinements if x.unit == "m"]
    steps = [x.found.error for x in trade.refinements if x.unit == "s"]
    if not (meshes and steps):
        return "The scene has no time steps: only meshes can be refined."
    first = "mesh" if max(meshes) > max(steps) else "step"
    return (
        "At the finest level of each ladder the error of the mesh is "
        f"{trade.shown(min(meshes), 2)} to {trade.shown(max(meshes), 2)}, that of the time "
        f"step {trade.shown(min(steps), 2)} to {trade.shown(max(steps), 2)}: refine the "
        f"{first} first."
    )


def _ladder_row(x: Refinement, trade: Trade) -> tuple[Entry, ...]:
    f, sizes = x.found, ", ".join(f"{_MM * s:.3g}" for s in x.sizes)
    return (
        x.what, f"{sizes} m{x.unit}", f.conduct, f.order, f.used,
        trade.scale * f.differences[0], trade.scale * f.error, trade.scale * f.index,
        100 * f.index / trade.moved,
    )  # fmt: skip


def _failures(rows: Sequence[TradeRow]) -> Exhibit:
    cells = tuple((*case(r), r.failed) for r in rows)
    table = NumberTable("unscored", "Cells without an error", (*_CASE, "why"), cells)
    words = (f"{len(rows)} cells were refused, ended early or were only timed. All are listed.",)
    return Exhibit("unscored", "Cells without an error", words, tables=(table,))
