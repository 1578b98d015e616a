"""Specimens in one export: adjacent, stacked or labelled, and their sizes in a header."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from validate.arrays import Floats
from validate.errors import RecordingError, UsageError
from validate.recording.tables.blocks import refuse_text, specimen_label
from validate.recording.tables.columns import (
    Kind,
    MissingColumnError,
    Pick,
    Said,
    columns_called,
    excursion,
    needed_pick,
    picked,
    role_of,
    said_pick,
    time_column,
    unnamed_column,
)
from validate.recording.tables.table import Column, Table, looks_numeric, number, split_unit
from validate.recording.tables.vocabulary import (
    ENGINEERING,
    OTHER_PARTS,
    SIZES,
    SPECIMEN,
    TRUE,
    holds,
    of_the_deformed,
    plain,
    role_of_name,
)
from validate.units import is_unit, si_factor, split

_NUMBERS = re.compile(r"[\s_#.:-]*\(?[0-9]+\)?[\s_:-]*")
_LISTED = 8  # specimens named in an error


def specimen_tables(tables: Sequence[Table]) -> dict[str, Table]:
    """Tables by the label of their specimen, in the order of the file; one label: one specimen.

    Tables without force and displacement are left aside when others have them. Labels are the
    file's where it has different ones, else 1, 2, ...
    """
    parts = [p for t in tables for s in _beside(t) for p in _by_column(s)]
    useful = [p for p in parts if {"force", "displacement"} <= _roles(p)]
    others = [p for p in parts if p not in useful] if useful else []
    for other in others:
        # Rows as wide as the others below words that name no quantity are a test with text in it.
        before = [t for t in useful if t.names_line < other.names_line]
        if before and not _roles(other) and len(before[-1].columns) == len(other.columns):
            refuse_text(other.names_line, [c.label for c in other.columns])
    note = [f"table without force and displacement in line {p.names_line}" for p in others]
    found = [replace(t, notes=(*t.notes, *note)) for t in _joined(useful or parts)]
    labels = [t.specimen for t in found]
    if len(set(labels)) < len(found) or not all(labels):
        labels = [str(i + 1) for i in range(len(found))]
    return dict(zip(labels, found, strict=True))


def chosen(found: Mapping[str, Table], said: str | None) -> tuple[str, Table]:
    """Label and table of the one specimen, or of the one the user names (label or number).

    Raises `RecordingError` naming the specimens when there are several and none is named,
    `UsageError` when there is none of that name.
    """
    if said is None and len(found) == 1:
        return next(iter(found.items()))
    if said is None:
        raise RecordingError(
            f"{len(found)} specimens in one file: {_listed(found)}; choose one with "
            f"--map 'specimen={next(iter(found))}'; import takes all as repeats with specimen=all"
        )
    by_number = dict(zip(map(str, range(1, len(found) + 1)), found, strict=True))
    label = said if said in found else by_number.get(said)
    if label is None:
        raise UsageError(f"--map specimen={said}: unknown specimen; {_listed(found)}")
    return label, found[label]


def _listed(found: Mapping[str, Table]) -> str:
    shown = [
        f"'{label}' ({len(t.lines)} rows from line {t.lines[0]} on, names in line {t.names_line})"
        for label, t in list(found.items())[:_LISTED]
    ]
    more = [f"and {len(found) - _LISTED} more"] if len(found) > _LISTED else []
    return ", ".join(shown + more)


def _roles(table: Table) -> set[str]:
    return {role for column in table.columns if (role := role_of(column))}


# --- side by side --------------------------------------------------------------------------------


def _beside(table: Table) -> list[Table]:
    """The groups of columns as tables; the rows of each end where its cells end."""
    groups = column_groups([c.label if c.label[:1] != "#" else "" for c in table.columns])
    if len(groups) < 2:
        return [table]
    # What the file calls the groups: numbers in their names, else texts in a line above.
    inline = [
        {m[0] for i in g if (m := re.search(r"[0-9]+", table.columns[i].label))} for g in groups
    ]
    found = [next(iter(names)) if len(names) == 1 else "" for names in inline]
    if all(found) and len(set(found)) == len(found):
        labels = found
    else:
        labels = [str(i + 1) for i in range(len(groups))]
        for cells in reversed(table.above):
            texts = [t for t in cells if t]
            numbered = [t for t in texts if holds(t, SPECIMEN) or re.search("[0-9]", t)]
            if len(texts) == len(groups) == len(set(texts)) == len(numbered):
                labels = [specimen_label([t]) or t for t in texts]
                break
    return [_group(table, g, label) for g, label in zip(groups, labels, strict=True)]


def column_groups(labels: Sequence[str]) -> list[list[int]]:
    """Indices of the columns of each group, where the same names come again in the same order.

    Numbers in names do not count (`Load 1`, `Load 2`). A first column may be common to all groups.
    Fewer than two groups: the columns are one table.
    """
    filled = [i for i, label in enumerate(labels) if label]
    keys = [_NUMBERS.sub(" ", plain(labels[i])).strip() for i in filled]
    for common in (0, 1):
        rest = keys[common:]
        for size in range(2, len(rest) // 2 + 1):
            whole = len(rest) % size == 0 and rest == rest[:size] * (len(rest) // size)
            if whole and len(set(rest[:size])) == size and not set(keys[:common]) & set(rest):
                starts = range(common, len(keys), size)
                return [filled[:common] + filled[s : s + size] for s in starts]
    return [filled]


def _group(table: Table, group: Sequence[int], label: str) -> Table:
    columns = tuple(table.columns[i] for i in group)
    own = columns[1:] if group[0] == 0 and label != "" and len(columns) > 2 else columns
    filled = [i for i in range(len(table.lines)) if any(c.cells[i] for c in own)]
    last = filled[-1] + 1 if filled else 0
    # Notes of the whole table that hold for a group: not those of the ends of the others.
    part = replace(
        table,
        columns=columns,
        specimen=label,
        notes=tuple(n for n in table.notes if not n.startswith(("columns with gaps", "rows end"))),
    )
    return part.take(range(last))


# --- below each other ----------------------------------------------------------------------------


def _by_column(table: Table) -> list[Table]:
    """Parts of a table with a column such as `Specimen` that changes along the rows."""
    named = [c for c in table.columns if holds(c.name, SPECIMEN) and role_of(c) is None]
    time = _time(table) if named else None
    clock = [number(c, table.decimal) for c in time.cells] if time is not None else []
    for column in named:
        starts = [0, *(i + 1 for i, (a, b) in enumerate(pairwise(column.cells)) if a != b)]
        values = [column.cells[i] for i in starts]
        # Time, where there is one, begins anew at every start.
        turns = [(clock[i - 1], clock[i]) for i in starts[1:]] if clock else []
        restarts = all(a is not None and b is not None and b <= a for a, b in turns)
        if 1 < len(values) == len(set(values)) and all(values) and restarts:
            ends = [*starts[1:], len(table.lines)]
            return [
                replace(table.take(range(a, b)), specimen=v)
                for a, b, v in zip(starts, ends, values, strict=True)
            ]
    return [table]


def _joined(tables: Sequence[Table]) -> list[Table]:
    """Tables with the names repeated, page by page, are one when time goes on."""
    found: list[Table] = []
    for table in tables:
        if found and not table.specimen and _goes_on(found[-1], table):
            a = found[-1]
            columns = tuple(
                replace(x, cells=x.cells + y.cells)
                for x, y in zip(a.columns, table.columns, strict=True)
            )
            note = f"names repeated in line {table.names_line} while time goes on: one test"
            notes = tuple(dict.fromkeys((*a.notes, *table.notes, note)))
            header = {**table.header, **a.header}
            found[-1] = replace(
                a, header=header, columns=columns, lines=a.lines + table.lines, notes=notes
            )
        else:
            found.append(table)
    return found


def _goes_on(a: Table, b: Table) -> bool:
    if [(c.label, c.unit) for c in a.columns] != [(c.label, c.unit) for c in b.columns]:
        return False
    before, after = _time(a), _time(b)
    if before is None or after is None:
        return False
    last, first = number(before.cells[-1], a.decimal), number(after.cells[0], b.decimal)
    return last is not None and first is not None and first > last


def _time(table: Table) -> Column | None:
    column = time_column(table)
    return column if column and looks_numeric(column.cells[0]) else None


# --- sizes in a header; force and displacement made with them of stress and strain ---------------

# (name in the record, quantity, words of the header's key, words that make it something else)
_NO_TEST_SPEED = OTHER_PARTS + " jog return preload vorkraft data datenrate abtastrate"
LENGTH = "length_m"
GEOMETRY: tuple[tuple[str, str, str, str], ...] = (
    ("diameter_m", "length", SIZES["diameter"], OTHER_PARTS),
    ("height_m", "length", SIZES["height"], OTHER_PARTS),
    ("width_m", "length", SIZES["width"], OTHER_PARTS),
    ("thickness_m", "length", SIZES["thickness"], OTHER_PARTS),
    (LENGTH, "length", SIZES["length"], OTHER_PARTS),
    ("area_m2", "area", SIZES["area"], OTHER_PARTS),
    ("speed_m_per_s", "speed", SIZES["speed"], _NO_TEST_SPEED),
)
_GLUED = re.compile(r"(?P<number>[-+]?[0-9.,' ]*[0-9][.,]?(?:[eE][-+]?[0-9]+)?)\s*(?P<unit>\D.*)?")


def specimen_of(header: Mapping[str, str], decimal: str) -> dict[str, float]:
    """SI numbers by name (`diameter_m`, `height_m`, ..., `speed_m_per_s`) of the header block.

    Only values with a unit, glued to them or in the key, are used. A strip has several lengths (of
    itself, between grips, of a gauge): where they differ each is `length_m/KEY`, and none is meant.
    Raises `RecordingError` when two other lines, or key and value, contradict each other, and for
    sizes that are not positive.
    """
    found: dict[str, tuple[float, str]] = {}
    lengths: dict[str, float] = {}
    for key, text in header.items():
        for name, quantity, given, taken in GEOMETRY:
            parts = _GLUED.fullmatch(text.strip())
            if not holds(key, given) or holds(key, taken) or parts is None:
                continue
            glued = (parts["unit"] or "").strip("()[] ")
            _, in_key = split_unit(key)
            if glued and in_key and is_unit(in_key) and glued != in_key:
                raise RecordingError(f"header: '{key}' is given in {glued}; keep one unit")
            unit = glued or in_key
            if unit is None or not is_unit(unit):
                continue
            value = _number(key, parts["number"].strip(), decimal) * si_factor(unit, quantity)
            if value <= 0:
                raise RecordingError(f"header: '{key}' is {text}, expected a size above 0")
            if name == LENGTH:
                lengths[f"{LENGTH}/{key}"] = value
            before, by = found.setdefault(name, (value, key))
            if name != LENGTH and not math.isclose(before, value, rel_tol=1e-6):
                raise RecordingError(
                    f"header: '{by}' gives {name} = {before:.6g}, '{key}' {value:.6g}; keep one"
                )
    told = {name: value for name, (value, _) in found.items()}
    if not all(math.isclose(told[LENGTH], value, rel_tol=1e-6) for value in lengths.values()):
        del told[LENGTH]
        told |= lengths
    return told


def loaded_area(specimen: Mapping[str, float], test: str = "") -> float | None:
    """Return the area (m2) under nominal stress: given, of a disc, or of a rectangle; None: not
    known.

    A strip that is pulled has width and thickness. Which two of three sides a pressed block stands
    on is known only beside its height: a thickness may be the height, too.
    """
    if "area_m2" in specimen:
        return specimen["area_m2"]
    if "diameter_m" in specimen:
        return math.pi * specimen["diameter_m"] ** 2 / 4
    if test == "tension":
        sides = [specimen[k] for k in ("width_m", "thickness_m") if k in specimen]
        return sides[0] * sides[1] if len(sides) == 2 else None
    sides = [specimen[k] for k in ("width_m", "thickness_m", "length_m") if k in specimen]
    return sides[0] * sides[1] if len(sides) == 2 and "height_m" in specimen else None


def _number(key: str, text: str, decimal: str) -> float:
    """A header number; its decimal sign may differ from the table's where it cannot be grouping."""
    other = "," if decimal == "." else "."
    grouping = re.fullmatch(rf"[1-9][0-9]{{0,2}}\{other}[0-9]{{3}}", text)
    value = None if grouping else number(text, decimal)
    if value is None and not grouping:
        value = number(text, other)
    if value is None:
        raise RecordingError(
            f"header: '{key}' is '{text}', not a plain number; write it without thousands "
            f"separators"
        )
    return value


MEASURES = ("engineering", "true")
_FROM = {"displacement": ("strain", "stretch"), "force": ("stress",)}
_LENGTH = "the gauge length of the strain, as --map length=20mm"
_AREA = "the specimen's loaded area, as --map area=314mm2"
_LONGEST = 20.0  # no rubber is stretched so far: per cent that are called numbers


@dataclass(frozen=True)
class Sizes:
    """Area m2 and length m before the test, each with who said so; None: not known."""

    area: float | None
    length: float | None
    measure: str | None
    words: Mapping[str, str]


@dataclass(frozen=True)
class Sized:
    """Force or displacement made of a derived column, and the words on how."""

    pick: Pick
    words: str
    kind: Kind | None = None  # what a stretch says of the test


def sizes_of(mapping: Mapping[str, str], specimen: Mapping[str, float], kind: Kind | None) -> Sizes:
    """Return the user's sizes, else the header's: its area, and in compression its height.

    A header's length is not taken: that of a whole specimen is not the one strain is measured on.
    Raises `UsageError` for a size without a unit and a measure that is neither.
    """
    said = {k: _size(k, mapping[k]) for k in ("area", "length") if k in mapping}
    measure = mapping.get("measure")
    if measure not in (None, *MEASURES):
        raise UsageError(f"--map measure={measure}: expected one of {', '.join(MEASURES)}")
    pressed = kind is not None and kind.name == "compression"
    told = {
        "area": loaded_area(specimen, kind.name if kind else ""),
        "length": specimen.get("height_m") if pressed else None,
    }
    found = {k: said.get(k, told[k]) for k in told}
    words = {k: "given" if k in said else "from the header" for k in told}
    return Sizes(found["area"], found["length"], measure, words)


def with_sizes(specimen: Mapping[str, float], mapping: Mapping[str, str]) -> dict[str, float]:
    """Return the header's sizes and those that the user gives, who is believed."""
    names = {"area": "area_m2", "length": "height_m"}  # a header's length is the whole specimen's
    return {**specimen, **{names[k]: _size(k, mapping[k]) for k in names if k in mapping}}


def _size(key: str, text: str) -> float:
    found = split(text)
    example = {"area": "314mm2", "length": "20mm"}[key]
    if found is None or not found[1] or not 0 < found[0] < np.inf:
        raise UsageError(f"--map {key}={text}: expected a size above 0 with a unit, as {example}")
    try:
        return found[0] * si_factor(found[1], key)
    except RecordingError as error:
        raise UsageError(f"--map {key}={text}: {error}") from error


def is_derived(role: str, table: Table, said: Mapping[str, Said]) -> bool:
    """Return whether a force or displacement has to be made of stress, strain or stretch."""
    sources = _FROM.get(role, ())
    own = role in said or bool(columns_called(role, table))
    return not own and any(s in said or _candidates(s, table) for s in sources)


def derived(
    role: str, table: Table, said: Mapping[str, Said], sizes: Sizes, kind: Kind | None
) -> Sized:
    """Displacement or force by a size; raises `MissingColumnError` naming all that is asked."""
    if role == "displacement":
        missing = () if sizes.length else (_LENGTH,)
        try:
            source = _elongation(table, said)
        except RecordingError as error:
            raise MissingColumnError(str(error), missing) from error
        measure, asked = ("", []) if source.role == "stretch" else _measure(source, sizes)
        asked += missing
        unnamed = unnamed_column("displacement", table)
        _refuse_unsaid(
            f"no displacement, but {source.role} '{source.column.label}'{unnamed}", asked
        )
        assert sizes.length is not None
        what = f"{measure} strain" if measure else "(stretch - 1) of"
        words = f"displacement = {what} '{source.column.label}' x length {sizes.length:.6g} m"
        shown = _shown_by_stretch(source) if source.role == "stretch" else None
        if kind and shown and kind.name != shown.name:
            raise RecordingError(
                f"a {kind.name} test ({kind.why}), but {shown.why}; give --map test={shown.name}, "
                "or "
                f"if it is not a stretch, --map 'strain={source.column.label}:%' (or :1)"
            )
        elongation = _relative(source, measure, kind or shown)
        made = _made(source, "displacement", elongation * sizes.length, sizes.length)
        return Sized(made, f"{words} ({sizes.words['length']})", shown)
    missing = () if sizes.area else (_AREA,)
    try:
        stress = _source("stress", table, said)
    except RecordingError as error:
        raise MissingColumnError(str(error), missing) from error
    measure, asked = _measure(stress, sizes)
    asked += missing
    unnamed = unnamed_column("force", table)
    _refuse_unsaid(f"no force, but stress '{stress.column.label}'{unnamed}", asked)
    assert sizes.area is not None
    nominal, words = stress.values, f"{measure} stress '{stress.column.label}'"
    if measure == "true":
        nominal = nominal / _stretch(table, said, sizes, kind)
        words += " over the stretch (constant volume assumed)"
    words = f"force = {words} x area {sizes.area:.6g} m2 ({sizes.words['area']})"
    return Sized(_made(stress, "force", nominal * sizes.area, sizes.area), words)


def require_left(sized: Sized, closing: Floats, length: float) -> None:
    """Raise `RecordingError` where nothing is left of the specimen (closing, length in m)."""
    most = float(np.max(closing)) / length
    if most >= 1:
        label = sized.pick.column.label
        raise RecordingError(
            f"'{label}' presses the specimen by {100 * most:.4g} % of its length; if it is in per "
            f"cent, give --map 'strain={label}:%', if it is a true strain --map measure=true"
        )


def _source(role: str, table: Table, said: Mapping[str, Said]) -> Pick:
    if role in said:
        if said[role].sign is not None:
            raise UsageError(
                f"--map {role}: no sign is allowed; give --map test=compression or test=tension"
            )
        return said_pick(role, table, said[role])
    found = _candidates(role, table)
    engineering = [c for c in found if holds(c.name, ENGINEERING)]
    found = engineering if len(engineering) == 1 else found
    if len(found) != 1:
        labels = ", ".join(repr(c.label) for c in found) or "none"
        raise MissingColumnError(
            f"{len(found)} columns may be {role}: {labels}; choose with --map {role}=COLUMN"
        )
    column = found[0]
    if role == "stretch" and not column.unit:
        column = replace(column, unit="1")
    return picked(role, column, table, None)


def _candidates(role: str, table: Table) -> list[Column]:
    """Columns of engineering or unsaid measure, else those of true stress or strain."""
    true = [c for c in table.columns if role_of_name(of_the_deformed(c.name)) == role]
    return columns_called(role, table) or [c for c in true if any(c.cells)]


def _elongation(table: Table, said: Mapping[str, Said]) -> Pick:
    stretched = "stretch" in said or not (
        "strain" in said or _candidates("strain", table)
    )  # a strain goes first
    return _source("stretch" if stretched else "strain", table, said)


def _measure(pick: Pick, sizes: Sizes) -> tuple[str, list[str]]:
    """Engineering or true, by the column's name, else as said; and what has to be asked."""
    name = pick.column.name
    by_name = "true" if holds(name, TRUE) else "engineering" if holds(name, ENGINEERING) else None
    if by_name and sizes.measure not in (None, by_name):
        raise UsageError(
            f"--map measure={sizes.measure}: '{pick.column.label}' names {by_name} itself; leave "
            f"the option out"
        )
    ask = "the measure of stress and strain, as --map measure=engineering (undeformed body)"
    found = by_name or sizes.measure
    return found or "", [] if found else [f"{ask}, or measure=true"]


def _stretch(table: Table, said: Mapping[str, Said], sizes: Sizes, kind: Kind | None) -> Floats:
    """Stretch (n,) for a true stress: by strain or stretch, else by displacement over length."""
    if not (
        {"strain", "stretch"} & set(said)
        or any(_candidates(role, table) for role in ("strain", "stretch"))
    ):
        moved = needed_pick("displacement", table, said.get("displacement"))
        if sizes.length is None:
            raise MissingColumnError("true stress and the current area", (_LENGTH,))
        return 1 + _signed((moved.values - moved.values[0]) / sizes.length, kind, moved)
    source = _elongation(table, said)
    shown = _shown_by_stretch(source) if source.role == "stretch" else None
    measure, asked = ("", []) if source.role == "stretch" else _measure(source, sizes)
    _refuse_unsaid("true stress", asked)
    return np.asarray(1 + _signed(_relative(source, measure, kind or shown), kind or shown, source))


def _relative(source: Pick, measure: str, kind: Kind | None) -> Floats:
    """Change of length over length (n,), with the sign that the table gives it."""
    if source.role == "stretch":
        if source.values.min() <= 0 or source.values.max() > _LONGEST:
            raise RecordingError(
                f"'{source.column.label}' from {source.values.min():.4g} to "
                f"{source.values.max():.4g}: a stretch is 1 at rest and above 0; if it is a "
                f"strain, give --map 'strain={source.column.label}:%' (or :1)"
            )
        return source.values - 1
    if measure == "true":
        return np.asarray(np.expm1(_signed(source.values, kind, source)))
    return source.values


def _signed(x: Floats, kind: Kind | None, source: Pick) -> Floats:
    """Longer positive: by the kind of test, else a strain that goes negative is compression."""
    way = excursion(x)
    if kind is None and way >= 0:
        raise MissingColumnError(
            f"'{source.column.label}' does not show whether the specimen is pressed or pulled; a "
            f"true measure needs it"
        )
    longer = kind is not None and kind.name == "tension"
    return x * (way or 1) if longer else -x * (way or 1)


def _shown_by_stretch(source: Pick) -> Kind | None:
    way = excursion(source.values)
    if way == 0:
        return None
    name = f"'{source.column.label}'"
    return (
        Kind("tension", f"{name} goes above 1") if way > 0
        else Kind("compression", f"{name} goes below 1")
    )  # fmt: skip


def _refuse_unsaid(what: str, asked: list[str]) -> None:
    if asked:
        raise MissingColumnError(what, tuple(asked))


def _made(source: Pick, role: str, values: Floats, size: float) -> Pick:
    return Pick(role, source.column, source.unit, source.factor * size, values, source.said)
