"""A finished study as its folder: results.json, tables, figures and a page; cells stay."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from validate.compare.result import Result
from validate.parameters import describe
from validate.replay.options import Options, configure
from validate.report.study_page import Row, StudyPage, write_study_page
from validate.study.exhibits import study_exhibits
from validate.study.filters import CELLS, Study
from validate.study.interval import interval
from validate.study.outcome import CellResult
from validate.study.plan import Cell
from validate.study.wording import consistency, seeds_text


def write_study(study: Study, folder: Path) -> Path:
    """Replaces all of `folder` but its cells; returns the path of report.html."""
    created = datetime.now(UTC).isoformat(timespec="seconds")
    page = StudyPage(_result(study), document(study), cells_table(study), (CELLS,))
    return write_study_page(page, folder, created)


def _result(study: Study) -> Result:
    """The study in the type that pages are made of: exhibits, parameters, no methods run once."""
    experiment, job = study.plan.experiment, study.plan.job
    parameters, methods = configure(
        experiment, Options(dict(job.values), study.plan.methods, job.quick)
    )
    return Result(
        name=experiment.name,
        title=f"Filter study: {experiment.title}",
        source=experiment.source,
        sentence=sentence(study),
        parameters=describe(parameters) + describe(methods, "methods."),
        methods=(),
        recordings=(),
        rest=(),
        effects=(),
        published=(),
        quick=job.quick,
        same_model=experiment.same_model,
        seed=job.seeds[0],
        twin_notice=experiment.twin_notice,
        exhibits=study_exhibits(study),
    )


def sentence(study: Study) -> str:
    """What ran and what won, in one sentence."""
    cells, best = len(study.plan.cells), study.best[0]
    doubts = f" ({best.doubts})" if best.doubts else ""
    more = f" (first of {len(study.rankings)} conditions)" if len(study.rankings) > 1 else ""
    failed = f", {study.failed} failed" if study.failed else ""
    half = best.ranked.score.half
    spread = "" if half is None else f" ± {1e3 * half:.2g}"
    seeds = seeds_text(len(study.plan.job.seeds))
    return (
        f"{cells} cells over {seeds}{failed}; best by {study.by}{more}: "
        f"{best.ranked.cell.method}, {1e3 * best.ranked.score.mean:.4g}{spread} mm{doubts}."
    )


def document(study: Study) -> dict[str, Any]:
    """The study's own part of results.json: SI, nothing that is not finite."""
    job = study.plan.job
    return {
        "kind": "filters",
        "by": study.by,
        "seeds": list(job.seeds),
        "axes": [{"path": a.path, "values": list(a.values)} for a in study.plan.axes],
        "reused": study.reused,
        "seconds": study.seconds,
        "workers": study.workers,
        "best": [
            {
                "condition": dict(b.ranked.cell.condition),
                "command": b.line,
                "ties": b.ties,
                "at_end_of_sweep": list(b.edges),
            }
            for b in study.best
        ],
        "cells": [_cell(c, study.results[c.key]) for c in study.plan.cells],
    }


def _cell(cell: Cell, result: CellResult) -> dict[str, Any]:
    scores = {
        name: {"mean": i.mean, "half_95": i.half, "count": i.count, "unit": result.units[name]}
        for name, values in result.scores.items()
        for i in (interval(values),)
    }
    return {
        "method": cell.method,
        "values": cell.values,
        "failed": result.failed or None,
        "scores": scores,
        "step_s": result.step_s,
        "setup_s": result.setup_s,
        "steps": result.steps,
        "gains_repeat_from_step": result.frozen,
        "seeds_together": result.shared,
        "seconds": result.seconds,
    }


def cells_table(study: Study) -> tuple[tuple[str, ...], tuple[Row, ...]]:
    """Every cell, SI: head and rows of tables/cells.csv; place is by condition."""
    axes = [a.path for a in study.plan.axes]
    place = {r.cell.key: r for ranking in study.rankings for r in ranking.rows}
    head = ("method", *axes, "place", f"{study.by}_m", "half_95_m", "seeds", "tied_with_first",
            "nis_per_dof", "verdict", "step_s", "gains_repeat_from_step", "failed")  # fmt: skip
    rows: list[Row] = []
    for cell in study.plan.cells:
        result, r = study.results[cell.key], place.get(cell.key)
        seen = consistency(result)
        numbers = (r.place, r.score.mean, r.score.half, r.score.count, r.tied) if r else (None,) * 5
        rows.append(
            (cell.method, *(cell.values.get(path) for path in axes), *numbers,
             seen.mean if seen else None, seen.verdict if seen else None, result.step_s,
             result.frozen, result.failed or None)
        )  # fmt: skip
    return head, tuple(rows)
