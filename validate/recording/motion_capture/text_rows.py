"""Text tables of coordinates from motion capture and trackers: rows of cells and numbers.

A blank cell, `nan`, `NULL` or `-` is "not seen". Where no number has a point a comma is one.
Programs that log write line by line: where one was ended the last line is cut. It is left out then,
and the recording says so; every other odd line is an error that names it.
"""

import csv
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path

import numpy as np

from validate.arrays import Floats
from validate.errors import RecordingError
from validate.recording.tables.table import decode, whole_file

NONE = 1e20  # NDI writes -3.7e28 for a number that is none
ASSUMED = "assumed"  # a record: what was taken of a file and what decided, a line each
LEFT_OUT = "left out"  # a record's key: what of the file did not become data
ZEROS = "three zeros"  # a record's key: how many points were taken as not seen
_CUT = ", cut: "  # in the entry of a last line that was left out
_FIRST = 8  # lines that tell what stands between cells
ABSENT = {"", "nan", "NaN", "NAN", "-", "NULL", "Null", "null"}


@dataclass(frozen=True)
class TextRow:
    """The cells of a line, counted from 1."""

    line: int
    cells: tuple[str, ...]

    def cell(self, i: int) -> str:
        """Empty beyond the end."""
        return self.cells[i] if i < len(self.cells) else ""


@dataclass(frozen=True)
class TextRows:
    """All lines as cells; `open_end`: the last line has no line end."""

    name: str
    rows: tuple[TextRow, ...]
    open_end: bool
    told: dict[str, str] = field(default_factory=dict)


def text_rows(path: Path) -> TextRows:
    """Return the file split at tabs, semicolons or commas, whichever most of its first lines have;
    before commas the others, beside which a comma is a number's; at spaces, where they have none.

    Raises `UsageError` for a file that cannot be read, `RecordingError` for one that is no text.
    """
    return rows_of(path.name, whole_file(path))


def rows_of(name: str, data: bytes) -> TextRows:
    """`text_rows` of the bytes of the file `name`."""
    try:
        text = decode(data).text
    except RecordingError as error:
        raise RecordingError(f"{name}: {error}") from None
    lines = text.splitlines()
    often = {mark: sum(mark in line for line in lines[:_FIRST]) for mark in "\t;,"}
    separator = max(often, key=lambda mark: often[mark])
    if not often[separator]:
        # With one space between words; a mark of comments is none: `# t x` is `#t x`.
        lines, separator = [re.sub(r"^#+ ", "#", " ".join(line.split())) for line in lines], " "
    cells = csv.reader(lines, delimiter=separator, skipinitialspace=True, quoting=csv.QUOTE_MINIMAL)
    try:
        rows = tuple(
            TextRow(i + 1, tuple(c.strip() for c in found)) for i, found in enumerate(cells)
        )
    except csv.Error as error:
        raise RecordingError(f"{name}: not a table of cells ({error})") from None
    return TextRows(name, rows, not text.endswith(("\n", "\r")))


def fields_above(held: TextRows, header: TextRow) -> dict[str, str]:
    """Values by key, in small letters, of the lines above a line of names, as `Frequency: 100`."""
    found = {}
    for row in held.rows:
        key, _, value = row.cell(0).partition(":")
        if row.line < header.line and (text := value.strip() or row.cell(1)):
            found[key.strip().lower()] = text
    return found


def numbers(
    held: TextRows, rows: Sequence[TextRow], width: int, columns: Sequence[int] | None = None
) -> tuple[Floats, tuple[TextRow, ...], tuple[str, ...]]:
    """Numbers (n, k) of k columns (all `width` where none are named), NaN where a cell is blank,
    the rows that they stand in, and what was left out.

    A row may be longer by blank cells. The last line of an unfinished file is left out where it has
    fewer cells, or its last number fewer decimals, than all others. Raises `RecordingError` for a
    cell that is no number, one too many, and without rows.
    """
    # The rows without an unfinished last one.
    whole, left = rows, ""
    if rows and held.open_end and rows[-1] is held.rows[-1]:
        last, others = rows[-1], rows[:-1]
        fewest = min((len(r.cells) for r in others), default=width)
        cells = [r.cell(len(last.cells) - 1) for r in others]
        if len(last.cells) < min(fewest, width):
            whole, left = others, f"line {last.line}{_CUT}{len(last.cells)} of {width} cells"
        elif cells and _decimals(last.cells[-1]) < min(map(_decimals, cells)):
            whole, left = others, f"line {last.line}{_CUT}its last number is '{last.cells[-1]}'"
    if not whole:
        raise RecordingError(f"{held.name}: no row of numbers below its header; cut or damaged")
    for row in whole:
        extra = [c for c in row.cells[width:] if c]
        if extra:
            raise RecordingError(
                f"{held.name}: line {row.line} has {len(row.cells)} cells, its header {width}; "
                f"'{extra[0][:20]}' belongs to no column"
            )
    wanted = range(width) if columns is None else columns
    texts = [[_plain(row.cell(i)) for i in wanted] for row in whole]
    if not any("." in text for row in texts for text in row):
        texts = [[_pointed(text) for text in row] for row in texts]
    try:
        found = np.array(texts, dtype=np.float64)
    except ValueError:
        for row, i in product(whole, wanted):
            try:
                float(_plain(row.cell(i)))
            except ValueError:
                raise RecordingError(
                    f"{held.name}: line {row.line}: '{row.cell(i)[:40]}' is not a number; correct "
                    "or remove it"
                ) from None
        raise RecordingError(f"{held.name}: a cell is no number") from None
    if np.isinf(found).any():
        at = int(np.argmax(np.isinf(found).any(axis=1)))
        raise RecordingError(f"{held.name}: line {whole[at].line} has an infinite number")
    return found, tuple(whole), (left,) if left else ()


def _plain(cell: str) -> str:
    return "nan" if cell in ABSENT else cell


def _pointed(cell: str) -> str:
    """With the comma of a decimal number as a point."""
    return cell.replace(",", ".") if cell.count(",") == 1 else cell


def as_number(cell: str) -> float | None:
    """Return a number with either sign of decimals; none where it is no number."""
    try:
        return float(_pointed(cell))
    except ValueError:
        return None


def without_zeros(x: Floats) -> tuple[Floats, int]:
    """Points (nt, k, 3), those that are exactly zero as not seen, and how many: programs write
    zeros for what no camera saw, and no camera sees a point at zero in all digits."""
    zero = (x == 0).all(axis=2, keepdims=True)
    return np.where(zero, np.nan, x), int(zero.sum())


def told_zeros(count: int) -> dict[str, str]:
    """Return the record's entry about points that are three zeros; none where none is."""
    return {ZEROS: f"{count} points, taken as missing"} if count else {}


def _decimals(cell: str) -> int:
    found = re.fullmatch(r"[-+]?\d*[.,](\d*)(?:[eE].*)?", cell)
    return len(found[1]) if found else 0


def whole_points(
    held: TextRows, x: Floats, names: Sequence[str], rows: Sequence[TextRow]
) -> Floats:
    """Coordinates (nt, k, d), where a point with one that is blank has none.

    Raises `RecordingError` naming line and point: a damaged line, not a point that was not seen.
    """
    absent = np.isnan(x)
    torn = absent.any(axis=2) & ~absent.all(axis=2)
    if torn.any():
        i, k = (int(j) for j in np.argwhere(torn)[0])
        raise RecordingError(
            f"{held.name}: line {rows[i].line}: point '{names[k]}' has "
            f"{int((~absent[i, k]).sum())} of {x.shape[2]} coordinates; damaged"
        )
    return x


def cut_lines(records: Iterable[Mapping[str, str]]) -> list[str]:
    """Return the last lines that were left out because the file is cut there."""
    told = (line for record in records for line in record.get(LEFT_OUT, "").split("; "))
    return [line for line in told if _CUT in line]


def told_left(left: Sequence[str]) -> dict[str, str]:
    """Return the record's entry about what was left out; none where nothing was."""
    return {LEFT_OUT: "; ".join(left)} if left else {}
