"""Tables and sentences on the terminal; plain lines when it is not one."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from rich.console import Console

from validate.cli.layout import laid, wrapped
from validate.report.numbers import duration, significant, with_unit

if TYPE_CHECKING:  # what only names a type costs `validate list` nothing
    from validate.compare.published import Published
    from validate.compare.verdict import Check


_WIDTH = 80  # columns where neither COLUMNS nor a terminal says how many there are


def width(stream: TextIO) -> int:
    """COLUMNS, else those of the terminal that the stream is, else 80."""
    given = os.environ.get("COLUMNS", "")
    if given.isdigit() and int(given) > 0:
        return int(given)
    try:
        return os.get_terminal_size(stream.fileno()).columns or _WIDTH
    except (OSError, ValueError):  # a pipe, a file, no stream of the system
        return _WIDTH


def console(*, error: bool = False) -> Console:
    """Standard output or error, as wide as `width` says; colours on a terminal only."""
    stream = sys.stderr if error else sys.stdout
    return Console(stderr=error, highlight=False, width=width(stream))


def say(text: str, style: str = "", indent: str = "", *, error: bool = False) -> None:
    """Sentences, broken between words; `indent` from the second line on."""
    screen = console(error=error)
    for line in wrapped(text, screen.width, indent):
        screen.print(line, style=style, markup=False, soft_wrap=True)


def warn(text: str, *, error: bool = False) -> None:
    """A warning, which nobody overlooks on a terminal."""
    say(f"warning: {text}", "yellow", "  ", error=error)


def table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """A table of texts below its title; a column with a unit carries it in its name."""
    if not rows:
        say(f"\n{title}: none")
        return
    screen = console()
    if title:
        say(f"\n{title}", "bold")
    for line in laid(columns, rows, screen.width):
        screen.print(line, markup=False, soft_wrap=True)


def fits(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> bool:
    """Whether each row of such a table is one line."""
    return len(laid(columns, rows, console().width)) == 1 + len(rows)


def figures_table(published: "Sequence[Published]") -> None:
    """Printed figures beside ours, with today's verdict."""
    rows = [[p.name, _value(p.ours, p), _value(p.theirs, p), p.line, p.why] for p in published]
    table("Published figures", ["figure", "ours", "theirs", "verdict", "why"], rows)


def _value(value: float | None, figure: "Published") -> str:
    return "-" if value is None else shown(value, figure.unit)


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
