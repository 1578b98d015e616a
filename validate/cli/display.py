"""Tables and progress bars on the terminal; plain lines when it is not one."""

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from validate.report.numbers import duration, significant, with_unit

if TYPE_CHECKING:  # what only names a type costs `validate list` nothing
    from validate.compare.published import Published
    from validate.compare.verdict import Check


def console(*, error: bool = False) -> Console:
    """Standard output or error; a pipe gets wide lines without colour."""
    found = Console(stderr=error, highlight=False)
    return found if found.is_terminal else Console(stderr=error, highlight=False, width=160)


def table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """A table of texts; every column with a unit carries it in its name."""
    made = Table(title=title, title_justify="left", title_style="bold", box=None, pad_edge=False)
    for column in columns:
        made.add_column(column, overflow="fold")
    for row in rows:
        made.add_row(*row)
    return made


def figures_table(published: "Sequence[Published]") -> Table:
    """Printed figures beside ours, with today's verdict."""
    rows = [[p.name, _value(p.ours, p), _value(p.theirs, p), p.line, p.why] for p in published]
    return table("Published figures", ["figure", "ours", "theirs", "verdict", "why"], rows)


def _value(value: float | None, figure: "Published") -> str:
    return "-" if value is None else shown(value, figure.unit)


@contextmanager
def progress(title: str) -> Iterator[Callable[[int, int, str], None]]:
    """A bar with the time left on standard error; silent when that is no terminal.

    Yields what a road reports to: done, total, what comes next.
    """
    screen = Console(stderr=True)
    with Progress(
        TextColumn(title),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.description}"),
        console=screen,
        disable=not screen.is_terminal,
        transient=True,
    ) as bar:
        task = bar.add_task("", total=None)

        def report(done: int, total: int, text: str) -> None:
            bar.update(task, completed=done, total=total, description=text)

        yield report


def shown(value: float, unit: str) -> str:
    """A value with its unit as people read it, four significant digits: a small one is no zero."""
    if unit == "Pa" and abs(value) >= 1000:
        return f"{significant(value / 1e3, 4)} kPa"
    return duration(value) if unit == "s" else with_unit(value, unit, 4)


def error_shown(check: "Check") -> str:
    """The error of a check; that noise explains all of it is no zero."""
    return "within noise" if check.value == 0 < check.raw else shown(check.value, check.unit)


def relative(path: Path) -> str:
    """The path from here when it lies below, else whole."""
    text = os.path.relpath(path)
    return str(path.resolve()) if text.startswith("..") else text
