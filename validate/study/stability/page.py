"""Report of a stability map: claims, settings of papers, maps, limits and part of results.json."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from validate.compare.exhibit import Exhibit, Mark, NumberTable, Panel, RegimeMap
from validate.engine.cell import Record
from validate.pipeline.ladder.ladder import PaperSetting, Turned
from validate.report.stored.json_values import members
from validate.report.views.view_filling import Shown, table
from validate.study.stability.cell import DRIFT_STEPS, STEPS, Stepped
from validate.study.stability.plan import StabilityCell, axis, drift_variant
from validate.study.stability.study import Point, Stability, declared, limit_error, points
from validate.study.study_page import Findings

REGIMES = ("stable", "unresolved", "unstable", "refused")
_WORDS = ("stable", "stable, h too large to resolve", "unstable", "refused")
_WORST = 15  # limits shown; tables/cells.csv and results.json have them all
_VARIANT = {
    "E / Pa": "E", "nu / 1": "nu", "rho / kg/m3": "rho", "alpha / 1/s": "mass_damping",
    "beta / s": "stiffness_damping", "mesh": "mesh", "altitude ratio": "quality",
}  # fmt: skip
_LABELS = {
    "nu": "Poisson ratio", "E": "modulus / Pa", "damping": "damping alpha 1/s, beta s",
    "quality": "worst altitude ratio", "mesh": "cells across",
}  # fmt: skip
# Rows that must be refused, before or after the axis itself.
_BEYOND = {"nu": ("nu", 0.5, True), "E": ("E", 0.0, False), "quality": ("quality", 0.0, True)}


def stability_exhibits(study: Stability) -> tuple[Exhibit, ...]:
    """In the order of a reader's questions: does it hold, where am I, where is the border, why."""
    maps = tuple(m for name in _LABELS if (m := _map(study, name)) is not None)
    words = (
        f"Base: {study.base.words}; {_described(study.base.base)}. One quantity is changed at a "
        "time here; pairs are in tables/cells.csv.",
        "Stable means that nothing grows, not that the motion is accurate. 'Too large to "
        "resolve' means fewer than ten steps in the slowest period.",
    )
    pairs = ((c.variant, study.done.records[c.key].why) for c in study.cells)
    columns: Mapping[str, Shown] = {**_variant("0"), "why": "1"}
    shown = table("refused", "Refused schemes and reasons", (p for p in pairs if p[1]), columns)
    columns = {
        "claim": "name", "worst / 1": "value", "limit / 1": "limit", "count": "count",
        "verdict": lambda p: "holds" if p.holds else "fails", "what": "why",
    }  # fmt: skip
    claims = table("predictions", "Predicted and measured limits", study.predictions, columns)
    of_claims = (
        "Measured: the spectral radius of the step map over all modes of the body; a limit is "
        "the step at which it passes 1 (bisection). Predicted: the formula of each scheme "
        "with the highest frequency by Lanczos. CG, Gauss-Seidel and direct solvers share one "
        "step map.",
        "Large strain schemes (central, newton_dynamics) are evaluated at rest, where they "
        "are linear; their limit changes as the body deforms.",
    )
    papers = []
    if study.base.papers:
        found = [one for paper in study.base.papers for one in _of_paper(study, paper)]
        columns = {
            "setting": "0.label", "source": "0.source", "h / ms": "1.dt", "scheme": "1.scheme",
            "regime": lambda one: _WORDS[REGIMES.index(one[1].regime)], "radius / 1": "1.radius",
            "h over limit / 1": lambda one: one[2] and one[0].dt / one[2], "why": "1.why",
        }  # fmt: skip
        note = "Refused: the scheme does not run with that material, so there is no radius."
        title = "Settings of the papers"
        papers = [Exhibit("papers", title, (), (table("papers", title, found, columns, note),))]
    return (
        Exhibit("predictions", "Predictions", of_claims, (claims,)),
        *papers,
        Exhibit("maps", "Stability limits of all schemes", words, regimes=maps),
        _limits(study),
        _conditions(study),
        _drifts(study),
        Exhibit("refused", "Refused", (), (shown,)),
    )


def _variant(at: str) -> Mapping[str, Shown]:
    """What tables show of the variant that stands there in their records."""
    return {heading: f"{at}.{name}" for heading, name in _VARIANT.items()}


def _of_paper(
    study: Stability, paper: PaperSetting
) -> Iterator[tuple[PaperSetting, Point, float | None]]:
    """Each scheme at the paper's step, and its predicted limit s."""
    cell = _cell(study, paper.variant)
    if cell is None:
        return
    record = study.done.records[cell.key]
    limits = {s.scheme: s.predicted for s in (record.value or Stepped()).schemes}
    for p in points(cell, record, study.schemes):
        if np.isclose(p.dt, paper.dt, rtol=1e-6):
            yield paper, p, limits.get(p.scheme)


# --- maps ----------------------------------------------------------------------------------------


def _map(study: Stability, name: str) -> RegimeMap | None:
    """None where fewer than two rows were run."""
    variants = _rows(study, name)
    cells = [(v, c) for v in variants if (c := _cell(study, v)) is not None]
    if len(cells) < 2:
        return None
    found = [list(points(c, study.done.records[c.key], study.schemes)) for _, c in cells]
    panels = tuple(_panel(study, s, [c for _, c in cells], found) for s in study.schemes)
    shown = tuple(_text(name, v) for v, _ in cells)
    marks = tuple(_marks(study, name, [v for v, _ in cells]))
    hollow = any(not m.on_map for m in marks)
    more = " Hollow: differs from the base in further quantities; see the table." if hollow else ""
    return RegimeMap(
        name,
        f"{study.experiment.name}: time step against {_LABELS[name].split(' / ')[0]}",
        "time step / s",
        _LABELS[name],
        np.array(cells[0][1].steps),
        shown,
        _WORDS,
        panels,
        marks,
        f"Line: predicted limit. Marks: settings of the papers.{more}",
    )


def _rows(study: Stability, name: str) -> tuple[Turned, ...]:
    along = axis(study.base, name)
    if name not in _BEYOND:
        return along
    where, value, after = _BEYOND[name]
    beyond = replace(study.base.base, **{where: value})  # type: ignore[arg-type]
    return (*along, beyond) if after and name != "quality" else (beyond, *along)


def _panel(
    study: Stability, scheme: str, cells: list[StabilityCell], found: list[list[Point]]
) -> Panel:
    codes = [[REGIMES.index(p.regime) for p in row if p.scheme == scheme] for row in found]
    results = (study.done.records[c.key].value or Stepped() for c in cells)
    limits = [next((s.predicted for s in r.schemes if s.scheme == scheme), None) for r in results]
    border = np.array([np.nan if x is None else x for x in limits])
    return Panel(scheme, np.array(codes), border)


def _marks(study: Stability, name: str, rows: list[Turned]) -> Iterator[Mark]:
    """Papers' settings whose value of this quantity is a row, or lies between two of E."""
    for paper in study.base.papers:
        if name == "E":
            known = [(i, r.E) for i, r in enumerate(rows) if r.E > 0]
            indices, logs = [i for i, _ in known], [float(np.log(e)) for _, e in known]
            at = float(np.interp(np.log(paper.variant.E), logs, indices))
        else:
            texts, own = [_text(name, r) for r in rows], _text(name, paper.variant)
            if own not in texts:
                continue
            at = float(texts.index(own))
        yield Mark(paper.label, paper.dt, at, any(_alike(paper.variant, v, name) for v in rows))


def _alike(one: Turned, other: Turned, name: str) -> bool:
    """Equal, or but for a modulus between two rows of moduli."""
    return one == other or (name == "E" and replace(one, E=other.E) == other)


def _text(name: str, v: Turned) -> str:
    if name == "damping":
        return f"{v.mass_damping:g}, {v.stiffness_damping:g}"
    return f"{getattr(v, name):g}"


def _described(v: Turned) -> str:
    return (
        f"E {v.E:g} Pa, nu {v.nu:g}, rho {v.rho:g} kg/m3, alpha {v.mass_damping:g} 1/s, beta "
        f"{v.stiffness_damping:g} s, {v.mesh} cells across"
    )


def _cell(study: Stability, v: Turned) -> StabilityCell | None:
    return next((c for c in study.cells if c.variant == v), None)


# --- tables --------------------------------------------------------------------------------------


def _limits(study: Stability) -> Exhibit:
    found = [
        (cell.variant, s, limit_error(s))
        for cell in study.cells
        for s in (study.done.records[cell.key].value or Stepped()).schemes
        if s.predicted is not None
    ]
    found.sort(key=lambda one: -np.inf if one[2] is None else -abs(one[2]))
    columns: Mapping[str, Shown] = {
        "scheme": "1.scheme", **_variant("0"), "predicted limit / s": "1.predicted",
        "measured limit / s": "1.measured", "relative difference / 1": "2",
    }  # fmt: skip
    title = (
        f"Predicted and measured limits: the {min(_WORST, len(found))} with the largest difference "
        f"of {len(found)}"
    )
    return Exhibit("limits", "Limits", (), (table("limits", title, found[:_WORST], columns),))


def _conditions(study: Stability) -> Exhibit:
    """Along every axis from the base: what a solver and a linear cell have to bear."""
    wanted = dict.fromkeys(v for name in _LABELS for v in axis(study.base, name))
    found = [
        (v, study.done.records[c.key].value or Stepped())
        for v in wanted
        if (c := _cell(study, v)) is not None
    ]
    words = (
        "Locking factor: compliance under the static load over that of mixed Taylor-Hood "
        "elements on the same mesh (1: no locking; 0.1: ten times too stiff). It includes the "
        "mesh error.",
        "float32: largest difference from float64 over the largest displacement, of a direct "
        f"static solution and of {STEPS} explicit steps at 2 % of the limit. J is that of average "
        "acceleration at the paper's step; M is consistent.",
    )
    columns = {**_variant("0"), **_COST}
    costs = table("conditions", "Conditioning, locking, single precision", found, columns)
    return Exhibit(
        "conditions", "Conditioning, locking and precision of the cells", words, (costs,)
    )


_COST: Mapping[str, Shown] = {
    "cond K / 1": "1.conditions.K", "cond M / 1": "1.conditions.M", "cond J / 1": "1.conditions.J",
    "locking factor / 1": "1.locking", "float32 static / 1": "1.rounding.static",
    f"float32 {STEPS} steps, positions / 1": "1.rounding.positions",
    f"float32 {STEPS} steps, velocities / 1": "1.rounding.velocities",
    "warning": lambda one: one[1].warning or None,
}  # fmt: skip


def _drifts(study: Stability) -> Exhibit:
    known = declared()
    columns: Mapping[str, Shown] = {
        "scheme": "scheme", "h / ms": "dt",
        "keeps energy": lambda d: "yes" if known[d.scheme].conserves else "no",
        "energy left, float64 / 1": "double", "energy left, float32 / 1": "single",
    }  # fmt: skip
    words = (
        f"Undamped, {_described(drift_variant(study.base))}: all modes are advanced "
        f"{DRIFT_STEPS:g} times by their step maps from the same strain energy. Explicit "
        "schemes use half their limit, implicit ones the paper's step. Explicit schemes "
        "conserve an energy of half steps.",
    )
    title, drifts = "Energy after 1e5 steps over the initial energy", (r.drifts for r in study.ran)
    shown = table("drift", title, (d for found in drifts for d in found), columns)
    return Exhibit("drift", "Drift", words, (shown,))


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
        "variants": [_variant_members(c, study.done.records[c.key]) for c in study.cells],
    }


def _variant_members(cell: StabilityCell, record: Record[Stepped]) -> dict[str, Any]:
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
