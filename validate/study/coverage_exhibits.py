"""What a coverage study shows: shares with intervals, terms of u_val against draws, power."""

from collections.abc import Iterator, Mapping

import numpy as np

from validate.compare.coverage import FALSE_ACCEPTANCE, LEAST, MOST, Share
from validate.compare.exhibit import Chart, Emphasis, Entry, Exhibit, NumberTable, Series, TableCell
from validate.study.coverage import Coverage
from validate.study.coverage_found import Power, Quantity
from validate.study.coverage_plan import CHECKS, WRONG

_BANDS = (("2 %", 100 * LEAST), ("7 %", 100 * MOST))
_WORDS: Mapping[str, Emphasis] = {
    "holds": "good",
    "blunt": "open",
    "too narrow": "bad",
    "too wide": "open",
    "no answer": "open",
}
HEAD = (
    "method", "check", "differs / %", "95 % interval / %", "undecided / %", "not good enough / %",
    "good enough at the limit / %", "not good enough at the limit / %", "finding",
)  # fmt: skip


def coverage_exhibits(study: Coverage) -> tuple[Exhibit, ...]:
    """Does it hold, which term is at fault, and what would be noticed."""
    return (_shares(study), _terms(study), *((_power(study),) if study.power else ()))


def share_row(q: Quantity) -> tuple[str, ...]:
    """A check's row as text."""
    false = (q.undecided, q.rejected, q.false_good, q.false_bad)
    return (q.method, q.stated.name, percent(q.share), interval(q.share),
            *("-" if s is None else percent(s) for s in false), q.finding.word)  # fmt: skip


def percent(share: Share) -> str:
    return f"{100 * share.value:.1f}"


def interval(share: Share) -> str:
    return f"{100 * share.low:.1f} to {100 * share.high:.1f}"


def _shares(study: Coverage) -> Exhibit:
    rows: list[tuple[Entry | TableCell, ...]] = [
        (q.method, q.stated.name, TableCell(100 * q.share.value, text=percent(q.share)),
         interval(q.share), *map(_cell, (q.undecided, q.rejected, q.false_good, q.false_bad)),
         TableCell(q.spread, q.stated.unit), TableCell(q.u_val, q.stated.unit),
         TableCell(q.finding.word, emphasis=_WORDS.get(q.finding.word, "")), q.finding.words)
        for q in study.quantities
    ]  # fmt: skip
    rows += [
        (t.method, f"all {t.checks} together (Holm)",
         TableCell(100 * t.share.value, text=percent(t.share)), interval(t.share),
         None, None, None, None, None, None,
         TableCell("holds" if t.holds else "too narrow", emphasis="good" if t.holds else "bad"),
         "at most 7 %: the correction keeps it below its level")
        for t in study.together
    ]  # fmt: skip
    head = (*HEAD[:-1], "rms of E", "u_val", "finding", "which term")
    table = NumberTable("coverage", "How often a perfect model differs", head, tuple(rows),
                        "At the limit: models whose error is the limit; at most 5 % may be called "
                        "either. No rms and no u_val of all checks together: no common unit.",
                        below="which term")  # fmt: skip
    return Exhibit("coverage", "A perfect model under our own verdicts", tuple(_told(study)),
                   (table,))  # fmt: skip


def _cell(share: Share | None) -> TableCell:
    return TableCell(None) if share is None else TableCell(
        100 * share.value, text=percent(share),
        emphasis="bad" if share.value > FALSE_ACCEPTANCE else "",
    )  # fmt: skip


def _told(study: Coverage) -> Iterator[str]:
    yield (
        f"{study.draws} recordings were drawn in which the judged model itself is the truth: its "
        "inputs uniform within their declared ranges, what was identified by its normal "
        "covariance, noise, registration and clocks as declared, read where and when the real "
        "recording was. Each was judged as a recording is. E normal "
        "with u_val differs in 4.6 %; 2 to 7 % holds. More is too narrow: false alarms. Fewer is "
        "too wide where a term claims more than it should, and blunt where none does: a uniform "
        "range by itself never reaches 2 u, and a model judged by itself shows nothing of its own "
        "mesh. A blunt check raises no false alarm and notices less."
    )
    if study.noise != 1:
        yield f"The noise drawn is {study.noise:g} times the declared one."
    if any(q.off is not None for q in study.quantities):
        yield (
            "Inputs act linearly here, by straight lines through one standard uncertainty to both "
            f"sides: a solution a draw would take too long. {CHECKS} draws were solved whole; the "
            "table of terms says how far the lines lay off."
        )
    yield from study.notes
    if study.still:
        yield f"Moves nothing that is judged: {', '.join(study.still)}."


def _terms(study: Coverage) -> Exhibit:
    rows = tuple(row for q in study.quantities for row in _term_rows(q))
    head = ("method", "check", "term", "claimed", "shown", "shown over claimed / 1", "rms of E",
            "line off by")  # fmt: skip
    words = (
        "Claimed: the term's part of u_val. Shown: half of the |E| that 4.6 % of the draws exceed "
        "when only this term is drawn, which for a normal law is its standard deviation; a uniform "
        "range shows .83. The judged model has its own mesh, so nothing of u_num is ever shown.",
    )
    table = NumberTable("terms", "Terms of u_val against the draws", head, rows,
                        "No ratio: nothing is claimed. No line: solved whole, or no input.",
                        folded=len(rows) > 20)  # fmt: skip
    return Exhibit("terms", "Which term is too wide or too narrow", words, (table,))


def _term_rows(q: Quantity) -> Iterator[tuple[float | str | TableCell | None, ...]]:
    unit = q.stated.unit
    for t in q.terms:
        off = TableCell(q.off if t.name.startswith("u_input") else None, unit)
        yield (q.method, q.stated.name, t.name, TableCell(t.part, unit), TableCell(t.shown, unit),
               t.ratio, TableCell(t.spread, unit), off)  # fmt: skip


# --- power ----------------------------------------------------------------------------------------


def _power(study: Coverage) -> Exhibit:
    keys = dict.fromkeys((p.method, p.path, p.name) for p in study.power)
    head = ("method", "parameter", "check", *(f"{100 * by:g} % wrong / %" for by in WRONG),
            "why none")  # fmt: skip
    rows = tuple(_power_row(study, *key) for key in keys)
    words = (
        "Share of draws in which the model differs though one of its parameters is smaller than "
        "the true one by so much. What stays at the share of a perfect model, this recording "
        "cannot tell.",
    )
    table = NumberTable("power", "How often a wrong model differs", head, rows,
                        folded=len(rows) > 30)  # fmt: skip
    return Exhibit("power", "What would be noticed", words, (table,), tuple(_charts(study)))


def _power_row(
    study: Coverage, method: str, path: str, name: str | None
) -> tuple[float | str | TableCell | None, ...]:
    found = _at(study, method, path, name)
    shares = (found[by].share if by in found else None for by in WRONG)
    cells = (TableCell(None if s is None else 100 * s.value) for s in shares)
    why = "; ".join(dict.fromkeys(p.why for p in found.values() if p.why))
    return method, path, name or "all (Holm)", *cells, why or None


def _at(study: Coverage, method: str, path: str, name: str | None) -> dict[float, Power]:
    return {p.by: p for p in study.power if (p.method, p.path, p.name) == (method, path, name)}


def _charts(study: Coverage) -> Iterator[Chart]:
    """All checks together by parameter, then each check; the perfect model at 0 %."""
    for t in study.together:
        yield _chart(study, t.method, None, t.share)
        for q in study.quantities:
            if q.method == t.method and q.finding.word != "no evidence" and t.checks > 1:
                yield _chart(study, t.method, q.stated.name, q.share)


def _chart(study: Coverage, method: str, name: str | None, perfect: Share) -> Chart:
    paths = dict.fromkeys(p.path for p in study.power if p.method == method)
    lines = []
    for path in paths:
        found = {b: p.share for b, p in _at(study, method, path, name).items() if p.share}
        if found:
            x = np.array([0.0, *(100 * b for b in found)])
            y = np.array([100 * perfect.value, *(100 * s.value for s in found.values())])
            lines.append(Series(path, x, y))
    what = name or "all checks together (Holm)"
    safe = what.split(" (")[0].replace("@", "_at_").replace(" ", "_")
    return Chart(f"power_{method}_{safe}", f"{method}: {what}", "parameter wrong by / %",
                 "share of draws that differ / %", tuple(lines), _BANDS)  # fmt: skip
