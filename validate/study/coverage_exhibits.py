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
         "at most 7 %: the correction keeps the rate below its level")
        for t in study.together
    ]  # fmt: skip
    head = (*HEAD[:-1], "rms of E", "u_val", "finding", "which term")
    table = NumberTable("coverage", "Rate at which a perfect model differs", head, tuple(rows),
                        "At the limit: models whose error equals the limit; at most 5 % may "
                        "get either verdict. All checks together have no rms and no u_val, "
                        "because they have no common unit.",
                        below="which term")  # fmt: skip
    return Exhibit("coverage", "Verdicts on a perfect model", tuple(_told(study)),
                   (table,))  # fmt: skip


def _cell(share: Share | None) -> TableCell:
    return TableCell(None) if share is None else TableCell(
        100 * share.value, text=percent(share),
        emphasis="bad" if share.value > FALSE_ACCEPTANCE else "",
    )  # fmt: skip


def _told(study: Coverage) -> Iterator[str]:
    yield (
        f"{study.draws} recordings were drawn in which the checked model itself is the truth. "
        "Inputs are uniform within their declared ranges; identified parameters follow their "
        "normal covariance; noise, registration and clocks are as declared. Places and times "
        "are those of the real recording, and each draw is checked like a recording. If E is "
        "normal with u_val, 4.6 % of the draws differ; 2 to 7 % is accepted. More: u_val is "
        "too narrow and gives false alarms. Fewer: u_val is too wide if a term claims too "
        "much, otherwise the check is blunt. A check can be blunt for two reasons: a uniform "
        "range alone never reaches 2 u, and the model has the mesh error of the truth. A "
        "blunt check gives no false alarm and detects less."
    )
    if study.noise != 1:
        yield f"The drawn noise is {study.noise:g} times the declared one."
    if any(q.off is not None for q in study.quantities):
        yield (
            "Inputs act linearly here, by straight lines through one standard uncertainty to "
            f"both sides, because one solution for every draw would take too long. {CHECKS} "
            "draws were solved in full; the table of terms gives the error of the lines."
        )
    yield from study.notes
    if study.still:
        yield f"Without effect on any check: {', '.join(study.still)}."


def _terms(study: Coverage) -> Exhibit:
    rows = tuple(row for q in study.quantities for row in _term_rows(q))
    head = ("method", "check", "term", "claimed", "observed", "observed over claimed / 1",
        "rms of E",
            "error of the line")  # fmt: skip
    words = (
        "Claimed: the term's part of u_val. Observed: half of the |E| that 4.6 % of the draws "
        "exceed when only this term is drawn. For a normal law this is the standard "
        "deviation; for a uniform range it is 0.83 of it. Model and truth have the same mesh, "
        "so u_num is never observed.",
    )
    table = NumberTable("terms", "Terms of u_val against the draws", head, rows,
                        "No ratio: nothing is claimed. No line: solved in full, or not an input.",
                        folded=len(rows) > 20)  # fmt: skip
    return Exhibit("terms", "Terms that are too wide or too narrow", words, (table,))


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
        "Share of draws in which the model differs when one parameter is smaller than the "
        "true one by the given percentage. If the share stays at that of a perfect model, "
        "this recording cannot detect the error.",
    )
    table = NumberTable("power", "Rate at which a wrong model differs", head, rows,
                        folded=len(rows) > 30)  # fmt: skip
    return Exhibit(
        "power",
        "Errors of parameters that would be detected",
        words,
        (table,),
        tuple(_charts(study)),
    )


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
