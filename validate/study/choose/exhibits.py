"""Report of a choice: verdict, the scene's figures, candidate methods with their evidence."""

from collections.abc import Iterator
from types import SimpleNamespace

from validate.compare.exhibit import Exhibit
from validate.report.views.view_filling import chart, grouped, table
from validate.study.choose.study import Choice, error_of, meeting, misses
from validate.study.filters.ranking import SAME_TIME
from validate.study.tradeoff.exhibits import TIME, pays, trade_exhibits
from validate.study.tradeoff.study import ERRORS, TradeRow

_MM, _US = 1e3, 1e6


def choose_exhibits(choice: Choice) -> tuple[Exhibit, ...]:
    """Return the verdict and its evidence, then the table that it rests on."""
    # The requirement and all cells
    by, want, trade = choice.by, choice.wanted, choice.trade
    rows = [r for r in trade.rows if error_of(r, by) and r.time_s]
    left = min(0.5 * min(r.time_s or 1.0 for r in rows), 0.5 / want.rate)
    low = min(0.5 * min(error_of(r, by) or 1.0 for r in rows), 0.5 * want.error)
    corner = ((left, want.error), (1 / want.rate, want.error), (1 / want.rate, low))
    required = [SimpleNamespace(**{"time_s": time, by: error}) for time, error in corner]
    chosen = {"the choice": [choice.pick]} if choice.pick else {"the nearest": [choice.nearest]}
    cells = chart(
        "choice", "Requirement and all cells", TIME, (f"error / {trade.shown_unit}", by),
        points=grouped(rows, "solver.rung") | chosen,
        lines={"required: left of and below this line": required}, log="xy",
    )  # fmt: skip
    columns = {"what": "name", "value": "value", "asks for": "means"}
    facts = table("numbers", "Properties of the scene", choice.facts, columns)
    title = "Fastest cell of every candidate method that meets both, else its nearest"
    columns = {
        "rung": "rung", "verdict": "verdict", "cells": "run", "scored": "scored",
        f"error / {trade.shown_unit}": f"best.{by}", "time / us": "best.time_s",
        "rate / Hz": "best.rate_hz", "evidence": "evidence",
    }  # fmt: skip
    ladder = [table("ladder", title, choice.ladder, columns)]
    if choice.excluded:
        note = (
            f"A bound is the median step of the pilot run divided by {SAME_TIME:g}, because "
            "step times are noisy."
        )
        columns = {
            "rung": "rung", "candidate": "candidate", "a step takes at least / us": "bound",
            "pick / us": "pick", "why": "why",
        }  # fmt: skip
        title = "Candidates left out by a bound"
        ladder.append(table("excluded", title, choice.excluded, columns, note))
    return (
        Exhibit("choice", "The choice", tuple(words(choice)), charts=(cells,)),
        Exhibit("numbers", "Properties of the scene", tables=(facts,)),
        Exhibit("ladder", "The ladder", tuple(choice.rejected), tables=tuple(ladder)),
        *trade_exhibits(trade),
    )


def words(choice: Choice) -> Iterator[str]:
    """The verdict in sentences, plainly."""
    want = choice.wanted
    asked = f"{choice.trade.shown(want.error)} and {want.rate:.4g} Hz"
    if choice.pick is not None:
        first = f"the fastest cell that does (candidate '{choice.pick.solver.rung}')"
        yield f"{described(choice.pick, choice)} meets {asked}: {first}."
        if choice.excluded:
            n = len(choice.excluded)
            who = "1 candidate was" if n == 1 else f"{n} candidates were"
            yield (
                f"{who} left out by a bound: on the coarsest mesh their step already takes longer "
                "than that of the choice."
            )
        if choice.confirmed is not None:
            ms = _MM * choice.confirmed.dt
            yield (
                f"Run again with a new state every {ms:.3g} ms, as the rate asks: "
                f"{described(choice.confirmed, choice)}."
            )
        elif choice.trade.trial.dynamic:
            yield "Its step is not longer than a tick of the rate."
        # A cell of less error whose time the clock can hardly tell from the pick's
        dynamic = choice.trade.trial.dynamic
        limit = SAME_TIME * (choice.pick.time_s or 0.0)
        rows = [r for r in _judged(choice) if (r.time_s or 0.0) <= limit]
        equal = meeting(rows, choice.wanted, choice.by, dynamic)
        own = choice.pick
        best = min(equal, key=lambda r: error_of(r, choice.by) or 0.0, default=own)
        if (best.solver, best.element, best.level) != (own.solver, own.element, own.level):
            yield f"Within {SAME_TIME:g} times its time and less wrong: {described(best, choice)}."
    else:
        yield f"Nothing meets both {asked}."
        wrong, late = misses(choice.nearest, want, choice.by, choice.trade.trial.dynamic)
        missed = [
            *([f"its error is {wrong:.3g} times the required one"] if wrong > 1 else []),
            *([f"it is {late:.3g} times too slow"] if late > 1 else []),
        ] or ["it meets both at its step, but not with a new state at every tick"]
        yield f"Nearest: {described(choice.nearest, choice)}; {' and '.join(missed)}."
        yield from _one_sided(choice)
    yield from pays(choice.trade)
    floor = choice.trade.floor
    if want.error < floor:
        off = choice.trade.shown(floor, 2)
        yield f"The error of the reference is {off}: a smaller error cannot be verified."
    what = "with the error of the linear law" if choice.by == "total" else "within the linear law"
    yield (
        f"Errors are {what}; the rate is that of the median step, including the "
        "displacements of all nodes."
    )
    if choice.trade.unit != "m":
        yield f"An error is the {ERRORS[choice.trade.unit]}."


def described(row: TradeRow, choice: Choice) -> str:
    """Return a row by its numbers."""
    error, time = error_of(row, choice.by) or 0.0, row.time_s or 0.0
    step = f", steps of {_MM * row.dt:.3g} ms" if row.solver.stepped else ""
    reached = choice.trade.shown(error)
    return f"{row.label}{step}: {reached} at {1 / time:.4g} Hz ({_US * time:.3g} us)"


def _judged(choice: Choice) -> list[TradeRow]:
    """The rows that may be chosen."""
    laws = ("linear",) if choice.by == "error" else ("linear", "neo_hooke")
    rows = [r for r in choice.trade.rows if r.solver.law in laws]
    return [r for r in rows if not r.solver.lacks]


def _one_sided(choice: Choice) -> Iterator[str]:
    dynamic = choice.trade.trial.dynamic
    miss = [(misses(r, choice.wanted, choice.by, dynamic), r) for r in _judged(choice)]
    exact = [r for (wrong, _), r in miss if wrong <= 1]
    quick = [(wrong, r) for (wrong, late), r in miss if late <= 1]
    if exact:
        fastest = min(exact, key=lambda r: r.time_s or 0.0)
        yield f"The fastest that meets the error: {described(fastest, choice)}."
    else:
        yield "No cell meets the error: finer meshes than those of the ladder are needed."
    if quick:
        best = min(quick, key=lambda pair: pair[0])[1]
        yield f"The least error at that rate: {described(best, choice)}."
    else:
        yield "No cell meets the rate."
