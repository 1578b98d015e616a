"""Page of an identification: sentence, part of results.json and table of cells."""

from dataclasses import asdict
from typing import Any

from validate.compare.exhibit import NumberTable
from validate.parameters import describe
from validate.pipeline.calibration.problem import Calibrated
from validate.pipeline.calibration.sentences import headline, not_identified
from validate.report.stored.json_values import members
from validate.study.identify.exhibits import exhibits, units
from validate.study.identify.study import IdentifyStudy
from validate.study.study_page import Findings


def told(study: IdentifyStudy) -> Findings:
    band = (
        ("good", "Identified")
        if study.identified
        else ("open", "Some parameters are not identifiable")
    )
    return Findings(
        f"Identification: {study.experiment.title}", sentence(study), exhibits(study),
        document(study), _cells(study), study.quick,
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


def _cells(study: IdentifyStudy) -> NumberTable:
    rows = [
        (c.problem.calibration.method, e.name, units(c)[e.name], at, rise)
        for c in study.calibrated
        for e in c.found.estimates
        for at, rise in zip(e.at, e.rise, strict=True)
    ]
    head = ("method", "parameter", "unit", "value", "rise_of_chi_square")
    return NumberTable("cells", "Every point of every profile, SI.", head, tuple(rows))
