"""Report of a filter study: its sentence, its part of results.json and its table of cells."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from validate.compare.exhibit import NumberTable
from validate.engine.cell import Record
from validate.parameters import describe
from validate.pipeline.experiment.options import Options, configure
from validate.report.stored.json_values import members
from validate.report.views.records import Shown, objects, table
from validate.study.filters.exhibits import over, study_exhibits
from validate.study.filters.plan import FilterCell
from validate.study.filters.ranking import Ranked
from validate.study.filters.score import FilterScores, interval, shown_unit, unit_text
from validate.study.filters.study import FilterStudy
from validate.study.study_page import Findings


def findings(study: FilterStudy) -> Findings:
    """Return the study with the parameters and methods that it began with."""
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
    """Return the part of results.json that the study adds: SI, finite numbers."""
    done = study.done
    return {
        "kind": "filters",
        "by": study.by,
        "seeds": list(study.plan.seeds),
        "axes": [{"path": a.path, "values": list(a.values)} for a in study.plan.axes],
        **members(done, "reused", "seconds", "workers"),
        "best": objects(study.best, {
            "condition": lambda b: dict(b.ranked.cell.condition), "command": "line",
            "ties": "ties", "at_end_of_sweep": lambda b: list(b.edges),
        }),
        "blocks": objects((r.blocks for r in study.rankings), {
            "count": "count", "length_s": "length_s", "correlation_s": "correlation_s",
            "interval": "sure",
        }),
        "nested": objects((r.nested for r in study.rankings), {
            "error": "error.mean", "half_95": "error.half", "chosen": lambda n: dict(n.chosen),
            "beside": lambda n: dict(n.beside), "other_markers": "split",
        }),
        "without_truth": objects(study.picks, {
            "condition": lambda p: dict(p.condition), "seed": "seed", "picked": "cell.label",
            "true_error_m": "error", "least_true_error_m": "least", "within_10_percent": "near",
        }),
        "cells": [_cell(c, done.records[c.key]) for c in study.plan.cells],
    }  # fmt: skip


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
        "scores": scores, **members(value, "step_s", "step_p99_s", "setup_s", "steps"),
        "gains_repeat_from_step": value.frozen, "seeds_together": value.shared,
    }  # fmt: skip


def cells_table(study: FilterStudy) -> NumberTable:
    unit = study.unit
    placed = {r.cell.key: r for ranking in study.rankings for r in ranking.rows}
    rows = [_CellRow(c, placed.get(c.key), study.done.records[c.key].why) for c in study.plan.cells]
    columns: Mapping[str, Shown] = {
        "method": "cell.name", **{a.path: partial(_setting, a.path) for a in study.plan.axes},
        "place": "ranked.place", f"{study.by}_{unit}": "ranked.score.mean",
        f"half_95_{unit}": "ranked.score.half", "samples": "ranked.score.count",
        "tied_with_first": "tied", "nis_per_dof": "ranked.result.consistency.mean",
        "verdict": "ranked.result.consistency.verdict", "step_p50_s": "ranked.result.step_s",
        "step_p99_s": "ranked.result.step_p99_s",
        "gains_repeat_from_step": "ranked.result.frozen", "failed": "failed",
    }  # fmt: skip
    return table("cells", "Every cell, SI; place is by condition.", rows, columns)


@dataclass(frozen=True)
class _CellRow:
    """A cell with its place in a ranking, or why it has none."""

    cell: FilterCell
    ranked: Ranked | None
    why: str

    @property
    def tied(self) -> bool | None:
        r = self.ranked
        return None if r is None or r.from_best.half is None else r.tied

    @property
    def failed(self) -> str | None:
        return None if self.ranked else self.why


def _setting(path: str, row: _CellRow) -> str | None:
    return row.cell.values.get(path)
