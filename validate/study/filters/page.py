"""Report of a filter study: sentence, figures, rankings, tables, its part of results.json."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from operator import itemgetter
from typing import Any

import numpy as np

from validate.compare.exhibit import Chart, Entry, Exhibit, Heat, NumberTable, Series
from validate.engine.cell import Record
from validate.parameters import describe
from validate.pipeline.experiment.options import Options, configure
from validate.report.stored.json_values import members
from validate.report.views.view_filling import Shown, chart, grouped, objects, table
from validate.study.filters.plan import METHODS, FilterCell
from validate.study.filters.ranking import NEAR, SAME_TIME, Ranked, Ranking
from validate.study.filters.score import (
    LOG_LOSS,
    NIS,
    WITHHELD,
    WORDS,
    FilterScores,
    Nested,
    interval,
    shown_unit,
    unit_text,
)
from validate.study.filters.study import FilterStudy
from validate.study.study_page import Findings
from validate.study.sweep import Axis, named, short


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
    scored: dict[str, Any] = {}
    if value:
        scores = {
            name: {"mean": i.mean, "half_95": i.half, "count": i.count, "unit": value.units[name]}
            for name, values in value.scores.items()
            for i in (interval(values),)
        }
        scored = {
            "scores": scores, **members(value, "step_s", "step_p99_s", "setup_s", "steps"),
            "gains_repeat_from_step": value.frozen, "seeds_together": value.shared,
        }  # fmt: skip
    return {
        "method": cell.method,
        "baseline": cell.baseline or None,
        "values": cell.values,
        "failed": record.why or None,
        "seconds": record.seconds,
        "scores": {},
        **scored,
    }


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


# --- Consistency and error over the swept axes of a filter study, as maps or curves.


def over_axes(study: FilterStudy) -> Iterator[Exhibit]:
    """Per method: NIS and error over its first two swept axes, or over the only one."""
    charts: list[Chart] = []
    heats: list[Heat] = []
    words: list[str] = []
    for method in study.plan.methods:
        prefix = f"{METHODS}{method}."
        swept = [a for a in study.plan.axes if len(a.values) > 1]
        axes = [a for a in swept if a.path.startswith(prefix)]
        axes += [a for a in swept if not a.path.startswith(METHODS)]
        if not axes:
            continue
        # Further axes are fixed at the method's best cell.
        ranked = [
            r
            for ranking in study.rankings
            for r in ranking.rows
            if r.cell.method == method and not r.cell.baseline
        ]
        best = min(ranked, key=lambda r: r.score.mean).cell.values if ranked else {}
        fixed = {a.path: best[a.path] for a in axes[2:]} if ranked else {}
        of_method = [c for c in study.plan.cells if c.method == method and not c.baseline]
        cells = [c for c in of_method if fixed.items() <= c.values.items()]
        if fixed:
            words.append(f"{method}: the other axes are fixed at {named(fixed)}, its best cell.")
        if len(axes) == 1:
            charts += _curves(study, method, axes[0], cells)
        else:
            heats += _heats(study, method, axes[0], axes[1], cells)
    if charts or heats:
        yield Exhibit(
            "axes", "Maps over the swept values",
            ("NIS per degree of freedom is 1 for a filter with a correct covariance. Above 1 "
             "the filter is over-confident, below 1 under-confident. Only measured components "
             "count.", *words),
            charts=tuple(charts), heats=tuple(heats),
        )  # fmt: skip


def _unit(study: FilterStudy) -> str:
    return shown_unit(study.unit)[1]


def _value(study: FilterStudy, cell: FilterCell, what: str) -> float | None:
    value = study.done.records[cell.key].value
    if value is None:
        return None
    if what == NIS:
        return value.consistency.mean if value.consistency else None
    if what not in value.scores:
        return None
    return shown_unit(value.units[what])[0] * float(np.mean(value.scores[what]))


def _heats(
    study: FilterStudy, method: str, x: Axis, y: Axis, cells: Sequence[FilterCell]
) -> Iterator[Heat]:
    for what, label, centre in (
        (NIS, "NIS per dof / 1", 1.0),
        (study.by, f"error / {_unit(study)}", None),
    ):
        at = {(c.values[x.path], c.values[y.path]): _value(study, c, what) for c in cells}
        values = np.array([[at.get((i, j)) for i in x.values] for j in y.values], dtype=float)
        if np.isfinite(values).any():
            name = "nis" if what == NIS else "error"
            yield Heat(
                f"{name}_{method}", f"{method}: {'NIS' if what == NIS else what} over "
                f"{short(x.path)} and {short(y.path)}", short(x.path), short(y.path),
                x.values, y.values, values, label, centre,
            )  # fmt: skip


def _curves(
    study: FilterStudy, method: str, axis: Axis, cells: Sequence[FilterCell]
) -> Iterator[Chart]:
    """Over an axis of numbers; other values have the ranking alone."""
    numbers = axis.numbers
    if numbers is None:
        return
    at = dict(zip(axis.values, numbers, strict=True))
    log = "x" if min(numbers) > 0 and max(numbers) >= 20 * min(numbers) else ""
    for what, label in ((NIS, "NIS per dof / 1"), (study.by, f"{study.by} / {_unit(study)}")):
        pairs = sorted(
            (at[c.values[axis.path]], value)
            for c in cells
            if (value := _value(study, c, what)) is not None
        )
        if len({y for _, y in pairs}) < 2:
            continue
        x, y = (np.array(column) for column in zip(*pairs, strict=True))
        scale = "xy" if log else "y"
        name = "nis" if what == NIS else "error"
        yield Chart(
            f"{name}_{method}", f"{method}: {name.upper() if name == 'nis' else what} over "
            f"{short(axis.path)}", axis.label, label, (Series(method, x, y),),
            (("consistent", 1.0),) if what == NIS else (),
            scale if y.min() > 0 else log,  # type: ignore[arg-type]
        )  # fmt: skip


# --- Nested choice of settings on other data of the recording, and agreement with the truth.

_OFTEN = 3  # settings named of a nested choice
_MOST = 60  # picks shown; cells.csv and results.json have all


def chosen_exhibits(study: FilterStudy) -> Iterator[Exhibit]:
    """Nested choices, and the ranking without truth beside the one with it."""
    unit = shown_unit(_chosen_exhibits_unit(study))[1]
    rows: list[tuple[Entry, ...]] = []
    for ranking in study.rankings:
        if (nested := ranking.nested) is None:
            continue
        condition, total = named(ranking.condition), sum(nested.chosen.values())
        often = sorted(nested.chosen.items(), key=lambda one: -one[1])[:_OFTEN]
        times = ", ".join(f"{setting} {count} of {total}" for setting, count in often)
        rows.append((condition, "the chosen setting", nested.error.mean, nested.error.half, times))
        rows += [(condition, name, e, None, None) for name, e in nested.beside.items()]
    if rows:
        head = ("condition", "what", f"error / {unit}", f"± 95 % / {unit}", "times chosen")
        title = "Setting chosen on some blocks and markers, error reported on the others"
        columns = {name: itemgetter(i) for i, name in enumerate(head)}
        yield Exhibit(
            "nested", "Error of the chosen setting on other data", tuple(_nested_words(study)),
            (table("nested", title, rows, columns),),
        )  # fmt: skip
    if picks := study.picks:
        near = sum(p.near for p in picks)
        heads: Mapping[str, Shown] = {
            "condition": lambda p: named(p.condition) or "recorded", "seed": "seed",
            "picked without truth": "cell.name", "settings": lambda p: named(p.cell.settings),
            "its true error / mm": "error", "best by truth": "best.name",
            "settings of it": lambda p: named(p.best.settings), "least true error / mm": "least",
            "ratio / 1": "ratio",
        }  # fmt: skip
        words = (
            f"Where the truth is known: the filter setting of least {WITHHELD} has a true error "
            f"within {100 * (NEAR - 1):.0f} % of the least in {near} of {len(picks)} recordings.",
        )
        shown = table("agreement", "The two rankings for each recording", picks[:_MOST], heads)
        yield Exhibit("agreement", "Ranking with and without truth", words, (shown,))


def _chosen_exhibits_unit(study: FilterStudy) -> str:
    first = next(r for ranking in study.rankings for r in ranking.rows)
    return study.unit if first.result.sums(study.by) is not None else "m"


def chosen_line(nested: Nested, study: FilterStudy) -> str:
    """What a choice on other blocks and markers is worth, in one line."""
    factor, shown = shown_unit(_chosen_exhibits_unit(study))
    unit = unit_text(shown)
    half = "" if nested.error.half is None else f" ± {factor * nested.error.half:.2g}"
    others = "other blocks and markers" if nested.split else "other blocks"
    beside = ", ".join(f"{name} {factor * e:.3g}" for name, e in nested.beside.items())
    return (
        f"chosen on {others}, reported on the rest: {factor * nested.error.mean:.4g}{half}{unit}"
        f"{f' ({beside})' if beside else ''}"
    )


def _nested_words(study: FilterStudy) -> Iterator[str]:
    yield (
        "The error of the best of many settings is too small on the data that chose it. Here "
        "each block of time is left out in turn. The setting of least error on the other "
        "blocks is chosen; its error on the left-out block is reported."
    )
    nested = next(r.nested for r in study.rankings if r.nested)
    if study.by == LOG_LOSS:
        yield (
            "The likelihood of all measured components is used to choose and to report, in "
            "different blocks."
        )
    else:
        yield (
            "One half of the markers is used to choose and the other to report; then the "
            "halves change places."
            if nested.split
            else "There is one marker to score: it is used to choose and to report, in "
            "different blocks."
        )
    for ranking in study.rankings:
        if ranking.nested and ranking.blocks and not ranking.blocks.sure:
            yield f"{ranking.blocks.words}."


# -------------------------------------------------------------------------------------------------

_SHOWN = 25  # places shown of one ranking; tables/cells.csv has them all
_SHOWN_OF_MANY = 8  # places of each where there are many conditions
_FULL = 12  # conditions whose rankings and charts are shown
_SAME_MODEL = (
    "Twin and methods share one model, so the setting that trusts the model most wins. That "
    "is no evidence for a different body. Change the twin with --set or sweep it, and find "
    "settings that stay good."
)
_PAIRS = (
    "All cells of a condition use the same seeds, and differences from the first place are "
    "paired by seed. 'Not distinguishable' means that their 95 % interval contains zero. "
    "Overlapping intervals may still differ in pairs. No correction is made for the number of "
    "cells: the best of many cells seems slightly better than it is."
)
_BLOCKS = (
    "± is half of Student's 95 % interval over blocks of time; differences from the first "
    "place are paired by block. A setting whose innovations are correlated for longer than a "
    "block has no interval. Measured samples contain noise, which is the same in every score."
)
_NIS = (
    "A filter whose NIS is outside its 95 % band has a wrong covariance: the interval that it "
    "claims is not used."
)
_NAMED = 3  # overlapping places that are named


def study_exhibits(study: FilterStudy) -> tuple[Exhibit, ...]:
    """Figures and tables: settings, intervals, times and consistency, in this order."""
    exhibits = [best_exhibit(study), _ranking_exhibit(study), *chosen_exhibits(study)]
    exhibits += [_pareto_exhibit(study), *over_axes(study)]
    failed = [pair for ranking in study.rankings for pair in ranking.failed]
    if failed:
        columns: Mapping[str, Shown] = {
            "method": lambda pair: pair[0].name, "settings": lambda pair: named(pair[0].settings),
            "condition": lambda pair: named(pair[0].condition), "why": lambda pair: pair[1],
        }  # fmt: skip
        title = f"{len(failed)} of {len(study.plan.cells)} cells failed"
        listed = table("failed", title, failed[:200], columns)
        exhibits.append(Exhibit("failed", "Cells that failed", (), (listed,)))
    return tuple(exhibits)


def ranking_table(
    study: FilterStudy, ranking: Ranking, name: str, most: int | None = None
) -> NumberTable:
    """Return the first `most` places: cell, score with interval, ties, consistency, time of a
    step."""
    unit, shown = shown_unit(study.unit)[1], ranking.rows[:most]
    columns: Mapping[str, Shown] = {
        "place": "place", "method": "cell.name", "settings": _settings,
        f"error / {unit}": "score.mean", f"± 95 % / {unit}": "score.half",
        "interval overlaps": _overlapping,
        f"difference from #1 / {unit}": lambda r: r.from_best.mean if r.place > 1 else None,
        f"± 95 % / {unit} (paired)": lambda r: r.from_best.half if r.place > 1 else None,
        "against #1": against_first, "NIS per dof / 1": "result.consistency.mean",
        "filter is": consistency_words, "innovation lag 1 / 1": "result.innovations.lag_1",
        "step p50 / ms": "result.step_s", "step p99 / ms": "result.step_p99_s",
        "gains repeat from step": "result.frozen", "Pareto": _front,
    }  # fmt: skip
    title = f"Ranking{_under(ranking)}: the first {len(shown)} of {len(ranking.rows)} places"
    return table(name, title, shown, columns)


def _settings(r: Ranked) -> str:
    return named(r.cell.settings)


def consistency_words(r: Ranked) -> str | None:
    """Consistency of a filter by NIS, and whether the interval that it claims is used."""
    consistency = r.result.consistency
    if consistency is None:
        return None
    if consistency.band_95.holds(consistency.mean):
        return "consistent"
    return f"{consistency.verdict}: interval not used"


def _front(r: Ranked) -> str:
    if r.result.step_s is None:
        return "not timed"
    return "front" if r.dominated_by is None else f"#{r.dominated_by} beats"


def best_exhibit(study: FilterStudy) -> Exhibit:
    """Return the best settings as commands, with those that are not distinguishable from them."""
    words = []
    factor, shown = shown_unit(study.unit)
    for best in study.best:
        r = best.ranked
        unit = unit_text(shown)
        half = f" ± {factor * r.score.half:.3g}" if r.score.half is not None else ""
        when = f" with {named(r.cell.condition)}" if r.cell.condition else ""
        doubts = f"; {best.doubts}" if best.doubts else ""
        words.append(
            f"Best{when}: {r.cell.method} ({named(r.cell.settings)}), "
            f"{study.by} {factor * r.score.mean:.4g}{half}{unit} over {over(study)}{doubts}."
        )
    columns: Mapping[str, Shown] = {
        "condition": lambda best: named(best.ranked.cell.condition), "command": "line",
    }  # fmt: skip
    lines = table("best", "The best settings as commands", study.best, columns)
    return Exhibit("best", "Best settings", tuple(words), (lines,))


def _ranking_exhibit(study: FilterStudy) -> Exhibit:
    most = _SHOWN if len(study.rankings) == 1 else _SHOWN_OF_MANY
    tables = tuple(
        ranking_table(study, r, f"ranking_{i}", most)
        for i, r in enumerate(study.rankings[:_FULL], start=1)
    )
    return Exhibit("ranking", "Ranking", tuple(_ranking_words(study)), tables)


def _ranking_words(study: FilterStudy) -> Iterator[str]:
    seeds = len(study.plan.seeds)
    meaning = WORDS.get(study.by, "root mean square")
    if seeds > 1:
        yield (
            f"Ranked by the mean of {study.by} over {seeds_text(seeds)} of the noise; ± is half of "
            f"Student's 95 % interval of that mean, taken over the seeds. {study.by}: {meaning}."
        )
        yield _PAIRS
    else:
        yield f"Ranked by {study.by}: {meaning}."
        for ranking in study.rankings[:_FULL]:
            if ranking.blocks is not None:
                yield f"{_under(ranking).strip() or 'The recording'}: {ranking.blocks.words}."
        yield _BLOCKS
    if study.plan.single_words:
        yield study.plan.single_words
    yield _NIS
    yield (
        "Times are the median and the 99 % quantile of one step. The workers of the study run "
        "in parallel with one thread each."
    )
    if study.plan.experiment.same_model:
        yield _SAME_MODEL


def over(study: FilterStudy) -> str:
    """Return the samples that a score is taken over, in words."""
    seeds, blocks = len(study.plan.seeds), study.rankings[0].blocks
    if seeds > 1:
        return seeds_text(seeds)
    if blocks is None:
        return "one recording"
    return (
        f"one recording in {blocks.count} blocks" if blocks.sure else "one recording, no interval"
    )


def seeds_text(count: int) -> str:
    return "1 seed" if count == 1 else f"{count} seeds"


def _overlapping(r: Ranked) -> str:
    if r.score.half is None:
        return "no interval"
    if not r.overlaps:
        return "none"
    shown = ", ".join(f"#{p}" for p in r.overlaps[:_NAMED])
    more = len(r.overlaps) - _NAMED
    return shown if more <= 0 else f"{shown} and {more} more"


def against_first(r: Ranked) -> str:
    if r.place == 1:
        return "best"
    if r.from_best.half is None:
        return "no interval"
    return "not distinguishable" if r.tied else "worse"


def _under(ranking: Ranking) -> str:
    return f" with {named(ranking.condition)}" if ranking.condition else ""


# --- error against time --------------------------------------------------------------------------


def _pareto_exhibit(study: FilterStudy) -> Exhibit:
    shown, unit = study.rankings[:_FULL], shown_unit(study.unit)[1]
    charts = tuple(_pareto_chart(study, r, i) for i, r in enumerate(shown, start=1) if r.rows)
    columns: Mapping[str, Shown] = {
        "place": "place", "method": "cell.name", "settings": _settings,
        "step p50 / ms": "result.step_s", "step p99 / ms": "result.step_p99_s",
        f"error / {unit}": "score.mean", f"± 95 % / {unit}": "score.half",
    }  # fmt: skip
    title = "fastest first: no cell has both less error and less time"
    tables = tuple(
        table(f"pareto_{i}", f"Pareto front{_under(r)}, {title}", r.front, columns)
        for i, r in enumerate(shown, start=1)
    )
    words = []  # a sentence naming the methods that are nowhere on the front
    for ranking in shown:
        methods = dict.fromkeys(r.cell.name for r in ranking.rows)
        front = {r.cell.name for r in ranking.front}
        if beaten := [m for m in methods if m not in front]:
            words.append(
                f"Dominated{_under(ranking)}, at every setting tried: {', '.join(beaten)}. Times "
                f"within a factor of {SAME_TIME:g} count as equal, because step times are noisy."
            )
    return Exhibit("pareto", "Error against time per step", tuple(words), tables, charts)


def _pareto_chart(study: FilterStudy, ranking: Ranking, i: int) -> Chart:
    signed = study.by == LOG_LOSS  # may be negative
    rows = [r for r in ranking.rows if r.result.step_s and (signed or r.score.mean > 0)]
    exact = 0 if signed else sum(r.score.mean <= 0 for r in ranking.rows)
    none = f" Not drawn: {exact} without any error." if exact else ""
    future = sum(r.result.step_s is None for r in ranking.rows)
    none += f" Not drawn: {future} without times (smoothed, or solved whole)." if future else ""
    return chart(
        f"pareto_{i}", f"Error against time per step{_under(ranking)}",
        ("time of one step / ms", "result.step_s"),
        (f"{study.by} / {shown_unit(study.unit)[1]}", "score.mean"),
        points=grouped(rows, "cell.name"),
        lines={"Pareto front": [r for r in ranking.front if r in rows]},
        log="x" if signed else "xy",
        caption=f"A point is one cell: a method with one set of values.{none}",
    )  # fmt: skip
