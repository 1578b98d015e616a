"""Tables of numbers: format of entries on the page, and tables and charts as CSV files."""

import csv
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from validate.compare.exhibit import Chart, Entry, NumberTable, TableCell, plain
from validate.files import safe_name
from validate.numbers import MISSING, digits, shown_unit, significant, text

Row = Iterable[Entry | TableCell]
_LONG, _WIDE = 30, 6  # letters of a text that goes below its row, columns of a wide table
_SIGNS = {"good": "✓ ", "bad": "✗ ", "open": "? "}


def shown(entry: Entry | TableCell) -> str:
    """Return an entry as read: three significant digits, whole numbers whole, a dash for None."""
    if isinstance(entry, TableCell):
        value, unit = entry.value, entry.unit
        words = text(value, unit) if unit and isinstance(value, float) else shown(value)
        return _SIGNS.get(entry.emphasis, "") + (entry.text or words)
    if entry is None:
        return MISSING
    if isinstance(entry, str):
        return entry
    return text(float(entry)) if isinstance(entry, int) else significant(entry)


def unit_cell(unit: str) -> TableCell:
    """Return an SI unit in a table whose numbers are SI: it reads as the unit that they are shown
    in."""
    return TableCell(unit, text=shown_unit(unit))


def word_columns(table: NumberTable) -> tuple[int, ...]:
    """Return the columns that hold text; the others hold numbers."""
    columns = list(zip(*table.rows, strict=True))
    return tuple(i for i, c in enumerate(columns) if any(isinstance(plain(v), str) for v in c))


@dataclass(frozen=True)
class Sheet:
    """A table as it is read: indices of its `columns` beside each other, `texts` of each row there,
    and the words `below` each row (none: no row has any)."""

    columns: tuple[int, ...]
    texts: tuple[tuple[str, ...], ...]
    below: tuple[str, ...]


def sheet(table: NumberTable) -> Sheet:
    """Return the table with the texts that stand below its rows.

    These are the column that is declared so and, in a table that has one or is wide, long texts but
    those of the first column; a column of mostly long ones goes altogether, of another the first
    words stay.
    """
    own = table.headings.index(table.below) if table.below else -1
    shared = table.below or len(table.headings) >= _WIDE
    texts = [[shown(entry) for entry in row] for row in table.rows]
    long = [[bool(shared and i and isinstance(plain(entry), str) and len(text) > _LONG)
             for i, (entry, text) in enumerate(zip(row, words, strict=True))]
            for row, words in zip(table.rows, texts, strict=True)]  # fmt: skip
    mostly = [2 * sum(column) > len(column) for column in zip(*long, strict=True)]
    columns = tuple(
        i for i in range(len(table.headings)) if i != own and not any(mostly[i : i + 1])
    )
    cut = tuple(
        tuple(f"{row[i][: _LONG - 1].rstrip()}…" if much[i] else row[i] for i in columns)
        for row, much in zip(texts, long, strict=True)
    )
    below = []
    for row, much in zip(texts, long, strict=True):
        first = row[own].removeprefix(MISSING) if table.below else ""
        named = [
            f"{table.headings[i]}: {text}"
            for i, text in enumerate(row)
            if i != own and (much[i] or (i not in columns and text not in ("", MISSING)))
        ]
        below.append("; ".join(filter(None, (first, *named))))
    return Sheet(columns, cut, tuple(below) if any(below) else ())


def caption(table: NumberTable) -> str:
    """Title and note as sentences."""
    title = table.title if table.title.endswith(".") else f"{table.title}."
    return f"{title} {table.note}".strip()


def write_table(table: NumberTable, folder: Path) -> None:
    """The table as a CSV file of its name, entries as they are, empty where there is none."""
    if table.name and table.rows:
        write_csv(folder / f"{safe_name(table.name)}.csv", table.headings, table.rows)


def write_chart(chart: Chart, folder: Path) -> None:
    """Every point of every series as a CSV file."""
    write_csv(folder / f"chart_{safe_name(chart.name)}.csv", *chart_rows(chart))


def chart_rows(chart: Chart) -> tuple[tuple[str, ...], Iterator[Row]]:
    """Return the head of a chart's file, and a row for each point of a series and each level."""
    head = ("series", "style", f"x: {chart.x}", f"y: {chart.y}", f"upper: {chart.y}")
    return head, _points(chart)


def write_csv(
    path: Path, head: tuple[str, ...], rows: Iterable[Row], as_shown: bool = False
) -> None:
    """One header line; numbers in full precision, or `as_shown` with the digits that they are shown
    with."""
    with path.open("w", newline="", encoding="utf-8") as out:
        writer = csv.writer(out)
        writer.writerow(head)
        writer.writerows(
            [_digits(entry) if as_shown else _written(plain(entry)) for entry in row]
            for row in rows
        )


def _digits(entry: Entry | TableCell) -> str | int:
    """A number as a page shows it, as programs read it."""
    value = plain(entry)
    if isinstance(entry, TableCell) and entry.text and isinstance(value, float):
        return digits(entry.text)
    return _written(value)


def _written(value: Entry) -> str | int:
    if value is None:
        return ""
    return repr(float(value)) if isinstance(value, float) else value


def _points(chart: Chart) -> Iterator[Row]:
    """Every point of every series and, as one row without x, every level."""
    for s in chart.series:
        upper = s.upper.tolist() if s.upper is not None else [None] * len(s.x)
        for x, y, top in zip(s.x.tolist(), s.y.tolist(), upper, strict=True):
            yield s.name, s.style, x, y, top
    for name, y in chart.levels:
        yield name, "level", None, float(y), None
