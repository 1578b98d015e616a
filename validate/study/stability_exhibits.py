"""What a stability map shows: claims, the papers' settings, maps, limits, what cells cost."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from validate.compare.exhibit import Entry, Exhibit, Mark, NumberTable, Panel, RegimeMap
from validate.replay.ladder import PaperSetting, Turned
from validate.study.precision import DRIFT_STEPS, STEPS
from validate.study.stability import (
    Point,
    Stability,
    declared,
    limit_error,
    points,
)
from validate.study.stability_cell import Stepped
from validate.study.stability_plan import StabilityCell, axis, drift_variant

REGIMES = ("stable", "unresolved", "unstable", "refused")
_WORDS = ("stable", "stable, h too large to resolve", "unstable", "refused")
_WORST = 15  # limits shown; tables/cells.csv and results.json have them all
_MM = 1e3
VARIANT = ("E / Pa", "nu / 1", "rho / kg/m3", "alpha / 1/s", "beta / s", "mesh", "altitude ratio")
_LABELS = {
    "nu": "Poisson ratio", "E": "modulus / Pa", "damping": "damping alpha 1/s, beta s",
    "quality": "worst altitude ratio", "mesh": "cells across",
}  # fmt: skip
# Rows that must be refused, before or after the axis itself.
_BEYOND = {"nu": ("nu", 0.5, True), "E": ("E", 0.0, False), "quality": ("quality", 0.0, True)}


def stability_exhibits(study: Stability) -> tuple[Exhibit, ...]:
    """In the order of a reader's questions: does it hold, where am I, where is the border, why."""
    maps = tuple(m for name in _LABELS if (m := _map(study, name)) is not None)
    return (
        _claims(study),
        *((_papers(study),) if study.base.papers else ()),
        Exhibit("maps", "Stability limits of all schemes", tuple(_map_words(study)), regimes=maps),
        _limits(study),
        _conditions(study),
        _drifts(study),
        _refused(study),
    )


def variant_row(v: Turned) -> tuple[Entry, ...]:
    return (v.E, v.nu, v.rho, v.mass_damping, v.stiffness_damping, v.mesh, v.quality)


def _claims(study: Stability) -> Exhibit:
    rows = tuple(
        (p.name, p.value, p.limit, p.count, "holds" if p.holds else "fails", p.why)
        for p in study.predictions
    )
    head = ("claim", "worst / 1", "limit / 1", "count", "verdict", "what")
    table = NumberTable("predictions", "Predicted and measured limits", head, rows)
    words = (
        "Measured: the spectral radius of the step map over all modes of the body; a limit is "
        "the step at which it passes 1 (bisection). Predicted: the formula of each scheme "
        "with the highest frequency by Lanczos. CG, Gauss-Seidel and direct solvers share one "
        "step map.",
        "Large strain schemes (central, newton_dynamics) are evaluated at rest, where they "
        "are linear; their limit changes as the body deforms.",
    )
    return Exhibit("predictions", "Predictions", words, tables=(table,))


def _papers(study: Stability) -> Exhibit:
    rows = [row for p in study.base.papers for row in _paper_rows(study, p)]
    head = ("setting", "source", "h / ms", "scheme", "regime", "radius / 1", "h over limit / 1",
            "why")  # fmt: skip
    note = "Refused: the scheme does not run with that material, so there is no radius."
    table = NumberTable("papers", "Settings of the papers", head, tuple(rows), note)
    return Exhibit("papers", "Settings of the papers", (), tables=(table,))


def _paper_rows(study: Stability, paper: PaperSetting) -> Iterator[tuple[Entry, ...]]:
    cell = _cell(study, paper.variant)
    if cell is None:
        return
    record = study.done.records[cell.key]
    limits = {s.scheme: s.predicted for s in (record.value or Stepped()).schemes}
    for p in _at(points(cell, record, study.schemes), paper.dt):
        limit = limits.get(p.scheme)
        times = None if limit is None else paper.dt / limit
        yield (paper.label, paper.source, _MM * p.dt, p.scheme, _WORDS[REGIMES.index(p.regime)],
               p.radius, times, p.why)  # fmt: skip


def _at(found: Iterator[Point], dt: float) -> Iterator[Point]:
    return (p for p in found if np.isclose(p.dt, dt, rtol=1e-6))


# --- maps ----------------------------------------------------------------------------------------


def _map_words(study: Stability) -> Iterator[str]:
    yield (
        f"Base: {study.base.words}; {_described(study.base.base)}. One quantity is changed at a "
        "time here; pairs are in tables/cells.csv."
    )
    yield (
        "Stable means that nothing grows, not that the motion is accurate. 'Too large to "
        "resolve' means fewer than ten steps in the slowest period."
    )


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
        _caption(marks),
    )


def _caption(marks: tuple[Mark, ...]) -> str:
    hollow = any(not m.on_map for m in marks)
    more = " Hollow: differs from the base in further quantities; see the table." if hollow else ""
    return f"Line: predicted limit. Marks: settings of the papers.{more}"


def _rows(study: Stability, name: str) -> tuple[Turned, ...]:
    along = axis(study.base, name)
    if name not in _BEYOND:
        return along
    where, value, after = _BEYOND[name]
    beyond = _with(study.base.base, where, value)
    return (*along, beyond) if after and name != "quality" else (beyond, *along)


def _with(v: Turned, name: str, value: float) -> Turned:
    return replace(v, **{name: value})  # type: ignore[arg-type]


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
        at = _row_of(name, paper.variant, rows)
        if at is not None:
            on_map = any(_alike(paper.variant, v, name) for v in rows)
            yield Mark(paper.label, paper.dt, at, on_map)


def _row_of(name: str, v: Turned, rows: list[Turned]) -> float | None:
    if name == "E":
        known = [(i, r.E) for i, r in enumerate(rows) if r.E > 0]
        indices, logs = [i for i, _ in known], [float(np.log(e)) for _, e in known]
        return float(np.interp(np.log(v.E), logs, indices))
    texts = [_text(name, r) for r in rows]
    own = _text(name, v)
    return float(texts.index(own)) if own in texts else None


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
    rows: list[tuple[Entry, ...]] = []
    for cell in study.cells:
        for s in (study.done.records[cell.key].value or Stepped()).schemes:
            if s.predicted is not None:
                error = limit_error(s)
                row = (*variant_row(cell.variant), s.predicted, s.measured, error)
                rows.append((s.scheme, *row))
    rows.sort(key=lambda r: -abs(float(r[-1])) if isinstance(r[-1], float) else -np.inf)
    head = (
        "scheme",
        *VARIANT,
        "predicted limit / s",
        "measured limit / s",
        "relative difference / 1",
    )
    title = (
        f"Predicted and measured limits: the {min(_WORST, len(rows))} with the largest difference"
    )
    table = NumberTable("limits", f"{title} of {len(rows)}", head, tuple(rows[:_WORST]))
    return Exhibit("limits", "Limits", (), tables=(table,))


def _conditions(study: Stability) -> Exhibit:
    """Along every axis from the base: what a solver and a linear cell have to bear."""
    wanted = dict.fromkeys(v for name in _LABELS for v in axis(study.base, name))
    rows = [
        (*variant_row(v), *_cost(study.done.records[c.key].value or Stepped()))
        for v in wanted
        if (c := _cell(study, v)) is not None
    ]
    head = (*VARIANT, "cond K / 1", "cond M / 1", "cond J / 1", "locking factor / 1",
            "float32 static / 1", f"float32 {STEPS} steps, positions / 1",
            f"float32 {STEPS} steps, velocities / 1", "warning")  # fmt: skip
    words = (
        "Locking factor: compliance under the static load over that of mixed Taylor-Hood "
        "elements on the same mesh (1: no locking; 0.1: ten times too stiff). It includes the "
        "mesh error.",
        "float32: largest difference from float64 over the largest displacement, of a direct "
        f"static solution and of {STEPS} explicit steps at 2 % of the limit. J is that of average "
        "acceleration at the paper's step; M is consistent.",
    )
    table = NumberTable("conditions", "Conditioning, locking, single precision", head, tuple(rows))
    return Exhibit(
        "conditions", "Conditioning, locking and precision of the cells", words, tables=(table,)
    )


def _cost(r: Stepped) -> tuple[Entry, ...]:
    kept = r.rounding
    single = (kept.static, kept.positions, kept.velocities) if kept else (None, None, None)
    conditions = (r.conditions.get(name) for name in ("K", "M", "J"))
    return (*conditions, r.locking, *single, r.warning or None)


def _drifts(study: Stability) -> Exhibit:
    known = declared()
    rows = [
        (
            d.scheme,
            _MM * d.dt,
            "yes" if known[d.scheme].conserves else "no",
            d.double,
            d.single,
        )
        for r in study.ran
        for d in r.drifts
    ]
    head = ("scheme", "h / ms", "keeps energy", "energy left, float64 / 1",
            "energy left, float32 / 1")  # fmt: skip
    words = (
        f"Undamped, {_described(drift_variant(study.base))}: all modes are advanced "
        f"{DRIFT_STEPS:g} times by their step maps from the same strain energy. Explicit "
        "schemes use half their limit, implicit ones the paper's step. Explicit schemes "
        "conserve an energy of half steps.",
    )
    table = NumberTable(
        "drift", "Energy after 1e5 steps over the initial energy", head, tuple(rows)
    )
    return Exhibit("drift", "Drift", words, tables=(table,))


def _refused(study: Stability) -> Exhibit:
    rows = [
        (*variant_row(c.variant), why)
        for c in study.cells
        if (why := study.done.records[c.key].why)
    ]
    table = NumberTable("refused", "Refused schemes and reasons", (*VARIANT, "why"), tuple(rows))
    return Exhibit("refused", "Refused", (), tables=(table,))
