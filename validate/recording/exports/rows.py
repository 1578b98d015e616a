"""Rows of one table: of equal length, whole, without text between them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NoReturn

from validate.errors import RecordingError
from validate.recording.exports.cells import NOTHING, Line, is_remark
from validate.recording.exports.numerals import decimals, looks_numeric

MIN_SPARSE = 0.05  # a column empty in a larger part of the rows is sparse, in a smaller one damaged


@dataclass(frozen=True)
class Fitted:
    """Rows of equal length, the text lines below them, and what was done to them."""

    rows: list[Line]
    footer: list[Line]
    notes: tuple[str, ...]


def fitted(names: Line, lines: Sequence[Line]) -> Fitted:
    """The lines below `names` as rows of its length.

    Short rows are filled up where many rows lack these columns, or where a group of columns ends.
    Raises `RecordingError` with the line for every other row that is too short or too long, for
    text amid the rows, and where no line is a row.
    """
    count = max(i + 1 for i, cell in enumerate(names[1]) if cell)
    rows, footer = _rows(lines, count)
    if not rows:
        raise RecordingError(
            f"line {names[0]} names {count} columns, but no row of samples follows; export the "
            f"samples too"
        )
    notes = []
    beside = _beside(rows, count)
    if beside:
        notes.append(f"cells right of the table: {len(beside)} rows, first line {beside[0]}")
        rows = [(line, cells[:count]) for line, cells in rows]
    short = [line for line, cells in rows if len(cells) < count]
    padded = [(line, cells + [""] * (count - len(cells))) for line, cells in rows]
    gaps = {i for i in range(count) if is_sparse([cells[i] for _, cells in padded])}
    ends = {i for i in range(1, count) if not names[1][i]}
    for line, cells in rows:
        missing = set(range(len(cells), count))
        if any(cells[count:]) or not (missing <= gaps or len(cells) in ends):
            raise RecordingError(
                f"line {line}: {len(cells)} cells, but line {names[0]} names {count} columns; "
                "a cut row: remove it; or decimal commas between separating commas: export it again"
            )
    if short:
        notes.append(f"{len(short)} rows end early, first line {short[0]}")
    return Fitted([(line, cells[:count]) for line, cells in padded], footer, tuple(notes))


def _rows(lines: Sequence[Line], count: int) -> tuple[list[Line], list[Line]]:
    """Rows, and the text lines below the table."""
    rows: list[Line] = []
    footer: list[Line] = []
    for line, cells in lines:
        if _is_text(cells, count):
            footer.append((line, cells))
            continue
        if footer:
            refuse_text(*footer[0])
        rows.append((line, cells))
    return rows, footer


def refuse_text(line: int, words: Sequence[str]) -> NoReturn:
    """Raises `RecordingError` for words that stand amid samples."""
    raise RecordingError(
        f"line {line}: text '{' '.join(words).strip()[:60]}' between the rows; export one test "
        f"per file and correct this line"
    )


def _is_text(cells: Sequence[str], count: int) -> bool:
    """A remark below a table (at most key and value); a damaged row is a row, not a remark."""
    return is_remark(cells) and sum(map(bool, cells)) < min(count, 3)


def _beside(rows: Sequence[Line], count: int) -> list[int]:
    """Lines with cells right of the table that cannot be its own: behind a gap, or remarks."""
    right = [(line, cells[count:]) for line, cells in rows if any(cells[count:])]
    behind = all(not cells[0] for _, cells in right)
    remarks = all(not looks_numeric(c) and c.lower() not in NOTHING for _, r in right for c in r)
    return [line for line, _ in right] if behind or remarks else []


def is_sparse(cells: Sequence[str]) -> bool:
    empty = sum(not cell for cell in cells)
    return empty >= max(2, MIN_SPARSE * len(cells))


def refuse_emptied(emptied: Sequence[int], rows: Sequence[Line]) -> None:
    amid = [line for line in emptied if rows[0][0] < line < rows[-1][0]]
    if amid:
        raise RecordingError(
            f"line {amid[0]}: an empty row between the rows ({len(amid)} such rows); fill or "
            f"remove it"
        )


def refuse_cut(rows: Sequence[Line]) -> None:
    """A last line without line end whose number has fewer decimals than all above it is cut."""
    ends = [decimals(next((c for c in row[::-1] if c), "")) for _, row in rows]
    if len(ends) > 2 and ends[-1] < min(ends[:-1]) == max(ends[:-1]):
        raise RecordingError(
            f"line {rows[-1][0]}: the file is truncated: its last number '{rows[-1][1][-1]}' has "
            f"{ends[-1]} decimals, all others {ends[0]}; remove the row or copy again"
        )
