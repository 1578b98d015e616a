"""Filling of a view with rows of a table, or of records: tables, charts, heat maps, sentences.

These are plain data that every drawer takes; nothing here draws.
"""

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import (
    Chart,
    Emphasis,
    Exhibit,
    Heat,
    Intervals,
    NumberTable,
    Series,
    TableCell,
    plain,
)
from validate.compare.row import MEASURED, VALUE, LongRow, selects
from validate.compare.view import View, texts
from validate.errors import ComparisonError, UsageError
from validate.numbers import (
    MISSING,
    digits,
    scale,
    shown_unit,
    significant,
    spaced,
    to_decimal_of,
    with_unit,
)
from validate.parameters import nearest_names
from validate.report.long_table import LongTable
from validate.report.views.standard import VIEWS
from validate.units import in_si, si_of, split

_TWO = 2.0  # standard uncertainties of an interval
_ON_ANOTHER = 0.01  # share of the largest range below which two lines draw one
_KPA = 1000.0  # Pa above which a chart's axis is in kPa
_NUMBERS = ("value", "sd", "expanded")  # in the unit of their row
_COUNTS = ("n", "point", "at")
_HEADINGS = {"label": "method", "method": "name"}
#: How words that answer something stand out, in every table.
WORDS: Mapping[str, Emphasis] = {
    "good enough": "good", "not good enough": "bad", "undecided": "open", "differs": "bad",
    "not distinguishable": "good", "no answer": "open", "nothing compared": "bad",
    "reproduced": "good", "not reproduced": "bad", "not reproducible as printed": "open",
    "not comparable": "open", "moved": "bad", "not computed": "bad", "other data": "open",
    "outlier": "bad",
}  # fmt: skip
Grid = dict[tuple[str, ...], dict[str, list[LongRow]]]


def filled_views(
    table: LongTable, own: Iterable[View] = (), *, standard: bool = True
) -> Iterator[tuple[View, Exhibit]]:
    """Yield the views of the registry where `standard`, then a run's `own`, each with its exhibit.

    One that is not the package's and cannot be filled costs a warning, and nothing else.
    """
    for view in (*(VIEWS if standard else ()), *own):
        yield view, VIEWS.answer(view, lambda v: filled(v, table), Exhibit("", ""))


def explained(view: View, table: LongTable) -> Exhibit:
    """Return the view, or, where it shows nothing, a sentence that names the condition that leaves
    no row. Raises as `filled`."""
    found = filled(view, table)
    if found != Exhibit(view.name, view.title):
        return found
    left = table.rows
    for column, wanted in view.rows.items():
        fits = selects(wanted)
        values = {str(getattr(row, column)) for row in left}
        count, left = len(left), tuple(row for row in left if fits(getattr(row, column)))
        if not left:
            hint = nearest_names(" ".join(map(str, texts(wanted))), values)  # type: ignore[arg-type]
            why = f"Of {count} rows none has {column} = {wanted!r}; {hint}."
            return replace(found, words=(why,))
    less = f" and a row of '{view.less}'" if view.less else ""
    why = f"{len(left)} rows fit; none has numbers for x = {view.x!r} and y = {view.y!r}{less}."
    return replace(found, words=(why,))


def filled(view: View, table: LongTable) -> Exhibit:
    """Return the view as an exhibit of its name and title; empty where no row fits.

    Raises `ComparisonError` where several rows are in one cell and the view does not say which
    counts, where units of one chart are mixed, or the unit to show is of another kind.
    """
    found = table.where(**view.rows).rows
    groups: dict[str, list[LongRow]] = {}
    for row in found:
        groups.setdefault(_label(row, view.each, table) if view.each else "", []).append(row)
    parts = []
    for key, rows in groups.items():  # the name and the title of one of several with the group's
        name, title = f"{view.name}_{key.replace('.', '_')}", f"{view.title}: {key}"
        parts.append((replace(view, name=name, title=title) if key else view, rows))
    one = Exhibit(view.name, view.title)
    match view.form:
        case "table":
            return replace(one, tables=tuple(_table(v, rows, table) for v, rows in parts))
        case "lines" | "points":
            charts = (_chart(v, rows, table) for v, rows in parts)
            return replace(one, charts=tuple(c for c in charts if c and (c.series or c.levels)))
        case "heat":
            heats = (_heat(v, rows, table) for v, rows in parts)
            return replace(one, heats=tuple(h for h in heats if np.isfinite(h.values).any()))
        case "intervals":
            bars = (_intervals(v, rows, table) for v, rows in parts)
            return replace(one, intervals=tuple(b for b in bars if b.labels))
        case "sentences":
            return replace(one, words=tuple(_sentence(view, row, table) for row in found))


# --- labels and units -----------------------------------------------------------------------------


def _label(row: LongRow, column: str, table: LongTable) -> str:
    """A column of a row as people read it: methods by their labels, loads with a space."""
    if column == "label":
        return next((m.label for m in table.methods if m.name == row.method), row.method)
    found = getattr(row, column)
    if column == "condition":
        return spaced(found)
    if column == "statistic" and found == VALUE:
        return ""
    return "" if found is None else str(found)


def _key(row: LongRow, columns: Iterable[str], table: LongTable) -> tuple[str, ...]:
    return tuple(_label(row, c, table) for c in columns)


def _number(row: LongRow, column: str) -> float | None:
    if column == "expanded":
        return None if row.sd is None else _TWO * row.sd
    found: float | None = getattr(row, column)
    return found


def _shown(unit: str, wanted: str) -> tuple[str, Callable[[float], float]]:
    """The unit that is shown of an SI unit, and what turns a number into it."""
    if not wanted:
        factor = scale(unit)
        return shown_unit(unit), lambda v: factor * v
    size = in_si(1.0, wanted, unit)
    if size is not None:
        return wanted, lambda v: v / size
    factor, inverse = si_of(wanted)
    if {unit, inverse} == {"s", "Hz"}:  # a rate is one over a time
        return wanted, lambda v: 1 / (factor * v) if v else float("inf")
    raise ComparisonError(f"a number in {unit} is not shown in {wanted}")


# --- tables ---------------------------------------------------------------------------------------


def _table(view: View, rows: Sequence[LongRow], table: LongTable) -> NumberTable:
    """Lines by the labels `x`, columns by the labels `by`; units in headings where one column has
    one, else in a column of their own, else beside each number."""
    labels, by = texts(view.x), texts(view.by)
    grid: Grid = {}
    for row in rows:
        line = grid.setdefault(_key(row, labels, table), {})
        line.setdefault(" ".join(filter(None, _key(row, by, table))), []).append(row)
    # Heading, label and column of what each column shows
    y = texts(view.y)
    keys = dict.fromkeys(" ".join(filter(None, _key(r, by, table))) for r in rows)
    if view.columns:
        parts = [(head, *text.partition(":")[::2]) for head, text in view.columns.items()]
        across = [(head.replace("*", star), key, column or y[0])
                  for head, label, column in parts
                  for key, star in _matched(label, keys)]  # fmt: skip
    else:
        named = len(y) > 1 or "" in keys
        across = [(" ".join(filter(None, (key, column if named else ""))), key, column)
                  for key in keys for column in y]  # fmt: skip
    cells = [[_cell(view, line.get(key, []), column, _check(line)) for _, key, column in across]
             for line in grid.values()]  # fmt: skip
    kept = [j for j in range(len(across)) if any(plain(c[j]) not in (None, "") for c in cells)]
    units = [_units(c[j] for c in cells) for j in kept]
    by_line = [_units(c[j] for j in kept) for c in cells]
    in_heads = all(len(u) <= 1 for u in units)
    in_lines = not in_heads and all(len(u) <= 1 for u in by_line)
    heads = [_HEADINGS.get(c, c) if "label" in labels else c for c in labels]
    heads += ["unit"] if in_lines else []
    for j, found in zip(kept, units, strict=True):
        unit = shown_unit(next(iter(found))) if in_heads and found else ""
        heads.append(f"{across[j][0]} / {view.unit or unit}".removesuffix(" / "))
    lines: list[tuple[TableCell | str, ...]] = []
    for (key, line), own, found in zip(grid.items(), cells, by_line, strict=True):
        first = next(r for rs in line.values() for r in rs)
        unit = shown_unit(next(iter(found), "1"))
        lines.append((
            *(TableCell(t, emphasis="" if i else "strong") for i, t in enumerate(key)),
            *([unit] if in_lines else []),
            *(_written(view, own[j], in_cell=not (in_heads or in_lines)) for j in kept),
            *(_also(line, name, first) for name in view.also),
        ))  # fmt: skip
    heads += ["values" if name == "n" else name for name in view.also]
    return NumberTable(
        "", view.title, tuple(heads), tuple(lines), view.caption, view.folded, view.below
    )


def _matched(label: str, keys: Iterable[str]) -> list[tuple[str, str]]:
    """The label itself, or the keys that fit one with a star, and what the star stands for."""
    if "*" not in label:
        return [(label, "")]
    before, _, behind = label.partition("*")
    return [(k, k[len(before) : len(k) - len(behind)]) for k in keys
            if k.startswith(before) and k.endswith(behind)]  # fmt: skip


def _check(line: Mapping[str, list[LongRow]]) -> LongRow | None:
    """The one check that a line is of; None where it is of none or of several."""
    checks = [row for rows in line.values() for row in rows if row.part == "check"]
    return checks[0] if len(checks) == 1 else None


def _cell(view: View, rows: list[LongRow], column: str, check: LongRow | None) -> TableCell:
    if len(rows) > 1 and not view.several:
        first = rows[0]
        raise ComparisonError(
            f"view '{view.name}': {len(rows)} rows are in one cell ({first.method} {first.name}); "
            "name more columns in x or by, narrower rows, or `several`"
        )
    row = rows[-1] if rows else None
    if view.several == "largest":
        row = max(rows, key=lambda r: abs(_number(r, column) or 0.0), default=None)
    if row is None:
        return TableCell(None)
    if column in _NUMBERS:
        number = _number(row, column)
        return TableCell(number, row.unit, _to_decimal(view, row, number, check))
    found = getattr(row, column)
    if column in _COUNTS:
        return TableCell(found)
    text = str(found or "")
    decides = column != "validation" or row.acceptance in ("", "no requirement")
    return TableCell(text, emphasis=WORDS.get(text.partition(" (")[0], "") if decides else "")


def _read(view: View, value: float | None, unit: str) -> str:
    """A number with its unit, as the view shows it."""
    if value is None or not view.unit:
        return with_unit(value, unit)
    return f"{significant(_shown(unit, view.unit)[1](value))} {view.unit}"


def _to_decimal(view: View, row: LongRow, number: float | None, check: LongRow | None) -> str:
    """A number of a check in the shown unit, to the decimal of two digits of 2 u_val; the terms of
    u_val to one more. "" where that is no rule: a limit that it would change has its own digits.
    """
    turn = _shown(row.unit, view.unit)[1]
    if check is None or check.sd is None or number is None or row.unit != check.unit or turn(0.0):
        return ""
    term = 0.1 if row.part.startswith("check.u_") else 1.0
    found = to_decimal_of(term * turn(_TWO * check.sd), turn(number))[1]
    changed = float(digits(found)) != float(f"{turn(number):.9g}")
    return "" if row.part == "check.limit" and changed else found


def _units(cells: Iterable[TableCell]) -> set[str]:
    return {c.unit for c in cells if c.unit and c.value is not None}


def _written(view: View, cell: TableCell, *, in_cell: bool) -> TableCell:
    """The number in the unit that heading or line names, or, where neither does, with its own."""
    if cell.value is None or not cell.unit:
        return cell
    value = float(cell.value)
    if in_cell and not view.unit:
        told = f"{cell.text} {shown_unit(cell.unit)}".strip() if cell.text else ""
        return TableCell(told or with_unit(value, cell.unit))
    return TableCell(_shown(cell.unit, view.unit)[1](value), text=cell.text)


def _also(line: Mapping[str, list[LongRow]], name: str, first: LongRow) -> TableCell:
    values = list(dict.fromkeys(getattr(r, name) for rs in line.values() for r in rs))
    if len(values) == 1:
        return TableCell(values[0])
    return TableCell(getattr(first, name), text=", ".join(str(v) for v in values if v is not None))


# --- charts ---------------------------------------------------------------------------------------


def _chart(view: View, rows: Sequence[LongRow], table: LongTable) -> Chart | None:
    """y over x, a series for each label of `by`; the one row of a label that has no x is a level.
    Rows without a number are left out; None where none is left."""
    rows = [r for r in (_less(view, rows, table) if view.less else rows) if r.value is not None]
    if not rows:
        return None
    unit, turn = _axis(view, rows)
    x_name, x_unit, x_of = _abscissa(view, rows, table)
    # The labels of `by` that tell rows apart; the first one always does
    column = {"label": "method"}
    first, *others = [
        b for i, b in enumerate(texts(view.by))
        if i == 0 or len({getattr(r, column.get(b, b)) for r in rows}) > 1
    ] or [""]  # fmt: skip
    lines: dict[tuple[str, str], list[tuple[float, float, float | None]]] = {}
    levels = []
    for row in rows:
        at, value = x_of(row), turn(row.value or 0.0)
        label = _label(row, first, table) if first else view.title
        if at is None:
            levels.append((label, value))
            continue
        half = None if row.sd is None else _TWO * abs(turn(row.sd))
        of = ", ".join(filter(None, _key(row, others, table)))
        lines.setdefault((label, of), []).append((at, value, half))
    counts = Counter(label for label, _ in levels)
    levels = [(label, y) for label, y in levels if counts[label] == 1]
    series: list[Series] = []
    widest = 0.0
    for (label, of), points in lines.items():
        x, y = np.array([p[:2] for p in points], dtype=float).T
        halves = [p[2] for p in points]
        if "sd" in texts(view.y) and all(h is not None for h in halves):
            band = np.array(halves, dtype=float)
            widest = max(widest, float(band.max()))
            series.append(Series(label, x, y - band, "band", y + band, of))
        marked = view.form == "points" or label == MEASURED
        series.append(Series(label, x, y, "points" if marked else "line", of=of))
    checked = {label for m in table.methods if m.accepted for label in (m.name, m.label)}
    drawn, hidden = _apart(series, checked)
    quantity = _common(r.quantity for r in rows) or "value"
    quantity = f"{quantity} − {view.less}" if view.less else quantity
    return Chart(
        view.name, view.title, f"{x_name} / {x_unit}".removesuffix(" / "),
        f"{quantity} / {unit}".removesuffix(" / "), drawn, tuple(levels), view.log,
        caption=f"{view.caption}{hidden}", linear=widest if view.less else 0.0,
    )  # fmt: skip


def _apart(series: list[Series], checked: Collection[str]) -> tuple[tuple[Series, ...], str]:
    """The series without lines that lie on another, and a sentence that names these; a line of a
    checked method is the one that stays."""
    lines = [s for s in series if s.style == "line"]
    lines.sort(key=lambda s: s.label not in checked)
    span = max((float(np.ptp(s.y)) for s in lines), default=0.0)
    drawn: list[Series] = []
    hidden = []
    for s in lines:
        on = next((o for o in drawn if o.of == s.of and np.array_equal(o.x, s.x)
                   and np.abs(o.y - s.y).max() <= _ON_ANOTHER * span), None)  # fmt: skip
        if on is None:
            drawn.append(s)
        else:
            hidden.append(f"{s.label} (on {on.label})")
    gone = {id(s) for s in lines} - {id(s) for s in drawn}
    names = {s.name for s in lines if id(s) in gone}
    kept = tuple(s for s in series if s.name not in names)
    said = f" Not drawn, as they coincide with another line: {'; '.join(dict.fromkeys(hidden))}."
    return kept, said if hidden else ""


def _less(view: View, rows: Sequence[LongRow], table: LongTable) -> Iterator[LongRow]:
    """Rows minus those of one method at the same time; what that one lacks is left out."""

    def place(row: LongRow) -> tuple[object, ...]:
        return row.recording, row.quantity, row.statistic, row.condition, row.at, row.point

    of = {place(r): r.value for r in table.where(**{**view.rows, "method": view.less}).rows}
    for row in rows:
        reference = of.get(place(row))
        if row.value is not None and reference is not None:
            sd = row.sd if row.method == view.less else None
            yield row._replace(value=row.value - reference, sd=sd)


def _axis(view: View, rows: Sequence[LongRow]) -> tuple[str, Callable[[float], float]]:
    units = list(dict.fromkeys(r.unit for r in rows if r.value is not None))
    if len(units) > 1:
        raise ComparisonError(
            f"view '{view.name}': units {' and '.join(units)} on one axis; choose rows of one, or "
            'each="unit"'
        )
    unit = units[0] if units else "1"
    largest = max((abs(r.value) for r in rows if r.value is not None), default=0.0)
    wanted = view.unit or ("kPa" if unit == "Pa" and largest >= _KPA else "")
    return _shown(unit, wanted)


def _abscissa(
    view: View, rows: Sequence[LongRow], table: LongTable
) -> tuple[str, str, Callable[[LongRow], float | None]]:
    """Name and unit of what lies across, and a row's number there: a column of numbers, or the
    value of a quantity at the same time."""
    (name,) = texts(view.x)
    if name in _COUNTS:
        if name != "at":
            return name, "", lambda row: getattr(row, name)
        units = {_unit_of(row.condition) for row in rows}
        unit = units.pop() if len(units) == 1 else "1"
        shown, turn = ("s", float) if unit == "s" else _shown(unit, "")
        return ("time" if unit == "s" else "load"), shown, lambda row: (
            None if row.at is None else turn(row.at))  # fmt: skip
    if name in _NUMBERS:
        unit, turn = _axis(view, rows)
        return name, unit, lambda row: (
            None if (v := _number(row, name)) is None else turn(v))  # fmt: skip
    parts = tuple({row.part for row in rows})
    found = [r for r in table.where(part=parts).rows if name in (r.quantity, r.role)]
    if not found:
        known = {r.quantity for r in table.rows if r.part in parts}
        if name in LongRow._fields:
            raise UsageError(f"view '{view.name}': '{name}' holds no numbers; x may be 'at'")
        raise UsageError(f"view '{view.name}': no quantity '{name}'; {nearest_names(name, known)}")
    found = [r for r in found if r.quantity == found[0].quantity]
    held = {(r.recording, r.method, r.at, r.point): r.value for r in found}
    shared = {(r.recording, r.at, r.point): r.value for r in found if r.method in ("", MEASURED)}
    shown, turn = _shown(found[0].unit if found else "1", "")

    def value(row: LongRow) -> float | None:
        place = (row.recording, row.at, row.point)
        x = held.get((row.recording, row.method, row.at, row.point), shared.get(place))
        return None if x is None else turn(x)

    return found[0].quantity, shown, value


def _unit_of(condition: str) -> str:
    """The SI unit of a time or load such as 9mm; seconds where it is none."""
    found = split(condition)
    return si_of(found[1])[1] if found and found[1] else "s"


def _common(names: Iterable[str]) -> str:
    found = list(dict.fromkeys(names))
    return found[0] if len(found) == 1 else ""


def _heat(view: View, rows: Sequence[LongRow], table: LongTable) -> Heat:
    unit, turn = _axis(view, rows)
    across, down = texts(view.x), texts(view.by)
    columns = list(dict.fromkeys(" ".join(_key(r, across, table)) for r in rows))
    lines = list(dict.fromkeys(" ".join(_key(r, down, table)) for r in rows))
    values = np.full((len(lines), len(columns)), np.nan)
    for row in rows:
        if row.value is not None:
            i, j = (lines.index(" ".join(_key(row, down, table))),
                    columns.index(" ".join(_key(row, across, table))))  # fmt: skip
            values[i, j] = turn(row.value)
    quantity = f"{_common(r.quantity for r in rows) or 'value'} / {unit}".removesuffix(" / ")
    return Heat(view.name, view.title, " ".join(across), " ".join(down), tuple(columns),
                tuple(lines), values, quantity)  # fmt: skip


def _intervals(view: View, rows: Sequence[LongRow], table: LongTable) -> Intervals:
    """Each row's value ± 2 sd, and its limit where it has one."""
    limits = {_place(r): r.value for r in table.where(part="check.limit").rows}
    names, numbers, words, quantities = [], [], [], []
    for row in rows:
        if row.value is None or row.sd is None:
            continue
        limit = limits.get(_place(row))
        names.append(": ".join(filter(None, _key(row, texts(view.x), table))))
        quantities.append(row.quantity)
        numbers.append((row.value, _TWO * row.sd, limit))
        unit = view.unit or shown_unit(row.unit)
        told = ((v, _to_decimal(view, row, v, row)) for v in (row.value, _TWO * row.sd))
        words.append((*(f"{t} {unit}".strip() if t else _read(view, v, row.unit) for v, t in told),
                      _read(view, limit, row.unit) if limit else MISSING,
                      row.acceptance if limit else row.validation))  # fmt: skip
    value, half, most = np.array(numbers, dtype=float).reshape(-1, 3).T  # None becomes NaN
    return Intervals(view.name, view.title, tuple(names), value, half, most,
                     tuple(f"{v} ± {u} of {most}" for v, u, most, _ in words),
                     tuple(w[3] for w in words), view.caption, tuple(quantities))  # fmt: skip


def _place(row: LongRow) -> tuple[str, ...]:
    return row.recording, row.method, row.quantity, row.statistic, row.condition


# --- sentences ------------------------------------------------------------------------------------


def _sentence(view: View, row: LongRow, table: LongTable) -> str:
    columns = (*LongRow._fields, "name", "label")
    fields: dict[str, Any] = {c: _label(row, c, table) for c in columns}
    fields |= {c: _read(view, _number(row, c), row.unit) for c in _NUMBERS}
    try:
        return view.text.format_map(fields)
    except (KeyError, ValueError, IndexError, AttributeError) as error:
        raise UsageError(f"view '{view.name}': text '{view.text}' ({error})") from None


# --- tables and charts declared over records: a heading and the attribute of each ----------------

Shown = str | Callable[[Any], Any]  # a path as "step.p50", or a function of the record
Axis = tuple[str, Shown]  # what stands at an axis, and what is drawn along it
Groups = Mapping[str, Sequence[Any]]  # records by the label of their line
_NONE: Mapping[str, Any] = MappingProxyType({})


def table(
    name: str,
    title: str,
    records: Iterable[Any],
    columns: Mapping[str, Shown],
    note: str = "",
    *,
    folded: bool = False,
    below: str = "",
) -> NumberTable:
    """Return a row for each record and a column for each heading.

    Numbers of records are SI; a heading as "time / us" shows them in its unit. The other arguments
    are those of `NumberTable`. Raises `AttributeError` for a path that a record does not have.
    """
    sizes = [per_unit(heading) for heading in columns]
    rows = tuple(
        tuple(_scaled(value(r, of), by) for of, by in zip(columns.values(), sizes, strict=True))
        for r in records
    )
    return NumberTable(name, title, tuple(columns), rows, note, folded, below)


def objects(records: Iterable[Any], members: Mapping[str, Shown]) -> list[dict[str, Any] | None]:
    """Return each record as a JSON object of these members, numbers as they are; None as null."""
    return [r and {name: value(r, of) for name, of in members.items()} for r in records]


def chart(
    name: str,
    title: str,
    x: Axis,
    y: Axis,
    points: Groups = _NONE,
    lines: Groups = _NONE,
    levels: Mapping[str, float] = _NONE,
    log: Literal["", "x", "y", "xy"] = "",
    caption: str = "",
) -> Chart:
    """Return y over x of each group of records as `points` or as `lines`, and SI `levels` of y.

    Units are as in `table`. Records that lack x or y are left out, and groups of such records.
    """
    series = []
    styles: Mapping[Literal["points", "line"], Groups] = {"points": points, "line": lines}
    for style, groups in styles.items():
        for label, records in groups.items():
            drawn = [r for r in records if None not in (value(r, x[1]), value(r, y[1]))]
            if drawn:
                series.append(Series(label, _along(x, drawn), _along(y, drawn), style))
    by = per_unit(y[0])
    named = tuple((label, by * level) for label, level in levels.items())
    return Chart(name, title, x[0], y[0], tuple(series), named, log, caption)


def grouped(records: Iterable[Any], by: Shown) -> dict[str, list[Any]]:
    """Return the records by what `by` shows of them, in the order of its first appearance."""
    found: dict[str, list[Any]] = {}
    for record in records:
        found.setdefault(str(value(record, by)), []).append(record)
    return found


def value(record: Any, of: Shown) -> Any:
    """Return what `of` shows of a record: by its path attributes, keys of mappings and numbers of
    tuples; None where a part of the path is None."""
    if callable(of):
        return of(record)
    for name in of.split("."):
        if isinstance(record, Mapping):
            record = record.get(name)
        elif record is not None:
            record = record[int(name)] if name.isdigit() else getattr(record, name)
    return record


def sized(of: Shown, unit: Shown = "unit") -> Shown:
    """Return what shows a number in the SI unit that `unit` shows of the same record."""
    return lambda record: TableCell(value(record, of), value(record, unit))


def per_unit(heading: str) -> float:
    """Return how many of its unit a heading as "error / mm (paired)" shows of one SI unit."""
    name, _, unit = heading.rpartition(" / ")
    return 1 / si_of(unit.partition(" (")[0])[0] if name else 1.0


def _scaled(found: Any, by: float) -> Any:
    return by * found if isinstance(found, float) and by != 1 else found


def _along(axis: Axis, records: Sequence[Any]) -> Floats:
    return per_unit(axis[0]) * np.array([value(r, axis[1]) for r in records], dtype=np.float64)
