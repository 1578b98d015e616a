"""Page of a stability map: sentence, part of results.json and table of cells."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from validate.compare.exhibit import NumberTable
from validate.engine.cell import Record
from validate.report.stored.json_values import members
from validate.report.views.records import Shown, table
from validate.study.stability.cell import Stepped
from validate.study.stability.exhibits import stability_exhibits
from validate.study.stability.plan import StabilityCell
from validate.study.stability.study import Stability, limit_error
from validate.study.study_page import Findings


def told(study: Stability) -> Findings:
    band = ("good", "Predictions hold") if study.passed else ("bad", "Predictions fail")
    return Findings(
        f"Stability map: {study.base.words}", sentence(study), stability_exhibits(study),
        document(study), points_table(study), study.quick, passed=study.passed, band=band,
    )  # fmt: skip


def sentence(study: Stability) -> str:
    """Return the computed cells and the validity of the predictions, in one sentence."""
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
    """Return the study's own part of results.json: SI, nothing that is not finite."""
    return {
        "kind": "stability",
        "passed": study.passed,
        "points": study.points,
        **members(study.done, "reused", "seconds", "workers"),
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


def points_table(study: Stability) -> NumberTable:
    """Every point, SI, with the limits of its scheme there."""
    limits = {
        (key, s.scheme): s
        for key, r in study.done.records.items()
        for s in (r.value or Stepped()).schemes
    }
    rows = [(p, p.cell.variant, limits.get((p.cell.key, p.scheme))) for p in study.all_points]
    columns: Mapping[str, Shown] = {
        "scheme": "0.scheme", "E_Pa": "1.E", "nu": "1.nu", "rho_kg_m3": "1.rho",
        "alpha_1_s": "1.mass_damping", "beta_s": "1.stiffness_damping", "mesh": "1.mesh",
        "altitude_ratio": "1.quality", "dt_s": "0.dt", "regime": "0.regime", "radius": "0.radius",
        "predicted_limit_s": "2.predicted", "measured_limit_s": "2.measured",
        "why": lambda row: row[0].why or None,
    }  # fmt: skip
    return table("cells", "Every point, SI.", rows, columns)
