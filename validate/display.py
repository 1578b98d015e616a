"""Display of objects in one screen and as a short page, for the prompt and notebooks."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from html import escape
from itertools import zip_longest
from textwrap import shorten, wrap
from typing import Any

LINES, COLUMNS = 24, 100
_ROWS = 20  # of a table in a page


@dataclass(frozen=True)
class Screen:
    """What is shown of a result: a title, sentences, one table, and lines below it."""

    title: str
    words: tuple[str, ...] = ()
    head: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()
    below: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """At most 24 lines of at most 100 letters."""
        words = [line for text in self.words for line in wrap(text, COLUMNS)][:6]
        most = LINES - 3 - len(words) - len(self.below[:4])
        table = _laid(self.head, self.rows[:most])
        lines = [self.title, *words, *table, *self._more(most), *self.below[:4]]
        return "\n".join(shorten_line(line) for line in lines)

    @property
    def html(self) -> str:
        """A fragment of HTML that asks for nothing from elsewhere."""
        parts = [
            f"<p><b>{escape(self.title)}</b></p>",
            *(f"<p>{escape(w)}</p>" for w in self.words),
        ]
        if self.rows:
            head = "".join(f"<th>{escape(name)}</th>" for name in self.head)
            rows = "".join(
                "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>"
                for row in self.rows[:_ROWS]
            )
            parts.append(f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>")
        parts += [f"<p>{escape(line)}</p>" for line in (*self._more(_ROWS), *self.below)]
        return f"<div>{''.join(parts)}</div>"

    def _more(self, shown: int) -> list[str]:
        left = len(self.rows) - shown
        return [f"and {left} more rows"] if left > 0 else []


def shorten_line(line: str) -> str:
    """Return the line with at most 100 letters."""
    return line if len(line) <= COLUMNS else f"{line[: COLUMNS - 4]} ..."


def listed(names: Sequence[str], width: int = COLUMNS - 20) -> str:
    """Return names in one line, cut with their count where there are many."""
    text = ", ".join(names)
    return (
        text if len(text) <= width else f"{shorten(text, width, placeholder=' ...')} ({len(names)})"
    )


def brief(instance: Any) -> str:
    """`__repr__` of a large dataclass: its fields, a line each, arrays by their shape."""
    shown = [(f.name, _short(getattr(instance, f.name))) for f in fields(instance) if f.repr]
    lines = [f"  {name} = {text}" for name, text in shown][: LINES - 3]
    more = [f"  and {len(shown) - len(lines)} more fields"] if len(shown) > len(lines) else []
    return "\n".join(map(shorten_line, [f"{type(instance).__name__}(", *lines, *more, ")"]))


def _short(value: Any) -> str:
    """A value in one line: shape of an array, names in a mapping, number of entries."""
    if hasattr(value, "dtype") and hasattr(value, "shape"):
        return f"array {value.shape} {value.dtype}"
    if isinstance(value, Mapping):
        return f"{len(value)}: {listed([str(key) for key in value], 60)}" if value else "{}"
    if isinstance(value, tuple | list) and value:
        names = [_name(entry) for entry in value[:20]]
        return f"{len(value)}: {listed(names, 60)}" if len(value) > 1 else f"({names[0]},)"
    return _name(value)


def _name(value: Any) -> str:
    """What a value is called: its class and name, or its text."""
    if hasattr(value, "__dataclass_fields__") and not isinstance(value, type):
        name = getattr(value, "name", None)
        return f"{type(value).__name__}({name!r})" if isinstance(name, str) else (
            f"{type(value).__name__}(...)"
        )  # fmt: skip
    if hasattr(value, "shape") and hasattr(value, "dtype"):
        return f"array {value.shape}"
    if callable(value):
        return str(getattr(value, "__qualname__", type(value).__name__))
    return shorten(repr(value), 70, placeholder=" ...") if isinstance(value, str) else repr(value)


def _laid(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """The rows below their head, columns aligned."""
    if not rows:
        return []
    table = [tuple(head), *rows]
    widths = [max(map(len, column)) for column in zip_longest(*table, fillvalue="")]
    return ["  " + "  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip()
            for row in table]  # fmt: skip
