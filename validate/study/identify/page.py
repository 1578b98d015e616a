"""Report of an identification: page, sentence, values, profiles and part of results.json."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from validate.compare.exhibit import Chart, Exhibit, Heat, NumberTable, Series, TableCell
from validate.identify.identification import Profiled
from validate.identify.profile import RISE
from validate.numbers import scale, shown_unit
from validate.parameters import describe
from validate.pipeline.calibration.problem import Calibrated
from validate.pipeline.calibration.sentences import headline, helping, lines, not_identified
from validate.report.stored.json_values import members
from validate.report.views.records import Shown, sized, table
from validate.study.identify.study import IdentifyStudy
from validate.study.study_page import Findings

_STRAIGHT = 25  # points of a profile as drawn


def exhibits(study: IdentifyStudy) -> tuple[Exhibit, ...]:
    pairs = [(c, e) for c in study.calibrated for e in c.found.estimates]
    columns: Mapping[str, Shown] = {
        "parameter": "1.name", "value": sized("1.value", _unit),
        "unit": lambda pair: shown_unit(_unit(pair)) or "1", "95 % from": sized("1.low", _unit),
        "95 % to": sized("1.high", _unit), "sd": sized("1.sd", _unit), "found on": "0.on",
        "verdict": _verdict,
    }  # fmt: skip
    found = table(
        "parameters", "Identified parameters", pairs, columns, below="verdict",
        note="95 %: the interval in which chi-square rises by less than 3.84, with all other "
             "parameters fitted again.",
    )  # fmt: skip
    words = tuple(line for c in study.calibrated for line in lines(c))
    return (
        Exhibit("identified", "Identified parameters", words, (found,)),
        *map(_of, study.calibrated),
    )


def units(one: Calibrated) -> dict[str, str]:
    """SI units by path."""
    return {p.path: p.unit for p in describe(one.problem.parts[0].parameters)}


def verdict(e: Profiled) -> str:
    return "identified" if e.identified else f"not identifiable: {'; '.join(e.findings)}"


def _unit(pair: tuple[Calibrated, Profiled]) -> str:
    return units(pair[0])[pair[1].name]


def _verdict(pair: tuple[Calibrated, Profiled]) -> TableCell:
    one, e = pair
    free = next(f for f in one.problem.free if f.path == e.name)
    said = verdict(e) if e.identified else f"{verdict(e)}; {helping(free)} would identify it"
    return TableCell(said, emphasis="good" if e.identified else "bad")


def _of(one: Calibrated) -> Exhibit:
    method = one.problem.calibration.method
    charts = tuple(_profile(one, e) for e in one.found.estimates)
    words = (
        "Rise of chi-square when one parameter is changed and the others are fitted again. "
        "Points are computed; the line joins them.",
    )
    found = one.found
    named = zip(found.space.names, _si(one), strict=True)
    head = ("start", "chi-square / 1", *(f"{n} / {shown_unit(u) or '1'}" for n, u in named),
            "evaluations", "ended")  # fmt: skip
    rows = tuple(
        (i + 1, f.chi_square if f.count else None,
         *(scale(u) * found.space.value(k, float(f.x[k])) for k, u in enumerate(_si(one))),
         f.evaluations, "converged" if f.converged else f"did not: {f.why}")
        for i, f in enumerate(found.fits)
    )  # fmt: skip
    heats = (
        Heat(f"correlations_{method}", "Correlations of the estimates", "parameter", "parameter",
             found.space.names, found.space.names, found.correlations, "correlation / 1", 0.0),
    ) if len(found.space.names) > 1 else ()  # fmt: skip
    starts = NumberTable(
        f"starts_{method}", "Result of every start", head, rows, below="ended", folded=True
    )
    return Exhibit(
        f"profiles_{method}", f"Profiles, {method}", words, (starts,), charts,
        heats=heats,
    )  # fmt: skip


def _profile(one: Calibrated, e: Profiled) -> Chart:
    unit = units(one)[e.name]
    x, y = scale(unit) * np.array(e.at), np.array(e.rise)
    label = f"{e.name} / {shown_unit(unit) or '1'}"
    # Squares of straight lines through the signed roots, which are nearly straight
    best = int(np.argmin(y))
    roots = np.sqrt(np.maximum(y, 0)) * np.where(np.arange(len(y)) < best, -1, 1)
    fine = np.unique(np.concatenate([x, np.linspace(x[0], x[-1], _STRAIGHT)]))
    line = Series("through them", fine, np.interp(fine, x, roots) ** 2)
    points = Series("computed", x, y, "points")
    method = one.problem.calibration.method
    return Chart(
        f"profile_{method}_{e.name.replace('.', '_')}", f"{e.name}: profile", label,
        "rise of chi-square / 1", (line, points), (("95 %", RISE),), caption=f"{verdict(e)}.",
    )  # fmt: skip


def _si(one: Calibrated) -> list[str]:
    return [units(one)[n] for n in one.found.space.names]


def told(study: IdentifyStudy) -> Findings:
    band = (
        ("good", "Identified")
        if study.identified
        else ("open", "Some parameters are not identifiable")
    )
    rows = [
        (c.problem.calibration.method, e.name, units(c)[e.name], at, rise)
        for c in study.calibrated
        for e in c.found.estimates
        for at, rise in zip(e.at, e.rise, strict=True)
    ]
    head = ("method", "parameter", "unit", "value", "rise_of_chi_square")
    cells = NumberTable("cells", "Every point of every profile, SI.", head, tuple(rows))
    return Findings(
        f"Identification: {study.experiment.title}", sentence(study), exhibits(study),
        document(study), cells, study.quick,
        parameters=describe(study.calibrated[0].problem.parts[0].parameters), band=band,
    )  # fmt: skip


def sentence(study: IdentifyStudy) -> str:
    """Fitted on what, and what is not identifiable from it."""
    quick = " (quick: fewer starts)" if study.quick else ""
    fitted = "; ".join(headline(c) for c in study.calibrated)
    return f"{fitted}{quick}. {' '.join(f'{line}.' for line in unidentified(study))}".strip()


def unidentified(study: IdentifyStudy) -> list[str]:
    """Return a line for each parameter that its recordings do not identify, and each method that
    has no answer to them."""
    return [f"{name} could not be fitted: {why}" for name, why in study.failed.items()] + [
        not_identified(c, e, free)
        for c in study.calibrated
        for e, free in zip(c.found.estimates, c.problem.free, strict=True)
        if not e.identified
    ]


def document(study: IdentifyStudy) -> dict[str, Any]:
    """Return the study's own part of results.json: SI, nothing that is not finite."""
    return {
        "kind": "identify",
        "identified": study.identified,
        **members(study.done, "reused", "seconds", "workers"),
        "calibrations": [_calibration(c) for c in study.calibrated],
        "failed": dict(study.failed),
    }


def _calibration(one: Calibrated) -> dict[str, Any]:
    found, known = one.found, units(one)
    bounds = {f.path: f for f in one.problem.free}
    return {
        "method": one.problem.calibration.method,
        "on": [
            {"quantities": list(p.on.quantities), "recordings": [r.name for r in p.recordings],
             "sha256": [r.source.sha256 for r in p.recordings]}
            for p in one.problem.parts
        ],
        "chi_square": found.best.chi_square,
        "count": found.best.count,
        "misfit": found.misfit,
        "parameters": [
            {**asdict(e), "unit": known[e.name], "identified": e.identified,
             "bounds": [bounds[e.name].low, bounds[e.name].high],
             "source": bounds[e.name].source, "helps": bounds[e.name].helps}
            for e in found.estimates
        ],
        "correlations": found.correlations.tolist(),
        "starts": [
            {"chi_square": f.chi_square if f.count else None,
             "values": list(found.space.values(f.x)), "evaluations": f.evaluations,
             "converged": f.converged, "why": f.why}
            for f in found.fits
        ],
    }  # fmt: skip
