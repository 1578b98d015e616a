"""Table of a testing machine's export: text encoding, cells, decimal signs, header, units.

Knows no quantities. Units may stand in the column names, as `(mm)`, `[mm]`, `/mm`, `in mm` or
`_mm`, or in a row of their own.
"""

import codecs
import csv
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from validate.arrays import Floats, checked
from validate.errors import RecordingError, UsageError
from validate.files import read_bytes
from validate.recording.tables.vocabulary import (
    OTHER_PARTS,
    SIZES,
    UNIT_LABELS,
    evidence,
    holds,
    is_ideographic,
    plain,
)
from validate.units import is_unit

# --- Numbers as spreadsheets write them: decimal sign and thousands separators, decided per
# file.
#
# One file has one decimal sign. A cell such as `1,234` alone proves nothing; where no other cell
# decides, it is refused instead of guessed.

_LOOSE = re.compile(
    r"[-+]?(?=[.,]?[0-9])[0-9]*(?:[.,' \u00a0\u202f][0-9]+)*[.,]?(?:[eE][-+]?[0-9]{1,3})?"
)
_EITHER = re.compile(r"[1-9][0-9]{0,2}[.,][0-9]{3}")
_GROUPS = re.compile(r"[0-9]{1,3}(?P<mark>[.,])[0-9]{3}(?:(?P=mark)[0-9]{3})*")


def _form(decimal: str, other: str) -> re.Pattern[str]:
    grouped = rf"[0-9]{{1,3}}(?P<mark>[{other}' \u00a0\u202f])[0-9]{{3}}(?:(?P=mark)[0-9]{{3}})*"
    return re.compile(
        rf"(?P<whole>[-+]?(?:[0-9]+|{grouped})?)(?:{re.escape(decimal)}(?P<part>[0-9]*))?"
        r"(?P<power>[eE][-+]?[0-9]{1,3})?"
    )


_FORMS = {".": _form(".", ","), ",": _form(",", ".")}


def looks_numeric(cell: str) -> bool:
    """Return whether the cell is a number in some notation."""
    return _LOOSE.fullmatch(_plain_minus(cell)) is not None


def decimal_sign(cells: Iterable[tuple[int, str]]) -> str:
    """`.` or `,`: the decimal sign of (line number, cell) pairs; cells without numbers are ignored.

    Raises `RecordingError` naming lines when cells contradict each other or when a comma may be
    either a decimal or a thousands sign.
    """
    shown: dict[str, tuple[int, str]] = {}
    for line, cell in cells:
        if "." in cell or "," in cell:
            for vote in _votes(_plain_minus(cell)):
                shown.setdefault(vote, (line, cell))
    if "." in shown and "," in shown:
        (a, dot), (b, comma) = shown["."], shown[","]
        raise RecordingError(
            f"two decimal signs: '{dot}' in line {a}, '{comma}' in line {b}; export it with one"
        )
    decimal = "," if "," in shown else "."
    doubtful = shown.get("?." if decimal == "," else "?,")
    if doubtful and "grouped" not in shown:
        line, cell = doubtful
        raise RecordingError(
            f"line {line}: '{cell}' may hold a thousands or a decimal sign; "
            "export without thousands separators"
        )
    return decimal


def number(cell: str, decimal: str) -> float | None:
    """Return the finite number in the cell, or None: empty, text, NaN, infinite or wrongly
    grouped."""
    found = _FORMS[decimal].fullmatch(_plain_minus(cell))
    if found is None or not looks_numeric(cell):
        return None
    whole = re.sub(r"[^-+0-9]", "", found["whole"])
    value = float(f"{whole}.{found['part'] or '0'}{found['power'] or ''}")
    return value if math.isfinite(value) else None


def decimals(cell: str) -> int:
    """Return the number of digits after the last decimal or thousands sign; 0 for integers."""
    found = re.search(r"[.,]([0-9]*)[^.,]*$", cell)
    return len(found[1]) if found else 0


def _votes(cell: str) -> tuple[str, ...]:
    """What a cell shows: the decimal sign, `?.` or `?,` when it may be either, and grouping."""
    if _LOOSE.fullmatch(cell) is None:
        return ()
    body, *power = re.split("[eE]", cell.lstrip("-+"))
    dots, commas = body.count("."), body.count(",")
    if dots and commas:
        decimal = "." if body.rfind(".") > body.rfind(",") else ","
        whole, _, _ = body.rpartition(decimal)
        return (decimal, "grouped") if _GROUPS.fullmatch(whole) else ()
    mark, other = (",", ".") if commas else (".", ",")
    if body.count(mark) > 1:
        return (other, "grouped") if _GROUPS.fullmatch(body) else ()
    if _EITHER.fullmatch(body) and not power:
        return ("?" + mark,)
    return (mark,)


def _plain_minus(cell: str) -> str:
    return cell.strip().replace("\u2212", "-")


# -------------------------------------------------------------------------------------------------

Line = tuple[int, list[str]]  # line number in the file, cells
SEPARATORS = ("\t", ";", ",", "|", "  ", " ")  # two spaces or more; one, where none else does
NOTHING = {"nan", "-nan", "inf", "-inf", "#n/a", "n/a", "null", "none", "--", "---", "err"}
_UNIT_CELL = re.compile(r"[(\[{<][^()\[\]]*[)\]}>]")
_WIDE_SIGNS = str.maketrans("（）［］【】：；＃", "()[][]:;#")
_FEW = 4  # numbers: fewer are no table
_LONGEST_UNIT = 12  # characters


@dataclass(frozen=True)
class Split:
    """Lines in cells for one separator, without blank ones; `run` is where most rows begin."""

    score: int
    separator: str
    lines: list[Line]
    emptied: list[int]
    run: int


def split_lines(raw: Sequence[str]) -> Split:
    """Return the lines split at the separator that gives most numbers.

    Raises `RecordingError` when none gives a table.
    """
    best = Split(0, ",", [], [], 0)
    for separator in SEPARATORS:
        if not any(separator in line for line in raw) or (separator == " " and best.score >= _FEW):
            continue
        split = [(i + 1, _cells(line, separator)) for i, line in enumerate(raw)]
        filled = [(i, cells) for i, cells in split if any(cells)]
        # Count of numbers in the longest run of rows, and the index where it starts.
        score = run = count = start = 0
        for index, (_, cells) in enumerate(filled):
            if not is_row(cells):
                start, count = index + 1, 0
                continue
            count += sum(looks_numeric(cell) for cell in cells)
            if count > score:
                score, run = count, start
        if score > best.score:
            emptied = [i for i, cells in split if len(cells) > 1 and not any(cells)]
            best = Split(score, separator, filled, emptied, run)
    if best.score < _FEW:
        raise RecordingError(
            f"no table of numbers in {len(raw)} lines of text "
            f"(columns separated by comma, semicolon, tab, | or spaces were searched)"
        )
    return best


def _cells(line: str, separator: str) -> list[str]:
    text = line.translate(_WIDE_SIGNS) if not line.isascii() else line
    if separator == "  ":
        return [cell.strip(' "') for cell in re.split(" {2,}", text.strip())]
    if separator == " ":  # as numpy writes tables; a unit in brackets belongs to the name before
        return re.split(r" +(?![(\[])", text.strip().lstrip("#%").strip())
    text = text.rstrip("; \t") if separator == "," else text
    try:
        split = next(csv.reader([text], delimiter=separator, skipinitialspace=True), [])
    except csv.Error as error:
        raise RecordingError(f"not CSV text: a line of {len(line)} characters: {error}") from error
    return [cell.strip() for cell in split]


def is_row(cells: Sequence[str], least: int = 1) -> bool:
    """Return whether at least `least` cells and half of the filled ones are numbers."""
    numbers = sum(looks_numeric(cell) or cell.lower() in NOTHING for cell in cells)
    return len(cells) >= 2 and numbers >= least and 2 * numbers >= sum(map(bool, cells))


def is_data(cells: Sequence[str]) -> bool:
    """Return a row of a table, not a `key,number` line of a header block."""
    return is_row(cells, least=2)


def is_unit_row(cells: Sequence[str]) -> bool:
    """Return whether most cells are units or stand in brackets, and the others are as short."""
    filled = [c for c in cells if c]
    if filled and holds(filled[0], UNIT_LABELS) and not _UNIT_CELL.fullmatch(filled[0]):
        filled = filled[1:]
    units = sum(bool(_UNIT_CELL.fullmatch(c)) or is_unit(c) for c in filled)
    short = all(len(c) <= _LONGEST_UNIT and not looks_numeric(c) for c in filled)
    return (short and 2 * units > len(filled)) or (units == len(filled) > 0)


def is_names(cells: Sequence[str]) -> bool:
    """Return whether the cells may name columns: two words or more, no numbers before the first
    gap."""
    words = any(
        len(named) >= 2 and not any(looks_numeric(c) or c.lower() in NOTHING for c in named)
        for named in ([c for c in cells if c], [c for c in cells[: _gap(cells)] if c])
    )
    return words and not is_unit_row(cells)


def _gap(cells: Sequence[str]) -> int:
    """Index of the first empty cell after a filled one; the length where there is none."""
    filled = next((i for i, c in enumerate(cells) if c), 0)
    return next((i for i in range(filled, len(cells)) if not cells[i]), len(cells))


def is_remark(cells: Sequence[str]) -> bool:
    """Return whether the line begins with a word, as lines of header blocks do and rows do not."""
    first = next(c for c in cells if c)
    word = re.search(r"[^\W\d_]{2}|[^\W\d_\x00-\u2e7f]", first)
    return bool(word) and not looks_numeric(first) and first.lower() not in NOTHING


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
        if (
            is_unit(unit)
            and len(values) == 1
            and (holds(name, _SIZE_WORDS) and not holds(name, OTHER_PARTS))
        ):
            found.append((names[0], [name, *values, unit]))
    return found


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
        first, *rest = [cell for cell in cells if cell]
        # `Dimension : Diameter,,50.0,mm`: the colon belongs to the key, a number follows in a cell.
        if rest and (
            ":" not in first
            or first.endswith(":")
            or (looks_numeric(rest[0]) and not re.search(r"[0-9]", first.partition(":")[2]))
        ):
            key, value = first.rstrip(": "), " ".join(rest)
        else:
            plain = raw[line - 1].strip().strip('"').rstrip('; ,\t"')
            key, sign, value = plain.partition(":" if ":" in plain else "=")
            key, value = (key.strip(' "'), value.strip(' ",;')) if sign else ("", plain)
        if not key:
            key = f"line {line}"
        elif header.get(key, value) != value:
            key = f"{key} (line {line})"
        header[key] = value
    return header


# --- text encoding of a file, chosen by evidence that the recording lists ------------------------

MAX_BYTES = 256 * 1024 * 1024
# In order of preference where nothing decides.
CANDIDATES = ("cp1252", "cp1250", "gb18030", "cp1251", "cp932", "big5", "cp850", "cp852")
_BY_WORDS = CANDIDATES[2:]  # nearly any bytes are text in these: known words must speak for them
_HIGH = re.compile(rb"[\x80-\xff]+")
_GB_COMMON = re.compile(rb"(?:[\xb0-\xd7][\xa1-\xfe])+")  # the frequent characters of GB 2312
_ODD_SIGN = re.compile(r"(?<=[^\W\d_])[^\w\s!-~](?=[^\W\d_])|(?<=[^\W\d_])[¹²³¼½¾](?=[^\W\d_])")


@dataclass(frozen=True)
class Text:
    """The text, its encoding, and what decided for it."""

    text: str
    encoding: str
    why: str


@dataclass(frozen=True)
class _Reading:
    """One candidate's text, the known words in it, and its signs that stand where none should."""

    encoding: str
    text: str
    words: tuple[str, ...]
    hits: int
    odd: int


def decode(data: bytes, said: str | None = None) -> Text:
    """Return the text of a file; `said` is an encoding the user gives, which is then believed.

    Raises `RecordingError` for empty, oversized and binary files, and for bytes that no encoding
    known here can hold; `UsageError` for an unknown `said`.
    """
    if len(data) > MAX_BYTES:
        raise RecordingError(f"{len(data)} bytes, the limit for text tables is {MAX_BYTES}")
    if said:
        try:
            encoding, why = codecs.lookup(said).name, "given by --map"
        except LookupError:
            raise UsageError(
                f"--map encoding={said}: unknown encoding; expected utf-8, utf-16, "
                f"{', '.join(CANDIDATES)}"
            ) from None
    else:
        encoding, why = _chosen(data)
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError as error:
        raise RecordingError(
            f"not a text file: byte {error.start} of {len(data)} is not {encoding}; "
            "export the test as CSV text, or name its encoding with --map encoding=cp1250"
        ) from error
    odd = re.search(r"[\x00-\x08\x0e-\x19\x1b-\x1f\x7f\ufffe\uffff]", text)
    if odd:
        raise RecordingError(
            f"a binary file: character {ord(odd[0])} at {odd.start()}; export the test as CSV text"
        )
    if not text.strip():
        raise RecordingError(f"an empty file ({len(data)} bytes)")
    return Text(text.strip("\x1a").removeprefix("\ufeff"), encoding, why)


def whole_file(path: Path) -> bytes:
    """Return the bytes of a text of bounded size; raises `RecordingError` where it cannot be
    read."""
    return read_bytes(path, MAX_BYTES)


def _chosen(data: bytes) -> tuple[str, str]:
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16", "byte order mark"
    head = data[:4096]
    if len(head) >= 4 and 0.3 * len(head) < head.count(0) <= 0.5 * len(head):
        little = head[1::2].count(0) > head[::2].count(0)
        return ("utf-16-le" if little else "utf-16-be"), "nearly every second byte is 0"
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        # The best of the older encodings; a file without any evidence is read as the first one.
        # Only lines with letters beyond ASCII tell something.
        lines = b"\n".join(line for line in re.split(rb"[\r\n]+", data) if not line.isascii())
        found = [r for r in (_reading(lines, name) for name in CANDIDATES) if r is not None]
        if not found:
            return CANDIDATES[0], "no known encoding fits"
        best = max(found, key=lambda r: (r.hits, -r.odd))  # the first of equals
        if best.words:
            return best.encoding, f"by its words {', '.join(best.words[:4])}"
        tied = [
            r for r in found if (r.hits, r.odd) == (best.hits, best.odd) and r.text != best.text
        ]
        doubt = f"; {' and '.join(r.encoding for r in tied)} would fit as well" if tied else ""
        return best.encoding, f"by the kind of its letters{doubt}"
    if data.startswith(codecs.BOM_UTF8):
        return "utf-8-sig", "byte order mark"
    return "utf-8-sig", "ASCII only" if data.isascii() else "valid UTF-8"


def _reading(lines: bytes, encoding: str) -> _Reading | None:
    """What the lines are in an encoding; None where they are no text in it, or no word says so."""
    try:
        text = lines.decode(encoding)
    except UnicodeDecodeError:
        return None
    # Known words with letters beyond ASCII, as written.
    found = {
        w for w in re.findall(r"[^\W\d_]+", text) if not w.isascii() and plain(w) in evidence()
    }
    whole = plain(text)
    found |= {w for w in evidence() if is_ideographic(w) and w in whole}
    words = sorted(found)
    # 1 when every run of high bytes is made of frequent Chinese characters.
    runs = _HIGH.findall(lines)
    hits = len(words) + int(
        encoding == "gb18030" and bool(runs) and all(map(_GB_COMMON.fullmatch, runs))
    )
    if encoding in _BY_WORDS and not hits:
        return None
    # Signs between letters, and letters of scripts that no word vouches for.
    strange = sum(ord(c) >= 0x400 or 0x2500 <= ord(c) < 0x2600 for c in text)
    spacing = sum(c in "˛˘˙˝ˇ¨¸¯" for c in text)
    return _Reading(
        encoding, text, tuple(words), hits, (len(_ODD_SIGN.findall(text)) + strange + spacing)
    )
