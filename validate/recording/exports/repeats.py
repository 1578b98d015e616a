"""Rows that an export writes twice."""

from collections.abc import Sequence

from validate.errors import UsageError
from validate.recording.exports.columns import Said, time_column
from validate.recording.exports.numerals import number
from validate.recording.exports.table import Table


def without_repeats(table: Table, time: Said | None, keep: str | None) -> Table:
    """The table without first rows that are written twice, and what was left out in its notes.

    First rows count as repeated when they stand again below themselves cell by cell, time among
    them. `keep` is the user's: of rows that only share their time the `first` or the `last` is
    used; None leaves them, to be refused. Raises `UsageError` for another `keep`.
    """
    times = None if time is not None and time.column == "every" else _times(table)
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
    return table if keep is None else _one_per_time(table, times, keep)


def _times(table: Table) -> list[float | None] | None:
    column = time_column(table)
    return [number(cell, table.decimal) for cell in column.cells] if column else None


def _repeated(rows: Sequence[tuple[str, ...]]) -> int:
    """k when the first k rows stand again directly below themselves; 0 when they do not."""
    for k in range(1, len(rows) // 2 + 1):
        if rows[k] == rows[0] and list(rows[:k]) == list(rows[k : 2 * k]):
            return k
    return 0


def _one_per_time(table: Table, times: Sequence[float | None], keep: str) -> Table:
    count = len(times)
    if keep == "first":
        kept = [i for i in range(count) if i == 0 or times[i] != times[i - 1]]
    else:
        kept = [i for i in range(count) if i == count - 1 or times[i] != times[i + 1]]
    note = (
        f"{count - len(kept)} rows left out: the {keep} row of each time is read, as given by --map"
    )
    return table.take(kept, note)
