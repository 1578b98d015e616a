"""Figures and tables of a filter study: best settings, rankings, Pareto front, NIS maps."""

from collections.abc import Iterator, Sequence

import numpy as np

from validate.compare.exhibit import Chart, Entry, Exhibit, NumberTable, Series
from validate.study.chosen_exhibits import chosen_exhibits
from validate.study.filter_maps import over_axes
from validate.study.filters import FilterStudy
from validate.study.ranking import SAME_TIME, Ranked, Ranking
from validate.study.score import LOG_LOSS, WORDS
from validate.study.score_units import shown_unit, unit_text
from validate.study.sweep import named

_MS = 1e3
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
    failed = _failed_exhibit(study)
    return (*exhibits, *((failed,) if failed else ()))


def ranking_row(r: Ranked, by: str) -> tuple[Entry, ...]:
    """One place: its cell, score with interval, ties, consistency and time of a step."""
    result, (factor, _) = r.result, shown_unit(r.result.units[by])
    consistency, innovations = result.consistency, result.innovations
    half, difference = r.score.half, r.from_best
    return (
        r.place,
        r.cell.name,
        named(r.cell.settings),
        factor * r.score.mean,
        None if half is None else factor * half,
        _overlapping(r),
        factor * difference.mean if r.place > 1 else None,
        factor * difference.half if r.place > 1 and difference.half is not None else None,
        _tied(r),
        consistency.mean if consistency else None,
        _consistent(r),
        innovations.lag_1 if innovations else None,
        None if result.step_s is None else _MS * result.step_s,
        None if result.step_p99_s is None else _MS * result.step_p99_s,
        result.frozen,
        _front(r),
    )


def _consistent(r: Ranked) -> str | None:
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


def ranking_head(unit: str) -> tuple[str, ...]:
    """Columns of a ranking by a score in `unit` (SI)."""
    shown = shown_unit(unit)[1]
    return (
        "place", "method", "settings", f"error / {shown}", f"± 95 % / {shown}",
        "interval overlaps", f"difference from #1 / {shown}", f"± 95 % / {shown} (paired)",
        "against #1", "NIS per dof / 1", "filter is", "innovation lag 1 / 1", "step p50 / ms",
        "step p99 / ms", "gains repeat from step", "Pareto",
    )  # fmt: skip


def best_exhibit(study: FilterStudy) -> Exhibit:
    """The best settings as commands, with those that are not distinguishable from them."""
    words, rows = [], []
    for best in study.best:
        r = best.ranked
        factor, shown = shown_unit(study.unit)
        unit = unit_text(shown)
        half = f" ± {factor * r.score.half:.3g}" if r.score.half is not None else ""
        when = f" with {named(r.cell.condition)}" if r.cell.condition else ""
        doubts = f"; {best.doubts}" if best.doubts else ""
        words.append(
            f"Best{when}: {r.cell.method} ({named(r.cell.settings)}), "
            f"{study.by} {factor * r.score.mean:.4g}{half}{unit} over {over(study)}{doubts}."
        )
        rows.append((named(r.cell.condition), best.line))
    head = ("condition", "command")
    table = NumberTable("best", "The best settings as commands", head, tuple(rows))
    return Exhibit("best", "Best settings", tuple(words), tables=(table,))


def _ranking_exhibit(study: FilterStudy) -> Exhibit:
    most = _SHOWN if len(study.rankings) == 1 else _SHOWN_OF_MANY
    tables = tuple(
        NumberTable(
            f"ranking_{i}",
            f"Ranking{_under(r)}: the first {min(most, len(r.rows))} of {len(r.rows)} places",
            ranking_head(study.unit),
            tuple(ranking_row(row, study.by) for row in r.rows[:most]),
        )
        for i, r in enumerate(study.rankings[:_FULL], start=1)
    )
    return Exhibit("ranking", "Ranking", tuple(_ranking_words(study)), tables=tables)


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
    """What a score is taken over."""
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


def _tied(r: Ranked) -> str:
    if r.place == 1:
        return "best"
    if r.from_best.half is None:
        return "no interval"
    return "not distinguishable" if r.tied else "worse"


def _under(ranking: Ranking) -> str:
    return f" with {named(ranking.condition)}" if ranking.condition else ""


# --- error against time --------------------------------------------------------------------------


def _pareto_exhibit(study: FilterStudy) -> Exhibit:
    shown, (factor, unit) = study.rankings[:_FULL], shown_unit(study.unit)
    charts = tuple(_pareto_chart(study, r, i) for i, r in enumerate(shown, start=1) if r.rows)
    tables = tuple(
        NumberTable(
            f"pareto_{i}",
            f"Pareto front{_under(r)}, fastest first: no cell has both less error and less time",
            (
                "place",
                "method",
                "settings",
                "step p50 / ms",
                "step p99 / ms",
                f"error / {unit}",
                f"± 95 % / {unit}",
            ),
            tuple(_front_row(row, factor) for row in r.front),
        )
        for i, r in enumerate(shown, start=1)
    )
    words = tuple(s for r in shown for s in _dominated(r))
    return Exhibit("pareto", "Error against time per step", words, tables=tables, charts=charts)


def _front_row(r: Ranked, factor: float) -> tuple[Entry, ...]:
    half = None if r.score.half is None else factor * r.score.half
    times = (r.result.step_s, r.result.step_p99_s)
    steps = (None if s is None else _MS * s for s in times)
    return (r.place, r.cell.name, named(r.cell.settings), *steps, factor * r.score.mean, half)


def _dominated(ranking: Ranking) -> Iterator[str]:
    """One sentence naming the methods that are nowhere on the front."""
    methods = dict.fromkeys(r.cell.name for r in ranking.rows)
    front = {r.cell.name for r in ranking.front}
    beaten = [m for m in methods if m not in front]
    if beaten:
        yield (
            f"Dominated{_under(ranking)}, at every setting tried: {', '.join(beaten)}. Times "
            f"within a factor of {SAME_TIME:g} count as equal, because step times are noisy."
        )


def _pareto_chart(study: FilterStudy, ranking: Ranking, i: int) -> Chart:
    signed = study.by == LOG_LOSS  # may be negative
    rows = [r for r in ranking.rows if r.result.step_s and (signed or r.score.mean > 0)]
    exact = 0 if signed else sum(r.score.mean <= 0 for r in ranking.rows)
    none = f" Not drawn: {exact} without any error." if exact else ""
    future = sum(r.result.step_s is None for r in ranking.rows)
    none += f" Not drawn: {future} without times (smoothed, or solved whole)." if future else ""
    factor, unit = shown_unit(study.unit)
    series = []
    for method in dict.fromkeys(r.cell.name for r in rows):
        of_method = [r for r in rows if r.cell.name == method]
        x, y = _points(of_method, factor)
        series.append(Series(method, x, y, "points"))
    x, y = _points([r for r in ranking.front if r in rows], factor)
    series.append(Series("Pareto front", x, y))
    return Chart(
        f"pareto_{i}",
        f"Error against time per step{_under(ranking)}",
        "time of one step / ms",
        f"{study.by} / {unit}",
        tuple(series),
        log="x" if signed else "xy",
        caption=f"A point is one cell: a method with one set of values.{none}",
    )


def _points(rows: Sequence[Ranked], factor: float) -> tuple[np.ndarray, np.ndarray]:
    x = np.array([_MS * (r.result.step_s or 0.0) for r in rows])
    return x, np.array([factor * r.score.mean for r in rows])


# --- failures ------------------------------------------------------------------------------------


def _failed_exhibit(study: FilterStudy) -> Exhibit | None:
    rows = [
        (c.name, named(c.settings), named(c.condition), why)
        for ranking in study.rankings
        for c, why in ranking.failed
    ]
    if not rows:
        return None
    head = ("method", "settings", "condition", "why")
    title = f"{len(rows)} of {len(study.plan.cells)} cells failed"
    table = NumberTable("failed", title, head, tuple(rows[:200]))
    return Exhibit("failed", "Cells that failed", tables=(table,))
