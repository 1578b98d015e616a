"""Tables and sentences on the terminal; plain lines in a pipe or file."""

import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from validate.numbers import duration, significant, with_unit
from validate.report.views.layout import laid, width, wrapped

if TYPE_CHECKING:
    from validate.report.long_table import LongTable


def console(*, error: bool = False) -> Console:
    """Standard output or error, as wide as `width` says; colours on a terminal only."""
    stream = sys.stderr if error else sys.stdout
    return Console(stderr=error, highlight=False, emoji=False, width=width(stream))


def say(text: str, style: str = "", indent: str = "", *, error: bool = False) -> None:
    """Sentences, broken between words; `indent` from the second line on."""
    screen = console(error=error)
    for line in wrapped(text, screen.width, indent):
        screen.print(line, style=style, markup=False, soft_wrap=True)


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


def print_views(found: "LongTable", *names: str) -> None:
    """Views of a run as text, those without a row left out."""
    from validate.report.views.drawers import terminal
    from validate.report.views.standard import view_of
    from validate.report.views.view_filling import filled

    screen = console()
    for exhibit in (filled(view_of(name), found) for name in names):
        for line in ("", *terminal(exhibit, screen.width)) if exhibit.tables else ():
            screen.print(line, markup=False, soft_wrap=True)


def shown(value: float | None, unit: str) -> str:
    """Return a value with its unit as people read it, four significant digits: a small one is no
    zero."""
    if value is None:
        return "-"
    if unit == "Pa" and abs(value) >= 1000:
        return f"{significant(value / 1e3, 4)} kPa"
    return duration(value) if unit == "s" else with_unit(value, unit, 4)


def error_shown(check: Mapping[str, Any]) -> str:
    """Return the error of a check, as in results.json; that noise explains all of it is no zero."""
    value, raw = check["value"], check["raw"]
    return "below noise" if value == 0 < raw else shown(value, check["unit"])


def relative(path: Path) -> str:
    """Return the path from here when it lies below, else whole."""
    text = os.path.relpath(path)
    return str(path.resolve()) if text.startswith("..") else text
