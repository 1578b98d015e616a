"""Several specimens in one export: adjacent, stacked, or labelled by a column."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

from validate.errors import RecordingError, UsageError
from validate.recording.tables.blocks import refuse_text, specimen_label
from validate.recording.tables.columns import role_of, time_column
from validate.recording.tables.table import Column, Table, looks_numeric, number
from validate.recording.tables.vocabulary import SPECIMEN, holds, plain

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
        above = _labels_above(table, len(groups))
        labels = above or [str(i + 1) for i in range(len(groups))]
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


def _labels_above(table: Table, count: int) -> list[str]:
    """The cells of a line above the names that holds one different specimen for each group."""
    for cells in reversed(table.above):
        texts = [t for t in cells if t]
        named = [t for t in texts if holds(t, SPECIMEN) or re.search("[0-9]", t)]
        if len(texts) == count == len(set(texts)) == len(named):
            return [specimen_label([t]) or t for t in texts]
    return []


# --- below each other ----------------------------------------------------------------------------


def _by_column(table: Table) -> list[Table]:
    """Parts of a table with a column such as `Specimen` that changes along the rows."""
    named = [c for c in table.columns if holds(c.name, SPECIMEN) and role_of(c) is None]
    for column in named:
        starts = [0, *(i + 1 for i, (a, b) in enumerate(pairwise(column.cells)) if a != b)]
        values = [column.cells[i] for i in starts]
        if 1 < len(values) == len(set(values)) and all(values) and _restarts(table, starts):
            ends = [*starts[1:], len(table.lines)]
            return [
                replace(table.take(range(a, b)), specimen=v)
                for a, b, v in zip(starts, ends, values, strict=True)
            ]
    return [table]


def _restarts(table: Table, starts: Sequence[int]) -> bool:
    """Whether time, where there is one, begins anew at every start."""
    time = _time(table)
    if time is None:
        return True
    values = [number(c, table.decimal) for c in time.cells]
    return all(
        a is not None and b is not None and b <= a
        for a, b in ((values[i - 1], values[i]) for i in starts[1:])
    )


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
