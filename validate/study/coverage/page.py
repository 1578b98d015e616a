"""Page of a coverage study: sentence, part of results.json and table of draws."""

from collections import Counter
from dataclasses import asdict
from typing import Any

from validate.compare.coverage import Share
from validate.compare.exhibit import NumberTable
from validate.report.stored.json_values import members
from validate.study.coverage.coverage_results import Power, Quantity
from validate.study.coverage.exhibits import coverage_exhibits
from validate.study.coverage.study import Coverage
from validate.study.study_page import Findings


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
        "power": [_power(p) for p in study.power],
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


def _power(p: Power) -> dict[str, Any]:
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
