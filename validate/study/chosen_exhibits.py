"""Nested choice of settings on other data of the recording, and agreement with the truth."""

from collections.abc import Iterator, Mapping

from validate.compare.exhibit import Entry, Exhibit, NumberTable
from validate.study.agreement import NEAR, TruthPick
from validate.study.blocks import Nested
from validate.study.filters import FilterStudy
from validate.study.ranking import Ranking
from validate.study.score import LOG_LOSS, WITHHELD
from validate.study.score_units import shown_unit, unit_text
from validate.study.sweep import named

_MM = 1e3
_MOST = 60  # picks shown; cells.csv and results.json have all


def chosen_exhibits(study: FilterStudy) -> Iterator[Exhibit]:
    """Nested choices, and the ranking without truth beside the one with it."""
    rows = [row for r in study.rankings if r.nested for row in _nested_rows(r, study)]
    if rows:
        unit = shown_unit(_unit(study))[1]
        table = NumberTable(
            "nested",
            "Setting chosen on some blocks and markers, error reported on the others",
            ("condition", "what", f"error / {unit}", f"± 95 % / {unit}", "times chosen"),
            tuple(rows),
        )
        yield Exhibit(
            "nested",
            "Error of the chosen setting on other data",
            tuple(_nested_words(study)),
            (table,),
        )
    if picks := study.picks:
        yield _agreement(picks)


def _unit(study: FilterStudy) -> str:
    first = next(r for ranking in study.rankings for r in ranking.rows)
    return study.unit if first.result.sums(study.by) is not None else "m"


def _nested_rows(ranking: Ranking, study: FilterStudy) -> list[tuple[Entry, ...]]:
    nested, condition = ranking.nested, named(ranking.condition)
    assert nested is not None
    factor, _ = shown_unit(_unit(study))
    half = None if nested.error.half is None else factor * nested.error.half
    total = sum(nested.chosen.values())
    often = ", ".join(f"{n} {k} of {total}" for n, k in _by_count(nested.chosen))
    rows: list[tuple[Entry, ...]] = [
        (condition, "the chosen setting", factor * nested.error.mean, half, often)
    ]
    return rows + [(condition, name, factor * e, None, None) for name, e in nested.beside.items()]


def _by_count(chosen: Mapping[str, int]) -> list[tuple[str, int]]:
    return sorted(chosen.items(), key=lambda one: -one[1])[:3]


def chosen_line(nested: Nested, study: FilterStudy) -> str:
    """What a choice on other blocks and markers is worth, in one line."""
    factor, shown = shown_unit(_unit(study))
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


def _agreement(picks: tuple[TruthPick, ...]) -> Exhibit:
    near = sum(p.near for p in picks)
    rows = tuple(
        (
            named(p.condition) or "recorded", p.seed, p.cell.name, named(p.cell.settings),
            _MM * p.error, p.best.name, named(p.best.settings), _MM * p.least, p.ratio,
        )
        for p in picks[:_MOST]
    )  # fmt: skip
    head = ("condition", "seed", "picked without truth", "settings", "its true error / mm",
            "best by truth", "settings of it", "least true error / mm", "ratio / 1")  # fmt: skip
    words = (
        f"Where the truth is known: the filter setting of least {WITHHELD} has a true error within "
        f"{100 * (NEAR - 1):.0f} % of the least in {near} of {len(picks)} recordings.",
    )
    table = NumberTable("agreement", "The two rankings for each recording", head, rows)
    return Exhibit("agreement", "Ranking with and without truth", words, (table,))
