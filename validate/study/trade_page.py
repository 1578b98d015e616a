"""What a trade or a choice tells: its sentence, its part of results.json, its table of cells."""

from collections.abc import Sequence
from typing import Any

from validate.study.choose import Choice, error_of
from validate.study.choose_exhibits import choose_exhibits, words
from validate.study.study_page import Findings, Row
from validate.study.trade import ERRORS, Refinement, Trade, TradeRow
from validate.study.trade_exhibits import trade_exhibits

_HEAD = (
    "solver", "rung", "law", "element", "mesh", "cell_size_m", "dt_s", "unknowns", "setup_s",
    "assembled", "step_p50_s", "step_p99_s", "step_max_s", "steps_timed", "field_s", "time_s",
    "memory_bytes", "error_m", "with_law_m", "mesh_share_m", "solver_share_m", "front",
    "front_with_law", "without_error",
)  # fmt: skip


# Of `_HEAD` in the trade's unit, and in SI as its suffix.
_ERRORS = ("error_m", "with_law_m", "mesh_share_m", "solver_share_m")


def _head(trade: Trade) -> tuple[str, ...]:
    return tuple(_in_unit(name, trade) if name in _ERRORS else name for name in _HEAD)


def _in_unit(name: str, trade: Trade) -> str:
    return name.removesuffix("m") + trade.unit


def told(trade: Trade) -> Findings:
    return Findings(
        f"Trade: {trade.experiment.title}", sentence(trade), trade_exhibits(trade),
        {"kind": "tradeoff", **trade_document(trade)}, (_head(trade), cells_table(trade)),
        trade.quick,
    )  # fmt: skip


def told_choice(choice: Choice) -> Findings:
    trade = choice.trade
    document = {"kind": "choose", **_choice_document(choice), **trade_document(trade)}
    return Findings(
        f"Choice: {trade.experiment.title}", next(words(choice)), choose_exhibits(choice),
        document, (_head(trade), cells_table(trade)), trade.quick,
    )  # fmt: skip


def sentence(trade: Trade) -> str:
    """What ran and what lies on the front, in one sentence."""
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


def cells_table(trade: Trade) -> tuple[Row, ...]:
    """Every cell, SI: rows of tables/cells.csv."""
    fronts = [{id(r) for r in trade.front(by).rows} for by in ("error", "total")]
    return tuple(_cell(r, trade, [id(r) in f for f in fronts]) for r in trade.rows)


def _cell(r: TradeRow, trade: Trade, fronts: Sequence[bool]) -> Row:
    s = r.step
    times = (s.p50, s.p99, s.max, s.n) if s else (None,) * 4
    return (
        r.solver.name, r.solver.rung, r.solver.law, r.element, r.level, trade.trial.size(r.level),
        r.dt if r.solver.stepped else None, r.unknowns, r.setup_s, r.assembled, *times, r.field_s,
        r.time_s, r.memory, r.error, r.total, r.mesh_error, r.solver_error, *fronts,
        r.failed or None,
    )  # fmt: skip


def trade_document(trade: Trade) -> dict[str, Any]:
    """The trade's part of results.json: SI, nothing that is not finite."""
    fronts = {by: trade.front(by) for by in ("error", "total")}
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
        "reused": trade.done.reused,
        "seconds": trade.done.seconds,
        "workers": trade.done.workers,
        "dominated": {by: list(f.dominated) for by, f in fronts.items()},
        "fronts": {by: [r.label for r in f.rows] for by, f in fronts.items()},
        "convergence": [_refinement(x, trade) for x in trade.refinements],
        "cells": [dict(zip(_head(trade), row, strict=True)) for row in cells_table(trade)],
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


def _choice_document(choice: Choice) -> dict[str, Any]:
    want = choice.wanted
    return {
        "wanted": {_in_unit("error_m", choice.trade): want.error, "rate_hz": want.rate,
                   "by": choice.by},
        "verdict": list(words(choice)),
        "pick": _named(choice.pick, choice),
        "at_every_tick": _named(choice.confirmed, choice),
        "nearest": _named(choice.nearest, choice),
        "numbers": [{"name": f.name, "value": f.value, "means": f.means} for f in choice.facts],
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
    }  # fmt: skip


def _named(row: TradeRow | None, choice: Choice) -> dict[str, Any] | None:
    if row is None:
        return None
    return {
        "solver": row.solver.name, "element": row.element, "mesh": row.level, "dt_s": row.dt,
        _in_unit("error_m", choice.trade): error_of(row, choice.by), "time_s": row.time_s,
    }  # fmt: skip
