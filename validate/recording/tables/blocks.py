"""Parser of text exports: header blocks, names, units and rows; one or several tables.

A table begins with a line of names that rows follow. Tables much shorter than the others (results,
statistics) are kept as header lines and named in the notes. Blank lines may stand anywhere.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NoReturn

from validate.errors import RecordingError, UsageError
from validate.recording.tables.columns import Said, time_column
from validate.recording.tables.table import (
    NOTHING,
    Line,
    Split,
    Table,
    Text,
    columns_of,
    decimal_sign,
    decimals,
    decode,
    header_of,
    is_data,
    is_names,
    is_remark,
    is_row,
    is_unit_row,
    labview_units,
    looks_numeric,
    number,
    size_lines,
    split_lines,
    split_unit,
)
from validate.recording.tables.vocabulary import SPECIMEN, holds

# --- Rows of one table: of equal length, whole, without text between them.

MIN_SPARSE = 0.05  # a column empty in a larger part of the rows is sparse, in a smaller one damaged


@dataclass(frozen=True)
class Fitted:
    """Rows of equal length, the text lines below them, and what was done to them."""

    rows: list[Line]
    footer: list[Line]
    notes: tuple[str, ...]


def fitted(names: Line, lines: Sequence[Line]) -> Fitted:
    """Return the lines below `names` as rows of its length.

    Short rows are filled up where many rows lack these columns, or where a group of columns ends.
    Raises `RecordingError` with the line for every other row that is too short or too long, for
    text amid the rows, and where no line is a row.
    """
    count = max(i + 1 for i, cell in enumerate(names[1]) if cell)
    # Rows, and the text lines below the table.
    rows: list[Line] = []
    footer: list[Line] = []
    for line, cells in lines:
        # A remark below a table (at most key and value); a damaged row is a row, not a remark.
        if is_remark(cells) and sum(map(bool, cells)) < min(count, 3):
            footer.append((line, cells))
            continue
        if footer:
            refuse_text(*footer[0])
        rows.append((line, cells))
    if not rows:
        raise RecordingError(
            f"line {names[0]} names {count} columns, but no row of samples follows; export the "
            f"samples too"
        )
    notes = []
    # Lines with cells right of the table that cannot be its own: behind a gap, or remarks.
    right = [(line, cells[count:]) for line, cells in rows if any(cells[count:])]
    behind = all(not cells[0] for _, cells in right)
    remarks = all(not looks_numeric(c) and c.lower() not in NOTHING for _, r in right for c in r)
    beside = [line for line, _ in right] if behind or remarks else []
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


def refuse_text(line: int, words: Sequence[str]) -> NoReturn:
    """Raise `RecordingError` for words that stand amid samples."""
    raise RecordingError(
        f"line {line}: text '{' '.join(words).strip()[:60]}' between the rows; export one test "
        f"per file and correct this line"
    )


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


# --- Rows that an export writes twice.


def without_repeats(table: Table, time: Said | None, keep: str | None) -> Table:
    """Return the table without first rows that are written twice, and what was left out in its
    notes.

    First rows count as repeated when they stand again below themselves cell by cell, time among
    them. `keep` is the user's: of rows that only share their time the `first` or the `last` is
    used; None leaves them, to be refused. Raises `UsageError` for another `keep`.
    """
    if time is not None and time.column == "every":
        times = None
    else:
        column = time_column(table)
        times = [number(cell, table.decimal) for cell in column.cells] if column else None
    if keep not in (None, "first", "last"):
        raise UsageError(f"--map repeated={keep}: expected first or last")
    if times is None:
        return table
    rows = list(zip(*(c.cells for c in table.columns), strict=True))
    start = 0
    while size := _repeated(rows[start:]):
        start += size
    if start:
        note = f"{start} first rows, from line {table.lines[0]} on, occur twice: they are read once"
        table, times = table.take(range(start, len(rows)), note), times[start:]
    if keep is None:
        return table
    count = len(times)
    if keep == "first":
        kept = [i for i in range(count) if i == 0 or times[i] != times[i - 1]]
    else:
        kept = [i for i in range(count) if i == count - 1 or times[i] != times[i + 1]]
    note = (
        f"{count - len(kept)} rows left out: the {keep} row of each time is read, as given by --map"
    )
    return table.take(kept, note)


def _repeated(rows: Sequence[tuple[str, ...]]) -> int:
    """k when the first k rows stand again directly below themselves; 0 when they do not."""
    for k in range(1, len(rows) // 2 + 1):
        if rows[k] == rows[0] and list(rows[:k]) == list(rows[k : 2 * k]):
            return k
    return 0


# -------------------------------------------------------------------------------------------------

MIN_ROWS = 10  # a shorter table beside longer ones is one of results, not of samples
_NUMBERED = re.compile(r"[^0-9]{2,24}?[\s:#№._-]*(?P<label>[A-Za-z]{0,2}[0-9][\w.-]{0,8})")


@dataclass(frozen=True)
class TextBlock:
    """Lines of one table: the file's and its own header, names, units, rows of any length."""

    shared: list[Line]
    header: list[Line]
    names: Line
    units: list[str]
    rows: list[Line]
    specimen: str
    notes: tuple[str, ...] = ()


def parse_tables(
    data: bytes, encoding: str | None = None, decimal: str | None = None
) -> list[Table]:
    """All tables of samples in the bytes of a text file, in their order.

    `encoding` and `decimal` are the user's, None: found. Raises `RecordingError` for empty and
    binary files, text without a table, tables without column names, text amid the rows, rows with
    too few or too many cells; `UsageError` for an unknown encoding or decimal sign.
    """
    if decimal not in (None, ".", ","):
        raise UsageError(f"--map decimal={decimal}: the decimal sign is '.' or ','")
    text = decode(data, encoding)
    raw = re.split(r"\r\n|\r|\n", text.text)
    split = split_lines(raw)
    blocks = [_even(b) for b in _blocks(split)]
    if raw[-1].strip():
        refuse_cut(blocks[-1].rows)
    for block in blocks:
        refuse_emptied(split.emptied, block.rows)
    sign = decimal or decimal_sign((i, c) for b in blocks for i, row in b.rows for c in row)
    return [_table(b, raw, text, split.separator, sign) for b in blocks]


def _table(block: TextBlock, raw: Sequence[str], text: Text, separator: str, decimal: str) -> Table:
    table = Table(
        header={**header_of(block.shared, raw), **header_of(block.header, raw)},
        columns=columns_of(block.names[1], block.units, block.rows),
        lines=tuple(line for line, _ in block.rows),
        names_line=block.names[0],
        encoding=text.encoding,
        encoding_why=text.why,
        separator=separator,
        decimal=decimal,
        specimen=block.specimen,
        above=tuple(tuple(cells) for _, cells in block.shared + block.header),
        notes=block.notes,
    )
    sparse = [c.label for c in table.columns if is_sparse(c.cells)]
    if sparse:
        table = replace(table, notes=(*table.notes, f"columns with gaps: {', '.join(sparse)}"))
    return table


def _even(block: TextBlock) -> TextBlock:
    """The block with rows of equal length; text lines below its table go to its header."""
    found = fitted(block.names, block.rows)
    return replace(
        block,
        header=block.header + found.footer,
        rows=found.rows,
        notes=(*block.notes, *found.notes),
    )


# --- where tables begin and end ------------------------------------------------------------------


def _blocks(split: Split) -> list[TextBlock]:
    lines, run = split.lines, split.run
    # Indices of the lines of names that rows follow: the nearest line of names above each.
    tops: list[int] = []
    top = -1
    for i, (_, cells) in enumerate(lines):
        if is_names(cells):
            top = i
        elif top >= 0 and is_data(cells):
            tops.append(top)
            top = -1
    if not tops or tops[0] > run:
        between = {"\t": " <tab> "}.get(split.separator, split.separator)
        line, first = lines[run]
        poses = "; for poses over time, the line: # timestamp tx ty tz qx qy qz qw"
        raise RecordingError(
            f"the table at line {line} has no column names; add a line such as "
            f"'{between.join(('Time (s)', 'Displacement (mm)', 'Force (N)'))}' above it"
            f"{poses if len(first) == 8 and is_row(first, 8) else ''}"
        )
    sizes = [_size(lines, tops, k) for k in range(len(tops))]
    least = min(MIN_ROWS, max(sizes))
    shared: list[Line] = []
    blocks: list[TextBlock] = []
    above: list[Line] = list(lines[: tops[0]])
    small: list[str] = []
    for k, top in enumerate(tops):
        last = k + 1 == len(tops)
        names, units, rows, tail = _below(lines, tops, k, to_end=last and sizes[k] >= least)
        if sizes[k] < least:
            # Words amid samples, with a few more samples below, are no table of their own.
            width = max(len(cells) for _, cells in rows)
            alike = blocks and width == len(blocks[-1].names[1])
            bare = not units and not any(split_unit(cell)[1] for cell in names[1])
            if blocks and (sum(map(bool, names[1])) != width or (alike and bare)):
                refuse_text(*names)
            small.append(f"{len(rows)} rows below line {names[0]} ('{names[1][0]}', ...)")
            above += lines[top : tops[k + 1] if not last else len(lines)]
            above += size_lines(names, units, rows)
            continue
        units = units or labview_units(names[1], above)
        found = _stacked(TextBlock([], above, names, units, rows, ""))
        if blocks:
            found = [replace(b, shared=shared) for b in found]
        else:
            # The lines of the first table's header that are the file's: those above its specimen's.
            marks = [i for i, line in enumerate(found[0].header) if specimen_label(line[1])]
            shared = found[0].header[: marks[0]] if marks else found[0].header
        blocks += found
        above = tail
    blocks[-1] = replace(blocks[-1], header=blocks[-1].header + above)
    note = (f"tables not used: {'; '.join(small)}",) if small else ()
    return [replace(b, notes=b.notes + note) for b in blocks]


def _size(lines: Sequence[Line], tops: Sequence[int], k: int) -> int:
    end = tops[k + 1] if k + 1 < len(tops) else len(lines)
    return sum(is_data(cells) for _, cells in lines[tops[k] : end])


def _below(
    lines: Sequence[Line], tops: Sequence[int], k: int, *, to_end: bool
) -> tuple[Line, list[str], list[Line], list[Line]]:
    """Names, units, the rows below them, all of them `to_end`, and the header lines of the next
    table; a damaged row at the end is a row."""
    end = tops[k + 1] if k + 1 < len(tops) else len(lines)
    start = tops[k] + 1
    units: list[str] = []
    while start < end and (is_unit_row(lines[start][1]) or lines[start][1] == lines[tops[k]][1]):
        units = units or lines[start][1]
        start += 1
    stop = end
    while not to_end and stop > start:
        cells = lines[stop - 1][1]
        if is_data(cells) or not is_remark(cells):
            break
        stop -= 1
    return lines[tops[k]], units, list(lines[start:stop]), list(lines[stop:end])


def _stacked(block: TextBlock) -> list[TextBlock]:
    """The block in parts where lines such as `Specimen 2` stand amid its rows."""
    label = next(filter(None, (specimen_label(c) for _, c in reversed(block.header))), "")
    parts: list[tuple[str, list[Line]]] = [(label, [])]
    for line, cells in block.rows:
        mark = "" if is_data(cells) else specimen_label(cells)
        if mark and parts[-1][1]:
            parts.append((mark, []))
        elif mark:
            parts[-1] = (mark, [])
        else:
            parts[-1][1].append((line, cells))
    return [replace(block, specimen=mark, rows=rows) for mark, rows in parts]


def specimen_label(cells: Sequence[str]) -> str:
    """`2` for `Specimen 2`, `Probe;2` or `试样2`; empty for any other line."""
    filled = [c for c in cells if c]
    text = " ".join(filled).strip(" :;#")
    found = _NUMBERED.fullmatch(text) if len(filled) <= 2 else None
    return found["label"] if found and holds(text, SPECIMEN) else ""
