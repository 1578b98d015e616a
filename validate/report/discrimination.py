"""Which effects a recording can distinguish: errors against noise, effects against sensors."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from validate.compare.effects import TELLS_APART, Change, Effect
from validate.compare.exhibit import Exhibit, NumberTable, TableCell
from validate.compare.result import Result
from validate.report.numbers import at_load, fixed, scale, shown_unit, text, with_unit
from validate.report.over_noise import over_noise

_DECIMALS = {"m": 2, "N": 3, "Pa": 0}
_EFFECTS = (
    "effect", "doc", "quantity", "rms", "max", "unit", "separation", "seen", "would_see",
)  # fmt: skip


def discrimination(result: Result) -> Exhibit:
    """Errors over noise, the discrimination matrix, the error budget and what follows from them."""
    effects = _recorded(result)
    return Exhibit(
        "discrimination",
        "Which effects this recording can distinguish",
        tuple(map(_sentence, effects)),
        (_matrix(effects), _budget(effects)) if effects else (),
        pictures=over_noise(result),
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
        "rms change over the uncertainty of the mean (no unit). Above 2 (coloured, with a tick) "
        "the recording shows the effect.",
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
        f"change of quantities with several values.",
        ("effect", *heads, "measured by (any load)", "a sensor that would measure it"),
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
        return f"{opening}: this recording can distinguish it, by {_listed(seen)}."
    best = max(effect.changes, key=lambda c: c.separation, default=None)
    size = ""
    if best is not None and best.separation > 0:
        size = (
            f" (best: {best.name}, {with_unit(best.rms, best.unit, 2)}, separation "
            f"{best.separation:.1f} of {TELLS_APART:g} needed)"
        )
    if effect.would_see:
        return (
            f"{opening}: cannot be distinguished{size}; try sensors: {_listed(effect.would_see)}."
        )
    return f"{opening}: cannot be distinguished{size}; no listed sensor measures it."


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1]
