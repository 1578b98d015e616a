"""A trade or a choice as its folder: results.json, tables, figures and a page."""

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from validate.catalogue import experiment_files
from validate.compare.exhibit import Exhibit
from validate.compare.result import Result
from validate.report.study_page import Row as TableRow
from validate.report.study_page import StudyPage, write_study_page
from validate.study.choose import Choice, error_of
from validate.study.choose_exhibits import choose_exhibits, words
from validate.study.trade import ERROR, Ladder, Row, Trade
from validate.study.trade_exhibits import trade_exhibits

TRADEOFF, CHOOSE = "study-tradeoff", "study-choose"
_HEAD = (
    "solver", "rung", "law", "element", "mesh", "cell_size_m", "dt_s", "unknowns", "setup_s",
    "assembled", "step_p50_s", "step_p99_s", "step_max_s", "steps_timed", "field_s", "time_s",
    "memory_bytes", "error_m", "with_law_m", "mesh_share_m", "solver_share_m", "front",
    "front_with_law", "without_error",
)  # fmt: skip


def folder_of(trade: Trade, kind: str, out: Path | None) -> Path:
    """`out`/<name>/<kind>, by default in the reports/ beside the experiments."""
    files = experiment_files(Path.cwd())
    reports = out or next(iter(files.values())).parents[1] / "reports"
    return reports / trade.scene.name / kind


def write_trade(trade: Trade, folder: Path) -> Path:
    """Replaces `folder`; returns the path of report.html."""
    told = {"kind": "tradeoff", **trade_document(trade)}
    return _write(trade, "Trade", sentence(trade), trade_exhibits(trade), told, folder)


def write_choice(choice: Choice, folder: Path) -> Path:
    """Replaces `folder`; returns the path of report.html."""
    told = {"kind": "choose", **_choice_document(choice), **trade_document(choice.trade)}
    verdict = next(words(choice))
    return _write(choice.trade, "Choice", verdict, choose_exhibits(choice), told, folder)


def sentence(trade: Trade) -> str:
    """What ran and what lies on the front, in one sentence."""
    scored = sum(r.error is not None for r in trade.rows)
    on = trade.front()
    ends = ""
    if on.rows:
        first, last = on.rows[0], on.rows[-1]
        ends = (
            f"; the front runs from {first.label} ({1e3 * (first.error or 0):.3g} mm, "
            f"{1e6 * (first.time_s or 0):.3g} us) to {last.label} ({1e3 * (last.error or 0):.3g} "
            f"mm, {1e6 * (last.time_s or 0):.3g} us)"
        )
    return f"{len(trade.rows)} cells, {scored} with an error{ends}."


def _write(
    trade: Trade, what: str, said: str, exhibits: tuple[Exhibit, ...], told: dict[str, Any],
    folder: Path,
) -> Path:  # fmt: skip
    scene = trade.scene
    result = Result(
        name=scene.name, title=f"{what}: {scene.title}", source=scene.source, sentence=said,
        parameters=(), methods=(), recordings=(), rest=(), effects=(), published=(),
        quick=trade.quick, exhibits=exhibits,
    )  # fmt: skip
    created = datetime.now(UTC).isoformat(timespec="seconds")
    page = StudyPage(result, told, (_HEAD, cells_table(trade)), ())
    return write_study_page(page, folder, created)


def cells_table(trade: Trade) -> tuple[TableRow, ...]:
    """Every cell, SI: rows of tables/cells.csv."""
    fronts = [{id(r) for r in trade.front(by).rows} for by in ("error", "total")]
    return tuple(_cell(r, trade, [id(r) in f for f in fronts]) for r in trade.rows)


def _cell(r: Row, trade: Trade, fronts: Sequence[bool]) -> TableRow:
    c, s = r.cell, r.step
    times = (s.p50, s.p99, s.max, s.n) if s else (None,) * 4
    return (
        c.solver.name, c.solver.rung, c.solver.law, c.element, c.level, trade.scene.size(c.level),
        c.dt if c.solver.stepped else None, r.unknowns, r.setup_s, r.assembled, *times, r.field_s,
        r.time_s, r.memory, r.error, r.total, r.mesh_error, r.solver_error, *fronts,
        r.failed or None,
    )  # fmt: skip


def trade_document(trade: Trade) -> dict[str, Any]:
    """The trade's part of results.json: SI, nothing that is not finite."""
    fronts = {by: trade.front(by) for by in ("error", "total")}
    return {
        "error": ERROR,
        "points_m": trade.scene.points.tolist(),
        "frames_s": trade.scene.frames.tolist(),
        "reference": {"element": trade.scene.reference[0], "mesh": trade.scene.reference[1],
                      "moved_rms_m": trade.moved, "own_error_m": trade.floor},
        "law_error_m": trade.law_error,
        "law_pair": trade.law_words,
        "threads": 1,
        "seconds": trade.seconds,
        "dominated": {by: list(f.dominated) for by, f in fronts.items()},
        "fronts": {by: [r.label for r in f.rows] for by, f in fronts.items()},
        "convergence": [_ladder(x) for x in trade.ladders],
        "cells": [dict(zip(_HEAD, row, strict=True)) for row in cells_table(trade)],
    }  # fmt: skip


def _ladder(x: Ladder) -> dict[str, Any]:
    f = x.found
    return {
        "what": x.what, "sizes": list(x.sizes), "unit": x.unit, "conduct": f.conduct,
        "observed_order": f.order, "order_used": f.used, "differences_m": list(f.differences),
        "richardson_error_m": f.error, "gci_m": f.index,
    }  # fmt: skip


def _choice_document(choice: Choice) -> dict[str, Any]:
    want = choice.wanted
    return {
        "wanted": {"error_m": want.error, "rate_hz": want.rate, "by": choice.by},
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
    }  # fmt: skip


def _named(row: Row | None, choice: Choice) -> dict[str, Any] | None:
    if row is None:
        return None
    c = row.cell
    return {
        "solver": c.solver.name, "element": c.element, "mesh": c.level, "dt_s": c.dt,
        "error_m": error_of(row, choice.by), "time_s": row.time_s,
    }  # fmt: skip
