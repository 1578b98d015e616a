"""Report of a coverage study: shares with intervals, terms of u_val against draws, power."""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial

from validate.compare.coverage import FALSE_ACCEPTANCE, LEAST, MOST, Share
from validate.compare.exhibit import Chart, Emphasis, Entry, Exhibit, NumberTable, TableCell
from validate.report.views.records import Shown, chart, grouped, sized, table
from validate.study.coverage.coverage_results import Power
from validate.study.coverage.plan import CHECKS, WRONG
from validate.study.coverage.study import Coverage

_BANDS = {"2 %": LEAST, "7 %": MOST}
_WORDS: Mapping[str, Emphasis] = {
    "holds": "good",
    "blunt": "open",
    "too narrow": "bad",
    "too wide": "open",
    "no answer": "open",
}
HEAD = ("differs / %", "95 % interval / %")


def coverage_exhibits(study: Coverage) -> tuple[Exhibit, ...]:
    """Does it hold, which term is at fault, and what would be noticed."""
    return (_shares(study), _terms(study), *((_power(study),) if study.power else ()))


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
    head = (
        "method", "check", *HEAD, "undecided / %", "not good enough / %",
        "good enough at the limit / %", "not good enough at the limit / %", "rms of E", "u_val",
        "finding", "which term",
    )  # fmt: skip
    shares = NumberTable("coverage", "Rate at which a perfect model differs", head, tuple(rows),
                        "At the limit: models whose error equals the limit; at most 5 % may "
                        "get either verdict. All checks together have no rms and no u_val, "
                        "because they have no common unit.",
                        below="which term")  # fmt: skip
    return Exhibit("coverage", "Verdicts on a perfect model", tuple(_told(study)), (shares,))


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
    pairs = [(q, t) for q in study.quantities for t in q.terms]
    unit = "0.stated.unit"
    columns: Mapping[str, Shown] = {
        "method": "0.method", "check": "0.stated.name", "term": "1.name",
        "claimed": sized("1.part", unit), "observed": sized("1.shown", unit),
        "observed over claimed / 1": "1.ratio", "rms of E": sized("1.spread", unit),
        "error of the line": sized(
            lambda pair: pair[0].off if pair[1].name.startswith("u_input") else None, unit
        ),
    }  # fmt: skip
    words = (
        "Claimed: the term's part of u_val. Observed: half of the |E| that 4.6 % of the draws "
        "exceed when only this term is drawn. For a normal law this is the standard "
        "deviation; for a uniform range it is 0.83 of it. Model and truth have the same mesh, "
        "so u_num is never observed.",
    )
    terms = table("terms", "Terms of u_val against the draws", pairs, columns,
                  "No ratio: nothing is claimed. No line: solved in full, or not an input.",
                  folded=len(pairs) > 20)  # fmt: skip
    return Exhibit("terms", "Terms that are too wide or too narrow", words, (terms,))


# --- power ----------------------------------------------------------------------------------------


def _power(study: Coverage) -> Exhibit:
    found = list(grouped(study.power, lambda p: (p.method, p.path, p.name)).values())
    columns: Mapping[str, Shown] = {
        "method": "0.method", "parameter": "0.path",
        "check": lambda powers: powers[0].name or "all (Holm)",
        **{f"{100 * by:g} % wrong / %": partial(_share_at, by) for by in WRONG},
        "why none": lambda powers: "; ".join(
            dict.fromkeys(p.why for p in powers if p.why)
        ) or None,
    }  # fmt: skip
    words = (
        "Share of draws in which the model differs when one parameter is smaller than the "
        "true one by the given percentage. If the share stays at that of a perfect model, "
        "this recording cannot detect the error.",
    )
    power = table("power", "Rate at which a wrong model differs", found, columns,
                  folded=len(found) > 30)  # fmt: skip
    title = "Errors of parameters that would be detected"
    return Exhibit("power", title, words, (power,), tuple(_charts(study)))


def _share_at(by: float, powers: Sequence[Power]) -> float | None:
    """The share where the parameter is wrong by so much."""
    return next((p.share.value for p in powers if p.by == by and p.share), None)


def _charts(study: Coverage) -> Iterator[Chart]:
    """All checks together by parameter, then each check; the perfect model at 0 %."""
    for t in study.together:
        yield _chart(study, t.method, None, t.share)
        for q in study.quantities:
            if q.method == t.method and q.finding.word != "no evidence" and t.checks > 1:
                yield _chart(study, t.method, q.stated.name, q.share)


def _chart(study: Coverage, method: str, name: str | None, perfect: Share) -> Chart:
    mine = [p for p in study.power if (p.method, p.name) == (method, name) and p.share]
    lines = {
        path: [Power(method, name, path, 0.0, perfect), *found]
        for path, found in grouped(mine, "path").items()
    }
    what = name or "all checks together (Holm)"
    safe = what.split(" (")[0].replace("@", "_at_").replace(" ", "_")
    return chart(
        f"power_{method}_{safe}", f"{method}: {what}", ("parameter wrong by / %", "by"),
        ("share of draws that differ / %", "share.value"), lines=lines, levels=_BANDS,
    )  # fmt: skip
