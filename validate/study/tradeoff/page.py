"""Page of a trade-off or choice: sentence, part of results.json, table of cells."""

from collections.abc import Mapping
from typing import Any

from validate.compare.exhibit import NumberTable
from validate.report.stored.json_values import members
from validate.report.views.view_filling import Shown, table
from validate.study.choose.exhibits import choose_exhibits, words
from validate.study.choose.study import Choice, error_of
from validate.study.study_page import Findings
from validate.study.tradeoff.exhibits import trade_exhibits
from validate.study.tradeoff.study import ERRORS, Refinement, Trade, TradeRow


def _in_unit(name: str, trade: Trade) -> str:
    return name.removesuffix("m") + trade.unit


def told(trade: Trade) -> Findings:
    return Findings(
        f"Trade: {trade.experiment.title}", sentence(trade), trade_exhibits(trade),
        {"kind": "tradeoff", **trade_document(trade)}, cells_table(trade), trade.quick,
    )  # fmt: skip


def told_choice(choice: Choice) -> Findings:
    trade, want = choice.trade, choice.wanted
    document = {
        "kind": "choose",
        "wanted": {_in_unit("error_m", trade): want.error, "rate_hz": want.rate, "by": choice.by},
        "verdict": list(words(choice)),
        "pick": _named(choice.pick, choice),
        "at_every_tick": _named(choice.confirmed, choice),
        "nearest": _named(choice.nearest, choice),
        "numbers": [members(f) for f in choice.facts],
        "ladder": [
            {"rung": c.rung, "verdict": c.verdict, "cells": c.run, "scored": c.scored,
             "evidence": c.evidence, "best": _named(c.best, choice)}
            for c in choice.ladder
        ],
        "excluded": [
            {"rung": e.rung, "candidate": e.candidate, "bound_s": e.bound, "pick_s": e.pick,
             "why": e.why}
            for e in choice.excluded
        ],
        **trade_document(trade),
    }  # fmt: skip
    return Findings(
        f"Choice: {trade.experiment.title}", next(words(choice)), choose_exhibits(choice),
        document, cells_table(trade), trade.quick,
    )  # fmt: skip


def sentence(trade: Trade) -> str:
    """Return the number of cells and the ends of the Pareto front, in one sentence."""
    scored = sum(r.error is not None for r in trade.rows)
    on = trade.front()
    ends = ""
    if on.rows:
        first, last = on.rows[0], on.rows[-1]
        ends = (
            f"; the front runs from {first.label} ({trade.shown(first.error or 0)}, "
            f"{1e6 * (first.time_s or 0):.3g} us) to {last.label} ({trade.shown(last.error or 0)}, "
            f"{1e6 * (last.time_s or 0):.3g} us)"
        )
    return f"{len(trade.rows)} cells, {scored} with an error{ends}."


def cells_table(trade: Trade) -> NumberTable:
    """Every cell, SI: tables/cells.csv."""
    unit, fronts = trade.unit, [{id(r) for r in trade.front(by).rows} for by in ("error", "total")]
    columns: Mapping[str, Shown] = {
        "solver": "solver.name", "rung": "solver.rung", "law": "solver.law", "element": "element",
        "mesh": "level", "cell_size_m": lambda r: trade.trial.size(r.level), "dt_s": "own_dt",
        "unknowns": "unknowns", "setup_s": "setup_s", "assembled": "assembled",
        "step_p50_s": "step.p50", "step_p99_s": "step.p99", "step_max_s": "step.max",
        "steps_timed": "step.n", "field_s": "field_s", "time_s": "time_s",
        "memory_bytes": "memory", f"error_{unit}": "error", f"with_law_{unit}": "total",
        f"mesh_share_{unit}": "mesh_error", f"solver_share_{unit}": "solver_error",
        "front": lambda r: id(r) in fronts[0], "front_with_law": lambda r: id(r) in fronts[1],
        "without_error": lambda r: r.failed or None,
    }  # fmt: skip
    return table("cells", "Every cell, SI.", trade.rows, columns)


def trade_document(trade: Trade) -> dict[str, Any]:
    """Return the trade's part of results.json: SI, nothing that is not finite."""
    fronts = {by: trade.front(by) for by in ("error", "total")}
    cells = cells_table(trade)
    return {
        "error": ERRORS[trade.unit],
        "points_m": trade.trial.points.tolist(),
        "frames_s": trade.trial.frames.tolist(),
        "reference": {"element": trade.trial.reference[0], "mesh": trade.trial.reference[1],
                      _in_unit("moved_rms_m", trade): trade.moved,
                      _in_unit("own_error_m", trade): trade.floor},
        _in_unit("law_error_m", trade): trade.law_error,
        "law_pair": trade.law_words,
        "threads": 1,
        **members(trade.done, "reused", "seconds", "workers"),
        "dominated": {by: list(f.dominated) for by, f in fronts.items()},
        "fronts": {by: [r.label for r in f.rows] for by, f in fronts.items()},
        "convergence": [_refinement(x, trade) for x in trade.refinements],
        "cells": [dict(zip(cells.headings, row, strict=True)) for row in cells.rows],
    }  # fmt: skip


def _refinement(x: Refinement, trade: Trade) -> dict[str, Any]:
    f = x.found
    return {
        "what": x.what, "sizes": list(x.sizes), "unit": x.unit, "conduct": f.conduct,
        "observed_order": f.order, "order_used": f.used,
        _in_unit("differences_m", trade): list(f.differences),
        _in_unit("richardson_error_m", trade): f.error,
        _in_unit("gci_m", trade): f.index,
    }  # fmt: skip


def _named(row: TradeRow | None, choice: Choice) -> dict[str, Any] | None:
    if row is None:
        return None
    return {
        "solver": row.solver.name, "element": row.element, "mesh": row.level, "dt_s": row.dt,
        _in_unit("error_m", choice.trade): error_of(row, choice.by), "time_s": row.time_s,
    }  # fmt: skip
