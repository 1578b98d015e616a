"""CSV text of testing machines: header block, column names, units, rows. Knows no quantities.

The header block may hold `key: value;`, `key,value` or bare lines; units may stand in the column
names, as `(mm)`, `[mm]` or `/mm`, or in a row of their own. Blank lines may stand anywhere.
"""

import codecs
import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from validate.arrays import Floats, checked
from validate.errors import RecordingError
from validate.recording.numerals import decimal_sign, decimals, looks_numeric, number
from validate.recording.units import is_unit

MAX_BYTES = 256 * 1024 * 1024
_SEPARATORS = ("\t", ";", ",")
_NOTHING = {"nan", "-nan", "inf", "-inf", "#n/a", "n/a", "null", "none", "--", "---", "err"}
_BRACKETED = re.compile(r"(?P<name>.*?)\s*[(\[](?P<unit>[^()\[\]]*)[)\]]")
_UNIT_CELL = re.compile(r"[(\[][^()\[\]]*[)\]]")
_SLASHED = re.compile(r"(?P<name>[^/]*[^/\s])\s*[/,]\s*(?P<unit>\S.*)")
_GLUED = re.compile(
    r"(?P<name>.*[^_\s])(?:_|\s+in\s+|\s)(?P<unit>s|ms|N|kN|mN|mm|cm|um|kPa|MPa|Pa|%)"
)

Line = tuple[int, list[str]]  # line number in the file, cells


@dataclass(frozen=True)
class _Split:
    """Lines in cells for one separator, without blank ones; `run` is the index of the first row."""

    score: int
    separator: str
    lines: list[Line]
    emptied: list[int]
    run: int


@dataclass(frozen=True)
class Column:
    """One column as written: header text, name without its unit, unit or None, a cell per row."""

    label: str
    name: str
    unit: str | None
    cells: tuple[str, ...]


@dataclass(frozen=True)
class Table:
    """A header block and a table; `lines` are the line numbers of the rows, counted from 1."""

    header: Mapping[str, str]
    columns: tuple[Column, ...]
    lines: tuple[int, ...]
    encoding: str
    separator: str
    decimal: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "header", MappingProxyType(dict(self.header)))

    def numbers(self, column: Column) -> Floats:
        """The column's values (rows,) in its own unit.

        Raises `RecordingError` with the line of the first cell that is empty or not a number.
        """
        values = [number(cell, self.decimal) for cell in column.cells]
        bad = [i for i, value in enumerate(values) if value is None]
        if bad:
            raise RecordingError(
                f"line {self.lines[bad[0]]}, column '{column.label}': '{column.cells[bad[0]]}' is "
                f"not a number ({len(bad)} such cells of {len(values)}); mend or remove these rows"
            )
        return checked(np.array(values, dtype=float), column.label, (None,), error=RecordingError)


def parse_table(data: bytes) -> Table:
    """The one table in the bytes of a text file.

    Raises `RecordingError` for empty and binary files, text without a table, tables without column
    names, several tables, text amid the rows, rows with too few or too many cells.
    """
    text, encoding = decode(data)
    raw = re.split(r"\r\n|\r|\n", text)
    split = _split(raw)
    lines, run = split.lines, split.run
    top = _names_index(lines, run)
    _refuse_earlier_table(lines[:top], lines[run])
    has_units = top + 1 < run and _is_unit_row(lines[top + 1][1])
    units = lines[top + 1][1] if has_units else []
    rows, footer = _rows(lines[top + 1 + has_units :], lines[top])
    _refuse_emptied(split.emptied, rows)
    if raw[-1].strip():
        _refuse_cut(rows)
    return Table(
        header=_header(lines[:top] + footer, raw),
        columns=_columns(lines[top][1], units, rows),
        lines=tuple(line for line, _ in rows),
        encoding=encoding,
        separator=split.separator,
        decimal=decimal_sign((line, cell) for line, row in rows for cell in row),
    )


def decode(data: bytes) -> tuple[str, str]:
    """Text and encoding of the bytes: UTF-8 or UTF-16 with or without mark, else cp1252.

    Raises `RecordingError` for empty, oversized and binary files.
    """
    if len(data) > MAX_BYTES:
        raise RecordingError(f"{len(data)} bytes, the limit for text tables is {MAX_BYTES}")
    encoding = _encoding(data)
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError as error:
        raise RecordingError(
            f"no text file: byte {error.start} of {len(data)} is not {encoding}; "
            "export the test as CSV text"
        ) from error
    odd = re.search(r"[\x00-\x08\x0e-\x19\x1b-\x1f\x7f\ufffe\uffff]", text)
    if odd:
        raise RecordingError(
            f"a binary file: character {ord(odd[0])} at {odd.start()}; export the test as CSV text"
        )
    if not text.strip():
        raise RecordingError(f"an empty file ({len(data)} bytes)")
    return text.strip("\x1a"), encoding


def _encoding(data: bytes) -> str:
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    head = data[:512]
    if len(head) >= 4 and 0.3 * len(head) < head.count(0) <= 0.5 * len(head):
        return "utf-16-le" if head[1] == 0 else "utf-16-be"
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8-sig"


def _split(raw: Sequence[str]) -> _Split:
    """The lines split at the separator that gives most numbers."""
    best = _Split(0, ",", [], [], 0)
    for separator in _SEPARATORS:
        if not any(separator in line for line in raw):
            continue
        split = [(i + 1, _cells(line, separator)) for i, line in enumerate(raw)]
        filled = [(i, cells) for i, cells in split if any(cells)]
        score, run = _longest_run(filled)
        if score > best.score:
            emptied = [i for i, cells in split if len(cells) > 1 and not any(cells)]
            best = _Split(score, separator, filled, emptied, run)
    if best.score < 4:
        raise RecordingError(
            f"no table of numbers in {len(raw)} lines of text "
            "(looked for columns separated by comma, semicolon or tab)"
        )
    return best


def _cells(line: str, separator: str) -> list[str]:
    text = line.rstrip("; \t") if separator == "," else line
    try:
        split = next(csv.reader([text], delimiter=separator, skipinitialspace=True), [])
    except csv.Error as error:
        raise RecordingError(f"no CSV text: a line of {len(line)} characters: {error}") from error
    return [cell.strip() for cell in split]


def _is_row(cells: Sequence[str]) -> bool:
    numbers = sum(looks_numeric(cell) or cell.lower() in _NOTHING for cell in cells)
    return len(cells) >= 2 and numbers >= 1 and 2 * numbers >= sum(map(bool, cells))


def _longest_run(lines: Sequence[Line]) -> tuple[int, int]:
    """Count of numbers in the longest run of rows, and the index where it starts."""
    best, start, score = (0, 0), 0, 0
    for index, (_, cells) in enumerate(lines):
        if not _is_row(cells):
            start, score = index + 1, 0
            continue
        score += sum(looks_numeric(cell) for cell in cells)
        best = max(best, (score, start), key=lambda found: found[0])
    return best


def _is_unit_row(cells: Sequence[str]) -> bool:
    return all(_UNIT_CELL.fullmatch(c) or is_unit(c) for c in cells if c) and any(cells)


def _names_index(lines: Sequence[Line], run: int) -> int:
    """The line of column names above the rows; rows with defects may lie between."""
    for index in range(run - 1, -1, -1):
        cells = lines[index][1]
        words = sum(map(bool, cells)) >= 2 and not any(looks_numeric(c) for c in cells)
        if words and not _is_unit_row(cells):
            return index
    raise RecordingError(
        f"the table at line {lines[run][0]} has no column names; add a line such as "
        "'Time (s),Displacement (mm),Force (N)' above it"
    )


def _refuse_earlier_table(above: Sequence[Line], first: Line) -> None:
    alike = [line for line, cells in above if _is_row(cells) and len(cells) == len(first[1])]
    if len(alike) >= 10:
        raise RecordingError(
            f"two tables or text amid the rows: {len(alike)} rows from line {alike[0]} on and more "
            f"from line {first[0]} on; export one test per file"
        )


def _rows(lines: Sequence[Line], names: Line) -> tuple[list[Line], list[Line]]:
    """Rows of equal length, and the text lines below the table."""
    count = max(i + 1 for i, cell in enumerate(names[1]) if cell)
    rows: list[Line] = []
    footer: list[Line] = []
    for line, cells in lines:
        if _is_text(cells, count):
            footer.append((line, cells))
            continue
        if footer:
            raise RecordingError(
                f"line {footer[0][0]}: text '{' '.join(footer[0][1]).strip()[:60]}' amid the rows; "
                "export one test per file and mend this line"
            )
        rows.append((line, _fitted(line, cells, count, names[0])))
    return rows, footer


def _is_text(cells: Sequence[str], count: int) -> bool:
    """A remark below a table (at most key and value); a damaged row is a row, not a remark."""
    filled = [cell for cell in cells if cell]
    word = re.search(r"[^\W\d_]{2}", filled[0]) and filled[0].lower() not in _NOTHING
    return bool(word) and not looks_numeric(filled[0]) and len(filled) < min(count, 3)


def _refuse_emptied(emptied: Sequence[int], rows: Sequence[Line]) -> None:
    amid = [line for line in emptied if rows[0][0] < line < rows[-1][0]]
    if amid:
        raise RecordingError(
            f"line {amid[0]}: a row with all cells empty amid the rows ({len(amid)} such rows); "
            "mend or remove it"
        )


def _refuse_cut(rows: Sequence[Line]) -> None:
    """A last line without line end whose number has fewer decimals than all above it is cut."""
    ends = [decimals(next(cell for cell in row[::-1] if cell)) for _, row in rows]
    if len(ends) > 2 and ends[-1] < min(ends[:-1]) == max(ends[:-1]):
        raise RecordingError(
            f"line {rows[-1][0]}: the file is cut, its last number '{rows[-1][1][-1]}' has "
            f"{ends[-1]} digits after the sign, all others {ends[0]}; remove the row or copy again"
        )


def _fitted(line: int, cells: list[str], count: int, names_line: int) -> list[str]:
    if len(cells) < count or any(cells[count:]):
        raise RecordingError(
            f"line {line}: {len(cells)} cells, but line {names_line} names {count} columns; "
            "a cut row, or decimal commas between separating commas: export it again"
        )
    return cells[:count]


def _columns(names: list[str], units: list[str], rows: Sequence[Line]) -> tuple[Column, ...]:
    count = len(rows[0][1])
    padded = units + [""] * (count - len(units))
    columns = []
    for i, (label, below) in enumerate(zip(names, padded, strict=False)):
        name, unit = split_unit(label)
        below = below.strip("()[] ") if below else ""
        if below and unit and not is_unit(unit):
            name, unit = label, None
        if below and unit and below != unit:
            raise RecordingError(
                f"column '{label}': unit '{unit}' in its name, '{below}' in the row below; keep one"
            )
        cells = tuple(row[i] for _, row in rows)
        columns.append(Column(label or f"#{i + 1}", name, below or unit or None, cells))
    return tuple(columns[:count])


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


def _header(lines: Sequence[Line], raw: Sequence[str]) -> dict[str, str]:
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
    if rest and (":" not in first or first.endswith(":")):
        return first.rstrip(": "), " ".join(rest)
    plain = raw.strip().strip('"').rstrip('; ,\t"')
    key, colon, value = plain.partition(":")
    if not colon:
        key, colon, value = plain.partition("=")
    return (key.strip(' "'), value.strip(' ",;')) if colon else ("", plain)
