"""What a filter study tells: its sentence, its part of results.json and its table of cells."""

from typing import Any

from validate.parameters import describe
from validate.replay.options import Options, configure
from validate.study.filter_exhibits import seeds_text, study_exhibits
from validate.study.filter_plan import FilterCell
from validate.study.filters import FilterStudy
from validate.study.interval import interval
from validate.study.score import FilterScores
from validate.study.store import Record
from validate.study.study_page import CellsTable, Findings, Row


def told(study: FilterStudy) -> Findings:
    """The study with the parameters and methods that it began with."""
    experiment, job = study.plan.experiment, study.plan.job
    options = Options(dict(job.values), study.plan.methods, job.quick)
    parameters, methods = configure(experiment, options)
    return Findings(
        f"Filter study: {experiment.title}", sentence(study), study_exhibits(study),
        document(study), cells_table(study), job.quick,
        describe(parameters) + describe(methods, "methods."), seed=study.plan.seeds[0],
    )  # fmt: skip


def sentence(study: FilterStudy) -> str:
    """What ran and what won, in one sentence."""
    cells, best = len(study.plan.cells), study.best[0]
    doubts = f" ({best.doubts})" if best.doubts else ""
    more = f" (first of {len(study.rankings)} conditions)" if len(study.rankings) > 1 else ""
    failed = f", {study.failed} failed" if study.failed else ""
    half = best.ranked.score.half
    spread = "" if half is None else f" ± {1e3 * half:.2g}"
    seeds = seeds_text(len(study.plan.seeds))
    return (
        f"{cells} cells over {seeds}{failed}; best by {study.by}{more}: "
        f"{best.ranked.cell.method}, {1e3 * best.ranked.score.mean:.4g}{spread} mm{doubts}."
    )


def document(study: FilterStudy) -> dict[str, Any]:
    """The study's own part of results.json: SI, nothing that is not finite."""
    done = study.done
    return {
        "kind": "filters",
        "by": study.by,
        "seeds": list(study.plan.seeds),
        "axes": [{"path": a.path, "values": list(a.values)} for a in study.plan.axes],
        "reused": done.reused,
        "seconds": done.seconds,
        "workers": done.workers,
        "best": [
            {
                "condition": dict(b.ranked.cell.condition),
                "command": b.line,
                "ties": b.ties,
                "at_end_of_sweep": list(b.edges),
            }
            for b in study.best
        ],
        "cells": [_cell(c, done.records[c.key]) for c in study.plan.cells],
    }


def _cell(cell: FilterCell, record: Record[FilterScores]) -> dict[str, Any]:
    value = record.value
    return {
        "method": cell.method,
        "values": cell.values,
        "failed": record.why or None,
        "seconds": record.seconds,
        "scores": {},
        **(_numbers(value) if value else {}),
    }


def _numbers(value: FilterScores) -> dict[str, Any]:
    scores = {
        name: {"mean": i.mean, "half_95": i.half, "count": i.count, "unit": value.units[name]}
        for name, values in value.scores.items()
        for i in (interval(values),)
    }
    return {
        "scores": scores,
        "step_s": value.step_s,
        "setup_s": value.setup_s,
        "steps": value.steps,
        "gains_repeat_from_step": value.frozen,
        "seeds_together": value.shared,
    }


def cells_table(study: FilterStudy) -> CellsTable:
    """Every cell, SI; place is by condition."""
    axes = [a.path for a in study.plan.axes]
    head = ("method", *axes, "place", f"{study.by}_m", "half_95_m", "seeds", "tied_with_first",
            "nis_per_dof", "verdict", "step_s", "gains_repeat_from_step", "failed")  # fmt: skip
    place = {r.cell.key: r for ranking in study.rankings for r in ranking.rows}
    rows: list[Row] = []
    for cell in study.plan.cells:
        what = (cell.method, *(cell.values.get(path) for path in axes))
        if (r := place.get(cell.key)) is None:
            rows.append((*what, *(None,) * 9, study.done.records[cell.key].why))
            continue
        score, seen = r.score, r.result.consistency
        rows.append(
            (*what, r.place, score.mean, score.half, score.count, r.tied,
             seen.mean if seen else None, seen.verdict if seen else None, r.result.step_s,
             r.result.frozen, None)
        )  # fmt: skip
    return head, tuple(rows)
