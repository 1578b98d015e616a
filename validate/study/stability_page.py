"""What a stability map tells: its sentence, its part of results.json and its table of cells."""

from collections import Counter
from dataclasses import asdict
from typing import Any

from validate.study.stability import Stability, limit_error
from validate.study.stability_cell import Stepped
from validate.study.stability_exhibits import stability_exhibits, variant_row
from validate.study.stability_plan import StabilityCell
from validate.study.store import Record
from validate.study.study_page import CellsTable, Findings


def told(study: Stability) -> Findings:
    band = ("good", "Predictions hold") if study.passed else ("bad", "Predictions fail")
    return Findings(
        f"Stability map: {study.base.words}", sentence(study), stability_exhibits(study),
        document(study), points_table(study), study.quick, passed=study.passed, band=band,
    )  # fmt: skip


def sentence(study: Stability) -> str:
    """What was computed and whether the predictions hold, in one sentence."""
    regimes = Counter(p.regime for p in study.all_points)
    found = ", ".join(f"{n} {name}" for name, n in sorted(regimes.items()))
    failed = [p.name for p in study.predictions if not p.holds]
    errors = [abs(e) for r in study.ran for s in r.schemes if (e := limit_error(s)) is not None]
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
        "reused": study.done.reused,
        "seconds": study.done.seconds,
        "workers": study.done.workers,
        "predictions": [asdict(p) for p in study.predictions],
        "papers": [asdict(p) for p in study.base.papers],
        "variants": [_variant(c, study.done.records[c.key]) for c in study.cells],
    }


def _variant(cell: StabilityCell, record: Record[Stepped]) -> dict[str, Any]:
    content = asdict(record.value or Stepped())
    for scheme in content["schemes"]:
        scheme["radii"] = [float(f"{r:.10g}") for r in scheme["radii"]]
    return {
        "variant": asdict(cell.variant), "steps": list(cell.steps), "key": cell.key, **content,
        "refused": record.refused, "failed": record.failed, "seconds": record.seconds,
    }  # fmt: skip


def points_table(study: Stability) -> CellsTable:
    """Every point, SI."""
    head = ("scheme", "E_Pa", "nu", "rho_kg_m3", "alpha_1_s", "beta_s", "mesh", "altitude_ratio",
            "dt_s", "regime", "radius", "predicted_limit_s", "measured_limit_s", "why")  # fmt: skip
    limits = {
        (key, s.scheme): (s.predicted, s.measured)
        for key, r in study.done.records.items()
        for s in (r.value or Stepped()).schemes
    }
    rows = tuple(
        (p.scheme, *variant_row(p.cell.variant), p.dt, p.regime, p.radius,
         *limits.get((p.cell.key, p.scheme), (None, None)), p.why or None)
        for p in study.all_points
    )  # fmt: skip
    return head, rows
