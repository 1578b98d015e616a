"""What this recording can tell apart: errors against noise, effects against sensors, sentences."""

from dataclasses import dataclass, replace

import numpy as np
from matplotlib.figure import Figure
from scipy.special import chdtri

from validate.arrays import rms
from validate.compare.effects import TELLS_APART, Change, Effect
from validate.compare.residual import Residual
from validate.compare.result import MethodResult, Result
from validate.report.numbers import at_load, fixed, scale, shown_unit, text, with_unit
from validate.report.observed import finished, last_residual
from validate.report.page import (
    Cell,
    Items,
    Paragraph,
    Picture,
    Section,
    Table,
    cells,
    section,
)
from validate.report.style import MEASURED, NOISE, draw, looks

_DECIMALS = {"m": 2, "N": 3, "Pa": 0}
_BUDGET = ("contour", "marker.inplane", "marker.vertical", "force.plate", "pressure")


@dataclass(frozen=True)
class _Row:
    """One quantity: every method's rms error over the noise of the measurement."""

    quantity: str
    noise: str
    band: tuple[float, float]
    ratios: tuple[tuple[MethodResult, float], ...]


def discrimination(result: Result) -> Section | None:
    """Errors over noise, the discrimination matrix, the error budget and what follows from them."""
    effects = _recorded(result)
    return section(
        "discrimination",
        "What this recording can tell apart",
        _sentences(effects),
        _noise_picture(result),
        _matrix(effects),
        _budget(effects),
    )


def _recorded(result: Result) -> tuple[Effect, ...]:
    """The effects in what a sensor measured: a reference without noise separates everything."""
    residuals = [r for m in result.methods for r in m.residuals.values()]
    measured = {r.name for r in residuals if r.sd > 0}
    return tuple(
        replace(e, changes=tuple(c for c in e.changes if c.name in measured))
        for e in result.effects
    )


def _noise_picture(result: Result) -> Picture | None:
    rows = _rows(result)
    if not rows:
        return None
    pixels = draw(lambda f: _dots(f, result, rows), 9.0, 1.5 + 0.42 * len(rows))
    over_time = all(r.load == "all" for m in finished(result) for r in m.residuals.values())
    where = at_load("all") if over_time else "at the last load"
    return Picture(
        "errors_over_noise",
        f"Rms error of every model {where} over the rms that measurement noise alone gives "
        "(no unit, logarithmic). Grey: where noise alone puts 95 % of repetitions (chi-square with "
        "the number of values); right of it the recording sees the model's error. Where all models "
        "lie on grey, that quantity cannot choose between them. Ratios below 0.02 lie at 0.02.",
        "Dot chart: rms error over measurement noise for each quantity and model.",
        pixels,
    )


def _rows(result: Result) -> list[_Row]:
    done = finished(result)
    quantities = dict.fromkeys(r.quantity for m in done for r in m.residuals.values() if r.sd > 0)
    rows = []
    for quantity in quantities:
        pairs = [(m, last_residual(m, quantity)) for m in done]
        seen = [(m, r) for m, r in pairs if r is not None]
        ratios = tuple((m, rms(r.values) / _noise(r)) for m, r in seen)
        first = seen[0][1]
        dof = first.values.size
        low, high = (float(np.sqrt(chdtri(dof, p) / dof)) for p in (0.975, 0.025))
        rows.append(_Row(quantity, with_unit(_noise(first), first.unit), (low, high), ratios))
    return rows


def _noise(residual: Residual) -> float:
    """The rms (SI) that the noise of the measurement gives a perfect model."""
    c = residual.values.shape[1]
    return float(np.sqrt(c * (residual.sd**2 + residual.systematic**2)))


def _dots(figure: Figure, result: Result, rows: list[_Row]) -> None:
    ax, styles = figure.subplots(), looks(result)
    ax.axvline(1, color=MEASURED, lw=0.8)
    named: set[str] = set()
    for y, row in enumerate(rows):
        ax.fill_betweenx([y - 0.42, y + 0.42], *row.band, color=NOISE, lw=0)
        for j, (method, ratio) in enumerate(row.ratios):
            look = styles[method.name]
            lift = 0.5 * (j / max(len(row.ratios) - 1, 1) - 0.5)
            label = None if method.name in named else method.label
            named.add(method.name)
            ax.plot(max(ratio, 0.02), y + lift, look.point, color=look.colour, ms=6, label=label)
    ax.set_xscale("log")
    low, high = ax.get_xlim()
    ax.set_xlim(max(min(low, 0.09), 0.018), max(high, 11))
    ax.xaxis.set_major_formatter(lambda v, _: f"{v:g}")
    ax.set_yticks(range(len(rows)), [f"{r.quantity}\nnoise {r.noise}" for r in rows], fontsize=8)
    ax.set_ylim(len(rows) - 0.5, -0.5)
    ax.set_xlabel("rms error / rms of the noise")
    figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=3)


def _quantity(change: Change) -> str:
    return change.name.split("@")[0]


def _largest(effect: Effect, quantity: str) -> Change | None:
    """The load at which an effect is seen best in a quantity."""
    found = [c for c in effect.changes if _quantity(c) == quantity]
    return max(found, key=lambda c: c.separation, default=None)


def _matrix(effects: tuple[Effect, ...]) -> Table | None:
    if not effects:
        return None
    sensors = list(dict.fromkeys(_quantity(c) for e in effects for c in e.changes))
    rows = tuple(
        (Cell(f"{e.name}: {e.doc}"), *(_separation(_largest(e, q)) for q in sensors))
        for e in effects
    )
    return Table(
        "Separation of each effect in each recorded quantity at the load where it is largest: the "
        "rms change over the uncertainty that averaging leaves (no unit). Above 2 (coloured, with "
        "a tick) the recording sees the effect.",
        ("effect", *sensors),
        rows,
    )


def _separation(change: Change | None) -> Cell:
    if change is None:
        return Cell("–")
    if change.separation > TELLS_APART:
        return Cell(f"✓ {_figure(change.separation)}", "good")
    return Cell(_figure(change.separation))


def _figure(separation: float) -> str:
    return fixed(separation, 1) if separation < 10 else text(separation, digits=2)


def _budget(effects: tuple[Effect, ...]) -> Table | None:
    if not effects:
        return None
    load = effects[0].changes[-1].name.split("@")[-1] if effects[0].changes else ""
    found = dict.fromkeys(_quantity(c) for e in effects for c in e.changes)
    columns = [q for q in _BUDGET if q in found] or list(found)
    changes = [[_change(e, f"{q}@{load}") for q in columns] for e in effects]
    used = [i for i in range(len(columns)) if any(row[i] for row in changes)]
    rows = []
    for effect, row in zip(effects, changes, strict=True):
        figures = [_moved(row[i], columns[i]) for i in used]
        seen = ", ".join(dict.fromkeys(n.split("@")[0] for n in effect.seen_by)) or "none"
        would = ", ".join(effect.would_see) or "none of those listed"
        rows.append((Cell(f"{effect.name}: {effect.doc}"), *figures, *cells(seen, would)))
    units = [next((shown_unit(c.unit) for r in changes if (c := r[i])), "") for i in used]
    heads = [f"{columns[i]} / {u}" for i, u in zip(used, units, strict=True)]
    return Table(
        f"Error budget: what each effect moves {at_load(load)}; rms and, in brackets, largest "
        "change; a force or pressure has one value.",
        ("effect", *heads, "seen by (any load)", "a sensor that would see it"),
        tuple(rows),
        words=(0, len(used) + 1, len(used) + 2),
    )


def _change(effect: Effect, name: str) -> Change | None:
    return next((c for c in effect.changes if c.name == name), None)


def _moved(change: Change | None, quantity: str) -> Cell:
    if change is None:
        return Cell("–")
    size = _rounded(change.rms, change.unit)
    if quantity in ("force.plate", "pressure"):
        return Cell(size)
    return Cell(f"{size} ({_rounded(change.max, change.unit)})")


def _rounded(value: float, unit: str) -> str:
    """Fixed decimals, so that a column compares at a glance; "< 0.01" is a change, "0" is none."""
    decimals = _DECIMALS.get(unit, 3)
    shown = value * scale(unit)
    if shown <= 1e-6:
        return "0"
    smallest = 10.0**-decimals
    return fixed(shown, decimals) if shown >= smallest / 2 else f"< {fixed(smallest, decimals)}"


def _sentences(effects: tuple[Effect, ...]) -> Items | Paragraph | None:
    if not effects:
        return None
    return Items(tuple(_sentence(e) for e in effects))


def _sentence(effect: Effect) -> str:
    seen = list(dict.fromkeys(name.split("@")[0] for name in effect.seen_by))
    opening = f"{effect.name.capitalize()} ({effect.doc})"
    if seen:
        return f"{opening}: this recording can tell it apart, by {_listed(seen)}."
    best = max(effect.changes, key=lambda c: c.separation, default=None)
    size = ""
    if best is not None and best.separation > 0:
        size = (
            f" (best: {best.name}, {with_unit(best.rms, best.unit, 2)}, separation "
            f"{best.separation:.1f} of the {TELLS_APART:g} needed)"
        )
    if effect.would_see:
        return f"{opening}: cannot be told apart{size}; would decide: {_listed(effect.would_see)}."
    return f"{opening}: cannot be told apart{size}, nor would any sensor listed decide."


def _listed(names: list[str] | tuple[str, ...]) -> str:
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1]
