"""Report of a trade-off: front, parts of each error, set-up, memory, convergence, failures."""

from collections import Counter
from collections.abc import Iterator, Mapping
from itertools import groupby

from validate.compare.exhibit import Chart, Exhibit, NumberTable
from validate.pipeline.ladder.ladder import SHOWN
from validate.report.views.view_filling import Shown, chart, grouped, table
from validate.study.filters.ranking import SAME_TIME
from validate.study.tradeoff.cell import DEFINITION
from validate.study.tradeoff.study import ERRORS, ParetoFront, Refinement, Trade, TradeRow

_NAMES = {"error": "error", "total": "error including the law"}
_MS, _MB = 1e3, 1e-6
_EVEN = 2.0  # of two shares neither dominates within this ratio
_CASE: Mapping[str, Shown] = {
    "solver": "solver.name", "element": "element", "mesh": "level", "step / ms": "own_dt",
}  # fmt: skip
TIME = ("time of a step with its displacements / µs", "time_s")
_TIMES = (
    "All cells ran one after another in one process, with linear algebra on one thread; "
    "parallel cells would compete for memory. A time is the median of a step plus that of "
    "forming the displacements of all nodes. Step times are noisy on a busy machine: times "
    f"within {SAME_TIME:g} times count as equal."
)


def trade_exhibits(trade: Trade) -> tuple[Exhibit, ...]:
    """In the order of a reader's questions."""
    columns: Mapping[str, Shown] = {
        **_CASE, "unknowns": "unknowns", "set-up / ms": "setup_s", "assembled": "assembled",
        "p50 / us": "step.p50", "p99 / us": "step.p99", "max / us": "step.max",
        "steps timed": "step.n", "field / us": "field_s",
        "memory / MB": lambda r: _MB * r.memory,
    }  # fmt: skip
    shortest = {(r.solver.name, r.element, r.level): r
                for r in trade.rows if r.step is not None}  # fmt: skip
    of_costs = (
        "Set-up is from the scene to the first step, at the first of the solver's steps. "
        "Matrices are assembled at first use: K stiffness, M mass, C damping, m lumped "
        "masses. A solver without inertia has no mass matrix; an explicit one at large strain "
        "has no K.",
        f"Memory: {DEFINITION}.",
    )
    note = "One step of every solver, element and mesh; cells.csv has all."
    times = table("costs", "Set-up, time per step, memory", shortest.values(), columns, note)
    costs = Exhibit("costs", "Set-up, steps and memory", of_costs, (times,))
    found = [_front_exhibit(trade), _shares(trade), costs, _convergence(trade)]
    if (sizes := regions_exhibit(trade)) is not None:
        found.insert(1, sizes)
    if rest := [r for r in trade.rows if r.failed]:
        title = "Cells without an error"
        words = (
            f"{len(rest)} cells were refused, ended early or were only timed. All are listed.",
        )
        failed = table("unscored", title, rest, {**_CASE, "why": "failed"})
        found.append(Exhibit("unscored", title, words, (failed,)))
    return tuple(found)


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
    law = f"The effect of large strain is not known: {trade.law_words}."
    if trade.law_error is not None:
        law = (
            f"Fronts of the linear law. On a coarse pair ({trade.law_words}) large strain changes "
            f"the answer by {trade.shown(trade.law_error)} rms. The second front adds that "
            "difference to the reference, so linear and large-strain solvers are compared with "
            "one truth."
        )
    words = [
        f"Error: {ERRORS[trade.unit]}. {len(scene.points)} points, {len(scene.frames)} frames; "
        f"the reference ({scene.reference[0]} mesh {scene.reference[1]}, no solver error) "
        f"{'moves' if trade.unit == 'm' else 'has'} {trade.shown(trade.moved, 4)} rms and has "
        f"an error of about {trade.shown(trade.floor, 2)} (Richardson): smaller errors count "
        "as equal.",
        law,
        _TIMES,
    ]
    for by in _NAMES:
        if dominated := trade.front(by).dominated:
            named_cells = "; ".join(dominated)
            words.append(
                f"Dominated by {_NAMES[by]}, on all tested meshes and steps: {named_cells}."
            )
    words += [*scene.notes, *trade.locking]
    named = [by for by in _NAMES if by == "error" or trade.law_error is not None]
    fronts = [trade.front(by) for by in named]
    return Exhibit(
        "front", "Error against time per step", tuple(words),
        tables=tuple(_front_table(f, trade) for f in fronts),
        charts=tuple(_front_chart(f, trade) for f in fronts),
    )  # fmt: skip


def _shares_of(trade: Trade) -> Mapping[str, Shown]:
    unit = trade.shown_unit
    return {f"mesh's share / {unit}": "mesh_error", f"solver's share / {unit}": "solver_error"}


def _front_table(front: ParetoFront, trade: Trade) -> NumberTable:
    whole = "motion" if trade.unit == "m" else "reference"
    columns: Mapping[str, Shown] = {
        **_CASE, "time / us": "time_s", "rate / Hz": "rate_hz",
        f"{_NAMES[front.by]} / {trade.shown_unit}": front.by,
        f"of the {whole} / %": lambda r: getattr(r, front.by) / trade.moved,
        **_shares_of(trade), "dominates": lambda r: dominant(r, trade),
    }  # fmt: skip
    title = (
        f"Pareto front of {_NAMES[front.by]}, fastest first: no cell has both less error "
        "and less time"
    )
    return table(f"front_{front.by}", title, front.rows, columns)


def _front_chart(front: ParetoFront, trade: Trade) -> Chart:
    by_rung = grouped([*front.rows, *(r for r, _ in front.beaten)], "solver.rung")
    levels = {"error of the reference": trade.floor}
    levels |= _law_level(trade) if front.by == "total" else {}
    return chart(
        f"front_{front.by}", f"{_NAMES[front.by].capitalize()} against time per step", TIME,
        (f"{_NAMES[front.by]} / {trade.shown_unit}", front.by),
        points={rung: by_rung[rung] for rung in SHOWN if rung in by_rung},
        lines={"Pareto front": front.rows}, levels=levels, log="xy",
        caption="A point is one solver on one mesh with one element and one step. Levels: the "
                "error of the reference"
                + (", the error of the linear law" if len(levels) > 1 else ""),
    )  # fmt: skip


def _law_level(trade: Trade) -> dict[str, float]:
    return {} if trade.law_error is None else {"the linear law": trade.law_error}


# --- what an error is made of --------------------------------------------------------------------


def _shares(trade: Trade) -> Exhibit:
    """Mesh beside solver, for every solver and element over the meshes at its best step."""
    columns: Mapping[str, Shown] = {
        **_CASE, "unknowns": "unknowns", f"error / {trade.shown_unit}": "error",
        **_shares_of(trade), f"with the law's / {trade.shown_unit}": "total",
        "dominates": lambda r: dominant(r, trade),
    }  # fmt: skip
    counts = Counter(dominant(r, trade) for r in trade.rows if r.error is not None)
    named = ", ".join(f"{share} {count}" for share, count in counts.most_common())
    words = (
        "The mesh's share is the error of an exact solver on that mesh. The solver's share is "
        "the distance from that solution (time step, masses, damping, iterations, omitted "
        "modes). They are lengths in different directions: at most they add, and they may "
        "cancel.",
        f"Of {counts.total()} cells, the largest share is that of: {named}.",
    )
    note = (
        "One row for every solver, element and mesh: the step with the least error. "
        "cells.csv has all steps."
    )
    # The step with the least error of every solver, element and mesh
    best: dict[tuple[str, str, int], TradeRow] = {}
    for row in trade.rows:
        key = (row.solver.name, row.element, row.level)
        if row.error is not None and (key not in best or row.error < (best[key].error or 0.0)):
            best[key] = row
    least = table("shares", "Components of each error", list(best.values()), columns, note)
    # Mesh error over the cells' size, one line an element
    lines = {}
    for element, levels in trade.trial.meshes.items():
        by_level = {r.level: r for r in trade.rows if r.element == element and r.mesh_error}
        lines[element] = [by_level[level] for level in levels if level in by_level]
    meshes = chart(
        "mesh_error", "Mesh error against cell size",
        ("cell size / mm", lambda r: trade.trial.size(r.level)),
        (f"mesh's share / {trade.shown_unit}", "mesh_error"), lines=lines,
        levels={"error of the reference": trade.floor} | _law_level(trade), log="xy",
    )  # fmt: skip
    return Exhibit("shares", "Mesh error and solver error", words, (least,), (meshes,))


# --- convergence ---------------------------------------------------------------------------------


def _convergence(trade: Trade) -> Exhibit:
    unit, whole = trade.shown_unit, "motion" if trade.unit == "m" else "reference"
    columns: Mapping[str, Shown] = {
        "ladder": "what", "sizes, finest first": _sizes, "conduct": "found.conduct",
        "observed order": "found.order", "order used": "found.used",
        f"last difference / {unit}": lambda x: x.found.differences[0],
        f"Richardson's error / {unit}": "found.error", f"index (GCI) / {unit}": "found.index",
        f"GCI of the {whole} / %": lambda x: x.found.index / trade.moved,
    }  # fmt: skip
    # The meshes' and the steps' estimates at the finest level of each ladder.
    meshes = [x.found.error for x in trade.refinements if x.unit == "m"]
    steps = [x.found.error for x in trade.refinements if x.unit == "s"]
    compared = "The scene has no time steps: only meshes can be refined."
    if meshes and steps:
        first = "mesh" if max(meshes) > max(steps) else "step"
        compared = (
            "At the finest level of each ladder the error of the mesh is "
            f"{trade.shown(min(meshes), 2)} to {trade.shown(max(meshes), 2)}, that of the time "
            f"step {trade.shown(min(steps), 2)} to {trade.shown(max(steps), 2)}: refine the "
            f"{first} first."
        )
    words = (
        "For the finest solution of each ladder: the observed order from three solutions, "
        "Richardson's estimate of its error, and the grid convergence index. The index is "
        "1.25 times that estimate if the observed order is plausible, else 3 times (Roache "
        "1994; Celik et al. 2008). Two solutions have no observed order: the theoretical one "
        "is used. Steps are refined on one mesh.",
        compared,
    )
    orders = table("convergence", "Discretisation error", trade.refinements, columns)
    return Exhibit("convergence", "Observed order and grid convergence index", words, (orders,))


def _sizes(x: Refinement) -> str:
    return f"{', '.join(f'{1e3 * s:.3g}' for s in x.sizes)} m{x.unit}"


# --- regions --------------------------------------------------------------------------------------


def regions_exhibit(trade: Trade) -> Exhibit | None:
    """Rivals side by side on every mesh; None for a body without regions."""
    rows = _timed(trade)
    if not any(r.solver.rung == "regions" for r in rows):
        return None
    columns: Mapping[str, Shown] = {
        "mesh": "level", "unknowns": "unknowns", "solver": "solver.name", "step / ms": "dt",
        "median / ms": "step.p50", "slow steps (p99) / ms": "step.p99", "worst / ms": "step.max",
        f"error / {trade.shown_unit}": "error",
    }  # fmt: skip
    title = "Times of a step by body size, without forming displacements"
    times = table("regions", title, rows, columns)
    return Exhibit(
        "regions", "Body size from which regions are faster", tuple(pays(trade)), (times,)
    )


def pays(trade: Trade) -> Iterator[str]:
    """What the times say, size by size; nothing for a body without regions."""
    rows = _timed(trade)
    if not any(r.solver.rung == "regions" for r in rows):
        return
    for _, mine in groupby(rows, key=lambda r: (r.element, r.level)):
        of_size = list(mine)
        regions = _fastest(of_size, "regions")
        whole, reduced = _fastest(of_size, "prefactored"), _fastest(of_size, "modal")
        if regions is None or whole is None or not (regions.step and whole.step):
            continue
        faster = "faster" if SAME_TIME * regions.step.p50 < whole.step.p50 else "not faster"
        holds = "shorter" if SAME_TIME * regions.step.p99 < whole.step.p99 else "not shorter"
        modal = ""
        if reduced is not None and reduced.step is not None:
            modal = f"; '{reduced.solver.name}' takes {_MS * reduced.step.p50:.3g} ms"
        yield (
            f"{of_size[0].unknowns} unknowns: regions ({regions.solver.name}) are {faster} than "
            f"the whole solve in the median ({_MS * regions.step.p50:.3g} for "
            f"{_MS * whole.step.p50:.3g} ms) and {holds} in slow steps "
            f"({_MS * regions.step.p99:.3g} for {_MS * whole.step.p99:.3g} ms){modal}."
        )
    yield (
        "Regions are slow in the steps in which far regions are also solved; a deadline must "
        "allow for them. (A busy machine lengthens the slow steps of every method.) A reduced "
        "model is valid for a linear body whose contact does not move. Regions are useful "
        "where matrices change at every step, or where another machine solves the far region."
    )


def _fastest(rows: list[TradeRow], rung: str) -> TradeRow | None:
    mine = [r for r in rows if r.solver.rung == rung and r.step]
    return min(mine, key=lambda r: r.step.p50 if r.step else 0.0, default=None)


def _timed(trade: Trade) -> list[TradeRow]:
    """Rows with times at the ladder's longest step, by mesh."""
    dt = trade.trial.steps[0]
    rows = [r for r in trade.rows if r.step and r.dt == dt]
    return sorted(rows, key=lambda r: (r.element, r.unknowns))
