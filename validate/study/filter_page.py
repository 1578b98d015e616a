"""Report of a filter study: its sentence, its part of results.json and its table of cells."""

from typing import Any

from validate.parameters import describe
from validate.replay.options import Options, configure
from validate.study.filter_exhibits import over, study_exhibits
from validate.study.filter_plan import FilterCell
from validate.study.filters import FilterStudy
from validate.study.interval import interval
from validate.study.score import FilterScores
from validate.study.score_units import shown_unit, unit_text
from validate.study.store import Record
from validate.study.study_page import CellsTable, Findings, Row


def findings(study: FilterStudy) -> Findings:
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
    """Cells that ran, the best filter and its doubts, in one sentence."""
    cells, best = len(study.plan.cells), study.best[0]
    doubts = f" ({best.doubts})" if best.doubts else ""
    more = f" (first of {len(study.rankings)} conditions)" if len(study.rankings) > 1 else ""
    failed = f", {study.failed} failed" if study.failed else ""
    half, (factor, shown) = best.ranked.score.half, shown_unit(study.unit)
    unit = unit_text(shown)
    spread = "" if half is None else f" ± {factor * half:.2g}"
    near = sum(p.near for p in study.picks)
    truth = (
        f" Chosen without truth, the setting is within 10 % of the best in {near} of "
        f"{len(study.picks)} recordings."
        if study.picks
        else ""
    )
    return (
        f"{cells} cells over {over(study)}{failed}; best filter by {study.by}{more}: "
        f"{best.ranked.cell.method}, {factor * best.ranked.score.mean:.4g}{spread}{unit}{doubts}."
        f"{truth}"
    )


def document(study: FilterStudy) -> dict[str, Any]:
    """The part of results.json that the study adds: SI, finite numbers."""
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
        "blocks": [
            None
            if r.blocks is None
            else {
                "count": r.blocks.count,
                "length_s": r.blocks.length_s,
                "correlation_s": r.blocks.correlation_s,
                "interval": r.blocks.sure,
            }
            for r in study.rankings
        ],
        "nested": [
            None
            if r.nested is None
            else {
                "error": r.nested.error.mean,
                "half_95": r.nested.error.half,
                "chosen": dict(r.nested.chosen),
                "beside": dict(r.nested.beside),
                "other_markers": r.nested.split,
            }
            for r in study.rankings
        ],
        "without_truth": [
            {
                "condition": dict(p.condition),
                "seed": p.seed,
                "picked": p.cell.label,
                "true_error_m": p.error,
                "least_true_error_m": p.least,
                "within_10_percent": p.near,
            }
            for p in study.picks
        ],
        "cells": [_cell(c, done.records[c.key]) for c in study.plan.cells],
    }


def _cell(cell: FilterCell, record: Record[FilterScores]) -> dict[str, Any]:
    value = record.value
    return {
        "method": cell.method,
        "baseline": cell.baseline or None,
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
        "step_p99_s": value.step_p99_s,
        "setup_s": value.setup_s,
        "steps": value.steps,
        "gains_repeat_from_step": value.frozen,
        "seeds_together": value.shared,
    }


def cells_table(study: FilterStudy) -> CellsTable:
    """Every cell, SI; place is by condition."""
    axes = [a.path for a in study.plan.axes]
    unit = study.unit
    head = ("method", *axes, "place", f"{study.by}_{unit}", f"half_95_{unit}", "samples",
            "tied_with_first", "nis_per_dof", "verdict", "step_p50_s", "step_p99_s",
            "gains_repeat_from_step", "failed")  # fmt: skip
    place = {r.cell.key: r for ranking in study.rankings for r in ranking.rows}
    rows: list[Row] = []
    for cell in study.plan.cells:
        what = (cell.name, *(cell.values.get(path) for path in axes))
        if (r := place.get(cell.key)) is None:
            rows.append((*what, *(None,) * 10, study.done.records[cell.key].why))
            continue
        score, consistency = r.score, r.result.consistency
        rows.append(
            (*what, r.place, score.mean, score.half, score.count,
             None if r.from_best.half is None else r.tied,
             consistency.mean if consistency else None,
             consistency.verdict if consistency else None, r.result.step_s,
             r.result.step_p99_s, r.result.frozen, None)
        )  # fmt: skip
    return head, tuple(rows)
