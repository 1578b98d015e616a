"""A finished stability map as its folder: results.json, tables, maps and a page; cells stay."""

from collections import Counter
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from validate.compare.result import Result
from validate.report.study_page import Row, StudyPage, write_study_page
from validate.study.stability import CELLS, Stability, limit_error
from validate.study.stability_cell import VariantResult
from validate.study.stability_exhibits import stability_exhibits, variant_row
from validate.study.variants import VariantCell


def write_stability(study: Stability, folder: Path) -> Path:
    """Replaces all of `folder` but its cells; returns the path of report.html."""
    created = datetime.now(UTC).isoformat(timespec="seconds")
    colour, word = ("good", "Predictions hold") if study.passed else ("bad", "Predictions fail")
    page = StudyPage(
        _result(study), document(study), points_table(study), (CELLS,), study.passed, (colour, word)
    )
    return write_study_page(page, folder, created)


def _result(study: Stability) -> Result:
    return Result(
        name=study.base.name,
        title=f"Stability map: {study.base.words}",
        source="science of paper 002 and 003: limits, locking, extremes",
        sentence=sentence(study),
        parameters=(),
        methods=(),
        recordings=(),
        rest=(),
        effects=(),
        published=(),
        quick=study.quick,
        exhibits=stability_exhibits(study),
    )


def sentence(study: Stability) -> str:
    """What was computed and whether the predictions hold, in one sentence."""
    regimes = Counter(p.regime for p in study.all_points)
    found = ", ".join(f"{n} {name}" for name, n in sorted(regimes.items()))
    failed = [p.name for p in study.predictions if not p.holds]
    errors = [
        abs(e)
        for r in study.results.values()
        for s in r.schemes
        if (e := limit_error(s)) is not None
    ]
    verdict = f"{len(failed)} predictions fail: {', '.join(failed)}" if failed else (
        f"all {len(study.predictions)} predictions hold"
    )  # fmt: skip
    return (
        f"{study.points} points over {len(study.cells)} variants ({found}); {verdict}; "
        f"{len(errors)} limits measured, at most {100 * max(errors, default=0.0):.2g} % from the "
        "predicted ones."
    )


def document(study: Stability) -> dict[str, Any]:
    """The study's own part of results.json: SI, nothing that is not finite."""
    return {
        "kind": "stability",
        "passed": study.passed,
        "points": study.points,
        "reused": study.reused,
        "seconds": study.seconds,
        "workers": study.workers,
        "predictions": [asdict(p) for p in study.predictions],
        "papers": [asdict(p) for p in study.base.papers],
        "variants": [_variant(c, study.results[c.key]) for c in study.cells],
    }


def _variant(cell: VariantCell, result: VariantResult) -> dict[str, Any]:
    content = asdict(result)
    for scheme in content["schemes"]:
        scheme["radii"] = [float(f"{r:.10g}") for r in scheme["radii"]]
    return {"variant": asdict(cell.variant), "steps": list(cell.steps), **content}


def points_table(study: Stability) -> tuple[tuple[str, ...], tuple[Row, ...]]:
    """Every point, SI: head and rows of tables/cells.csv."""
    head = ("scheme", "E_Pa", "nu", "rho_kg_m3", "alpha_1_s", "beta_s", "mesh", "altitude_ratio",
            "dt_s", "regime", "radius", "predicted_limit_s", "measured_limit_s", "why")  # fmt: skip
    limits = {
        (key, s.scheme): (s.predicted, s.measured)
        for key, r in study.results.items()
        for s in r.schemes
    }
    rows = tuple(
        (p.scheme, *variant_row(p.cell.variant), p.dt, p.regime, p.radius,
         *limits.get((p.cell.key, p.scheme), (None, None)), p.why or None)
        for p in study.all_points
    )  # fmt: skip
    return head, rows
