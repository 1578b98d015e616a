"""Table of a testing machine's export: header block, columns with units, cells as text.

Knows no quantities. Units may stand in the column names, as `(mm)`, `[mm]`, `/mm`, `in mm` or
`_mm`, or in a row of their own.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from validate.arrays import Floats, checked
from validate.errors import RecordingError
from validate.recording.tables.cells import Line, looks_numeric, number
from validate.recording.tables.vocabulary import OTHER_PARTS, SIZES, holds
from validate.units import is_unit

# --- What stands beside a table of samples in a form of its own: sizes in a table, LabVIEW's
# units.

LABVIEW_X = "X_Value"  # what a LabVIEW measurement file calls its first column
_SIZE_WORDS = " ".join(words for size, words in SIZES.items() if size != "speed")


def size_lines(names: Line, units: Sequence[str], rows: Sequence[Line]) -> list[Line]:
    """Header lines of a small table of sizes, as Trapezium writes it above its samples: names, a
    row of units, a row a specimen. None where specimens differ: which is meant nothing says."""
    found: list[Line] = []
    for i, name in enumerate(names[1]):
        unit = units[i] if i < len(units) else ""
        values = {cells[i] for _, cells in rows if i < len(cells)}
        if is_unit(unit) and len(values) == 1 and _is_size(name):
            found.append((names[0], [name, *values, unit]))
    return found


def _is_size(name: str) -> bool:
    return holds(name, _SIZE_WORDS) and not holds(name, OTHER_PARTS)


def labview_units(names: Sequence[str], above: Sequence[Line]) -> list[str]:
    """Units of the columns of a LabVIEW measurement file, whose header has them by channel; none
    for other tables, and for those with a column of x for each channel."""
    header = {cells[0]: cells[1:] for _, cells in above if cells}
    if list(names).count(LABVIEW_X) != 1 or names[0] != LABVIEW_X or "Y_Unit_Label" not in header:
        return []
    over_time = {cell for cell in header.get("X_Dimension", []) if cell} == {"Time"}
    return ["s" if over_time else "", *header["Y_Unit_Label"]]


# -------------------------------------------------------------------------------------------------

_BRACKETED = re.compile(r"(?P<name>.*?)\s*[(\[<{](?P<unit>[^()\[\]]*)[)\]>}]")
_SLASHED = re.compile(r"(?P<name>[^/]*[^/\s])\s*[/,]\s*(?P<unit>\S.*)")
_GLUED = re.compile(
    r"(?P<name>.*[^_\s])(?:_|\s+in\s+|\s)"
    r"(?P<unit>s|ms|sec|N|kN|mN|lbf|lbs|kgf|gf|mm|cm|um|inch|in|kPa|MPa|Pa|psi|%)"
)


@dataclass(frozen=True)
class Column:
    """One column as written: header text, name without its unit, unit or None, a cell per row.

    `problem` is why it cannot be used; empty where nothing speaks against it.
    """

    label: str
    name: str
    unit: str | None
    cells: tuple[str, ...]
    problem: str = ""


@dataclass(frozen=True)
class Table:
    """A header block and a table; `lines` are the line numbers of the rows, counted from 1.

    `names_line` is the line of the column names, `specimen` what the file calls the specimen (empty
    where it does not), `above` the cells of the header lines. `notes` tell what the file holds
    besides, and what was left out.
    """

    header: Mapping[str, str]
    columns: tuple[Column, ...]
    lines: tuple[int, ...]
    names_line: int
    encoding: str
    encoding_why: str
    separator: str
    decimal: str
    specimen: str = ""
    above: tuple[tuple[str, ...], ...] = ()
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "header", MappingProxyType(dict(self.header)))

    def take(self, rows: Sequence[int], *notes: str) -> "Table":
        """Return the table with these rows only, and notes that say why."""
        columns = tuple(replace(c, cells=tuple(c.cells[i] for i in rows)) for c in self.columns)
        lines = tuple(self.lines[i] for i in rows)
        return replace(self, columns=columns, lines=lines, notes=(*self.notes, *notes))

    def numbers(self, column: Column) -> Floats:
        """Return the column's values (rows,) in its own unit.

        Raises `RecordingError` with the line of the first cell that is empty or not a number.
        """
        values = [number(cell, self.decimal) for cell in column.cells]
        bad = [i for i, value in enumerate(values) if value is None]
        if bad:
            raise RecordingError(
                f"line {self.lines[bad[0]]}, column '{column.label}': '{column.cells[bad[0]]}' is "
                f"not a number ({len(bad)} such cells of {len(values)}); correct or remove these "
                f"rows"
            )
        return checked(np.array(values, dtype=float), column.label, (None,), error=RecordingError)


def columns_of(names: list[str], units: list[str], rows: Sequence[Line]) -> tuple[Column, ...]:
    """Columns of rows of equal length; one with two units has that as its problem."""
    count = len(rows[0][1])
    padded = units + [""] * (count - len(units))
    columns = []
    for i, (label, below) in enumerate(zip(names[:count], padded, strict=False)):
        name, unit = split_unit(label)
        below = below.strip("()[]<>{} ") if below else ""
        if below and unit and not is_unit(unit):
            name, unit = label, None
        twice = bool(below and unit and below != unit)
        problem = f"unit '{unit}' in its name, '{below}' in the row below; keep one"
        cells = tuple(row[i] for _, row in rows)
        columns.append(
            Column(
                label or f"#{i + 1}", name, below or unit or None, cells, problem if twice else ""
            )
        )
    return tuple(columns)


def split_unit(label: str) -> tuple[str, str | None]:
    """Name and unit in `Load (N)`, `Load [N]`, `Load /N`, `Load_N`, `Load in N`; None: no unit."""
    text = label.strip()
    bracketed = _BRACKETED.fullmatch(text)
    if bracketed:
        return bracketed["name"].strip(), bracketed["unit"].strip() or None
    slashed = _SLASHED.fullmatch(text)
    if slashed and is_unit(slashed["unit"].strip("()[] ")):
        return slashed["name"], slashed["unit"].strip("()[] ")
    glued = _GLUED.fullmatch(text)
    return (glued["name"], glued["unit"]) if glued else (text, None)


def header_of(lines: Sequence[Line], raw: Sequence[str]) -> dict[str, str]:
    """Keys and values of header lines; bare text is kept under its line number."""
    header: dict[str, str] = {}
    for line, cells in lines:
        key, value = _key_value(raw[line - 1], cells)
        if not key:
            key, value = f"line {line}", value
        elif header.get(key, value) != value:
            key = f"{key} (line {line})"
        header[key] = value
    return header


def _key_value(raw: str, cells: Sequence[str]) -> tuple[str, str]:
    """Key and value of a header line; an empty key when the line is bare text."""
    first, *rest = [cell for cell in cells if cell]
    if rest and (":" not in first or first.endswith(":") or _is_value(first, rest)):
        return first.rstrip(": "), " ".join(rest)
    plain = raw.strip().strip('"').rstrip('; ,\t"')
    key, colon, value = plain.partition(":")
    if not colon:
        key, colon, value = plain.partition("=")
    return (key.strip(' "'), value.strip(' ",;')) if colon else ("", plain)


def _is_value(first: str, rest: Sequence[str]) -> bool:
    """`Dimension : Diameter,,50.0,mm`: the colon belongs to the key, a number follows in a cell."""
    return looks_numeric(rest[0]) and not re.search(r"[0-9]", first.partition(":")[2])
