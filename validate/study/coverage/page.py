"""Report of a coverage study: page, sentence, shares, terms of u_val and part of results.json."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from typing import Any

from validate.compare.coverage import FALSE_ACCEPTANCE, LEAST, MOST, Share
from validate.compare.exhibit import Chart, Emphasis, Entry, Exhibit, NumberTable, TableCell
from validate.report.stored.json_values import members
from validate.report.views.view_filling import Shown, chart, grouped, sized, table
from validate.study.coverage.plan import CHECKS, WRONG
from validate.study.coverage.study import Coverage, Power, Quantity
from validate.study.study_page import Findings

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
    return (
        Exhibit("coverage", "Verdicts on a perfect model", tuple(_told(study)), (shares,)),
        Exhibit("terms", "Terms that are too wide or too narrow", words, (terms,)),
        *((_power(study),) if study.power else ()),
    )


def percent(share: Share) -> str:
    return f"{100 * share.value:.1f}"


def interval(share: Share) -> str:
    return f"{100 * share.low:.1f} to {100 * share.high:.1f}"


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
    # All checks together by parameter, then each check; the perfect model at 0 %
    charts = []
    for t in study.together:
        charts.append(_chart(study, t.method, None, t.share))
        charts += [
            _chart(study, t.method, q.stated.name, q.share) for q in study.quantities
            if q.method == t.method and q.finding.word != "no evidence" and t.checks > 1
        ]  # fmt: skip
    return Exhibit("power", title, words, (power,), tuple(charts))


def _share_at(by: float, powers: Sequence[Power]) -> float | None:
    """The share where the parameter is wrong by so much."""
    return next((p.share.value for p in powers if p.by == by and p.share), None)


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


def told(study: Coverage) -> Findings:
    band = (
        ("good", "Verdicts hold")
        if study.passed
        else ("bad", "Verdicts deviate from their nominal rate")
    )
    return Findings(
        f"Coverage of the verdicts: {study.experiment.title}", sentence(study),
        coverage_exhibits(study), document(study), draws_table(study), study.quick,
        passed=study.passed, band=band,
    )  # fmt: skip


def sentence(study: Coverage) -> str:
    """Return the share of rejected perfect models, in one sentence."""
    words = Counter(q.finding.word for q in study.quantities)
    found = ", ".join(f"{n} {word}" for word, n in words.items())
    joint = ", ".join(f"{100 * t.share.value:.1f} % ({t.method})" for t in study.together)
    named = "".join(_named(study, word) for word in ("too narrow", "too wide", "blunt"))
    return (
        f"A perfect model in {study.draws} drawn recordings: of {len(study.quantities)} checks "
        f"{found}; over all checks it differs in {joint}.{named}"
    )


def _named(study: Coverage, word: str) -> str:
    """The terms at fault, each once with its checks."""
    found: dict[str, list[str]] = {}
    for q in study.quantities:
        if q.finding.word == word:
            term = q.finding.fault.name if q.finding.fault else "no term by itself"
            found.setdefault(term, []).append(q.stated.name)
    said = (f"{term} ({', '.join(dict.fromkeys(names))})" for term, names in found.items())
    return f" {word.capitalize()} by {'; '.join(said)}." if found else ""


def document(study: Coverage) -> dict[str, Any]:
    """Return the study's own part of results.json: SI, nothing that is not finite."""
    return {
        "kind": "coverage",
        "passed": study.passed,
        "draws": study.draws,
        "noise": study.noise,
        **members(study.done, "reused", "seconds", "workers"),
        "checks": [_quantity(q) for q in study.quantities],
        "together": [
            {"method": t.method, "checks": t.checks, "differs": _share(t.share),
             "holds": t.holds}
            for t in study.together
        ],
        "power": [_power_members(p) for p in study.power],
        "moves_nothing": list(study.still),
        "failed": [r.why for r in study.done.records.values() if r.why],
    }  # fmt: skip


def _quantity(q: Quantity) -> dict[str, Any]:
    return {
        "method": q.method, "name": q.stated.name, "unit": q.stated.unit, "count": q.stated.count,
        "differs": _share(q.share), "undecided": _share(q.undecided),
        "not_good_enough": _share(q.rejected),
        "good_enough_at_limit": q.false_good and _share(q.false_good),
        "not_good_enough_at_limit": q.false_bad and _share(q.false_bad),
        "finding": q.finding.word, "why": q.finding.words,
        "fault": q.finding.fault.name if q.finding.fault else None,
        "rms_E": q.spread, "u_val": q.u_val, "line_off": q.off,
        "terms": [{**asdict(t), "ratio": t.ratio} for t in q.terms],
    }  # fmt: skip


def _share(s: Share) -> dict[str, Any]:
    return {**asdict(s), "value": s.value, "low": s.low, "high": s.high}


def _power_members(p: Power) -> dict[str, Any]:
    return {
        "method": p.method, "name": p.name, "path": p.path, "by": p.by,
        "differs": _share(p.share) if p.share else None, "why": p.why,
    }  # fmt: skip


def draws_table(study: Coverage) -> NumberTable:
    """Every check of every draw of the perfect model, SI."""
    rows = [
        (q.method, q.stated.name, q.stated.unit, k + 1, E, u, *answers)
        for q in study.quantities
        for k, (E, u, *answers) in enumerate(
            zip(q.judged.E, q.judged.u_val, q.judged.validations, q.judged.acceptances, strict=True)
        )
    ]
    head = ("method", "check", "unit", "draw", "E", "u_val", "validation", "acceptance")
    return NumberTable("cells", "Every draw of the perfect model, SI.", head, tuple(rows))
