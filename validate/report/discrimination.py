"""What this recording can tell apart: errors against noise, effects against sensors, sentences."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.figure import Figure
from scipy.special import chdtri

from validate.arrays import rms
from validate.compare.effects import TELLS_APART, Change, Effect
from validate.compare.exhibit import Exhibit, NumberTable, Picture, TableCell
from validate.compare.residual import Residual
from validate.compare.result import MethodResult, Result
from validate.report.numbers import at_load, fixed, scale, shown_unit, text, with_unit
from validate.report.observed import finished, last_residual
from validate.report.style import MEASURED, NOISE, draw, looks

_DECIMALS = {"m": 2, "N": 3, "Pa": 0}
_EFFECTS = (
    "effect", "doc", "quantity", "rms", "max", "unit", "separation", "seen", "would_see",
)  # fmt: skip


@dataclass(frozen=True)
class _Row:
    """One quantity: every method's rms error over the noise of the measurement."""

    quantity: str
    noise: str
    band: tuple[float, float]
    ratios: tuple[tuple[MethodResult, float], ...]


def discrimination(result: Result) -> Exhibit:
    """Errors over noise, the discrimination matrix, the error budget and what follows from them."""
    effects = _recorded(result)
    return Exhibit(
        "discrimination",
        "What this recording can tell apart",
        tuple(map(_sentence, effects)),
        (_matrix(effects), _budget(effects)) if effects else (),
        pictures=_over_noise(result),
        data=(_all_changes(result.effects),),
    )


def _recorded(result: Result) -> tuple[Effect, ...]:
    """The effects in what a sensor measured: a reference without noise separates everything."""
    residuals = [r for m in result.methods for r in m.residuals.values()]
    measured = {r.name for r in residuals if r.sd > 0}
    return tuple(
        replace(e, changes=tuple(c for c in e.changes if c.name in measured))
        for e in result.effects
    )


def _all_changes(effects: tuple[Effect, ...]) -> NumberTable:
    rows = tuple(
        (e.name, e.doc, c.name, TableCell(c.rms), TableCell(c.max), c.unit,
         TableCell(c.separation), c.name in e.seen_by, "; ".join(e.would_see))
        for e in effects
        for c in e.changes
    )  # fmt: skip
    return NumberTable("effects", "Effects", _EFFECTS, rows)


# --- errors over noise ---------------------------------------------------------------------------


def _over_noise(result: Result) -> tuple[Picture, ...]:
    rows = _rows(result)
    if not rows:
        return ()
    pixels = draw(lambda f: _dots(f, result, rows), 9.0, 1.5 + 0.42 * len(rows))
    over_time = all(r.load == "all" for m in finished(result) for r in m.residuals.values())
    where = at_load("all") if over_time else "at the last load"
    shown = Picture(
        "errors_over_noise",
        f"Rms error of every model {where} over the rms that measurement noise alone gives "
        "(no unit, logarithmic). Grey: where noise alone puts 95 % of repetitions (chi-square with "
        "the number of values); right of it the recording sees the model's error. Where all models "
        "lie on grey, that quantity cannot choose between them. Ratios below 0.02 lie at 0.02.",
        "Dot chart: rms error over measurement noise for each quantity and model.",
        pixels,
    )
    return (shown,)


def _rows(result: Result) -> list[_Row]:
    done = finished(result)
    quantities = dict.fromkeys(r.quantity for m in done for r in m.residuals.values() if r.sd > 0)
    return [_row(done, quantity) for quantity in quantities]


def _row(done: Iterable[MethodResult], quantity: str) -> _Row:
    seen = [(m, r) for m in done if (r := last_residual(m, quantity)) is not None]
    ratios = tuple((m, rms(r.values) / _noise(r)) for m, r in seen)
    first = seen[0][1]
    dof = first.values.size
    low, high = (float(np.sqrt(chdtri(dof, p) / dof)) for p in (0.975, 0.025))
    return _Row(quantity, with_unit(_noise(first), first.unit), (low, high), ratios)


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


# --- effects against sensors ---------------------------------------------------------------------


def _quantity(change: Change) -> str:
    return change.name.split("@")[0]


def _quantities(effects: Iterable[Effect]) -> list[str]:
    return list(dict.fromkeys(_quantity(c) for e in effects for c in e.changes))


def _matrix(effects: tuple[Effect, ...]) -> NumberTable:
    sensors = _quantities(effects)
    rows = tuple(
        (f"{e.name}: {e.doc}", *(_separation(_largest(e, q)) for q in sensors)) for e in effects
    )
    return NumberTable(
        "",
        "Separation of each effect in each recorded quantity at the load where it is largest: the "
        "rms change over the uncertainty that averaging leaves (no unit). Above 2 (coloured, with "
        "a tick) the recording sees the effect.",
        ("effect", *sensors),
        rows,
    )


def _largest(effect: Effect, quantity: str) -> Change | None:
    """The load at which an effect is seen best in a quantity."""
    found = [c for c in effect.changes if _quantity(c) == quantity]
    return max(found, key=lambda c: c.separation, default=None)


def _separation(change: Change | None) -> TableCell | None:
    if change is None:
        return None
    size = change.separation
    words = fixed(size, 1) if size < 10 else text(size, digits=2)
    return TableCell(size, text=words, emphasis="good" if size > TELLS_APART else "")


def _budget(effects: tuple[Effect, ...]) -> NumberTable:
    load = effects[0].changes[-1].name.split("@")[-1] if effects[0].changes else ""
    moved = {(e.name, _quantity(c)): c for e in effects for c in e.changes
             if c.name.endswith(f"@{load}")}  # fmt: skip
    columns = [q for q in _whole(_quantities(effects)) if any(key[1] == q for key in moved)]
    units = [next(c.unit for (_, name), c in moved.items() if name == q) for q in columns]
    rows = tuple(
        (f"{e.name}: {e.doc}", *(_moved(moved.get((e.name, q))) for q in columns),
         ", ".join(_seen(e)) or "none", ", ".join(e.would_see) or "none of those listed")
        for e in effects
    )  # fmt: skip
    heads = (f"{q} / {shown_unit(unit)}" for q, unit in zip(columns, units, strict=True))
    return NumberTable(
        "",
        f"Error budget: what each effect moves {at_load(load)}; rms and, in brackets, largest "
        "change of what has more than one value.",
        ("effect", *heads, "seen by (any load)", "a sensor that would see it"),
        rows,
    )


def _whole(quantities: Sequence[str]) -> list[str]:
    """Those that are no part of another: "a.b" is one of "a"; the matrix has all of them."""
    return [q for q in quantities if not any(q.startswith(f"{other}.") for other in quantities)]


def _seen(effect: Effect) -> list[str]:
    return list(dict.fromkeys(name.split("@")[0] for name in effect.seen_by))


def _moved(change: Change | None) -> TableCell | None:
    if change is None:
        return None
    words = _rounded(change.rms, change.unit)
    if change.max > (1 + 1e-9) * change.rms:
        words += f" ({_rounded(change.max, change.unit)})"
    return TableCell(change.rms, text=words)


def _rounded(value: float, unit: str) -> str:
    """Fixed decimals, so that a column compares at a glance; "< 0.01" is a change, "0" is none."""
    decimals = _DECIMALS.get(unit, 3)
    shown = value * scale(unit)
    if shown <= 1e-6:
        return "0"
    smallest = 10.0**-decimals
    return fixed(shown, decimals) if shown >= smallest / 2 else f"< {fixed(smallest, decimals)}"


# --- in words ------------------------------------------------------------------------------------


def _sentence(effect: Effect) -> str:
    opening, seen = f"{effect.name.capitalize()} ({effect.doc})", _seen(effect)
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


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1]
