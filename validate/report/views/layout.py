"""Tables and sentences in a given width, with unbroken words."""

import os
from collections.abc import Iterator, Sequence
from textwrap import wrap
from typing import TextIO

_WIDTH = 80  # columns where neither COLUMNS nor a terminal says how many there are
_GAP = "  "
_LEAST = 28  # characters of a column of sentences: a narrower one is a ribbon
_BELOW = "    "  # before what has no room beside the rest of its row


def width(stream: TextIO) -> int:
    """COLUMNS, else those of the terminal that the stream is, else 80."""
    given = os.environ.get("COLUMNS", "")
    if given.isdigit() and int(given) > 0:
        return int(given)
    try:
        return os.get_terminal_size(stream.fileno()).columns or _WIDTH
    except (OSError, ValueError):  # a pipe, a file, no stream of the system
        return _WIDTH


def wrapped(text: str, width: int, indent: str = "") -> list[str]:
    """Lines of at most `width`, longer only where a single word is; `indent` from the second on."""
    return [
        line
        for part in text.split("\n")
        for line in wrap(
            part, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
        ) or [""]
    ]  # fmt: skip


def laid(head: Sequence[str], rows: Sequence[Sequence[str]], width: int) -> list[str]:
    """Return a table as lines, as flat as the width allows.

    Columns of sentences share what the others leave. Where that is too little, the last of them
    goes below its row; where even names and numbers have no room, each row becomes a paragraph.
    """
    columns = range(len(head))
    found = _aligned(head, rows, width, columns)
    if found is None:
        # The last column that may go below its row; the first one names it and stays
        soft = [c for c in columns[1:] if _sentences([row[c] for row in rows])]
        if soft:
            last = soft[-1]
            found = _aligned(head, rows, width, [c for c in columns if c != last], last)
    if found:
        return found
    # The first cell, then the others with their names
    paragraphs = []
    for first, *others in rows:
        named = [f"{h}: {cell}" if h else cell for h, cell in zip(head[1:], others, strict=True)]
        rest = "; ".join(text for text, cell in zip(named, others, strict=True) if cell)
        paragraphs += wrapped(first, width, _BELOW)
        paragraphs += wrapped(_BELOW + rest, width, _BELOW) if rest else []
    return paragraphs


def _aligned(
    head: Sequence[str],
    rows: Sequence[Sequence[str]],
    width: int,
    columns: Sequence[int],
    below: int | None = None,
) -> list[str] | None:
    """The columns side by side, that of `below` under each row; None where they have no room."""
    natural, least = [], []
    for column in columns:
        cells = [row[column] for row in rows]
        words = max(max(map(len, text.split()), default=0) for text in (head[column], *cells))
        longest = max(map(len, cells))
        natural.append(max(len(head[column]), longest))
        least.append(max(words, _LEAST if _sentences(cells) else longest))
    # Sentences are cut down to one common width, the largest that fits
    room = width - len(_GAP) * (len(natural) - 1)
    caps = ([max(low, min(n, cap)) for low, n in zip(least, natural, strict=True)]
            for cap in range(max(natural), 0, -1))  # fmt: skip
    widths = next((found for found in caps if sum(found) <= room), None)
    if widths is None:
        return None
    found = list(_side_by_side([head[c] for c in columns], widths))
    for row in rows:
        found += _side_by_side([row[c] for c in columns], widths)
        if below is not None and row[below]:
            found += wrapped(_BELOW + row[below], width, _BELOW)
    return found


def _sentences(column: Sequence[str]) -> bool:
    return max(map(len, column)) > _LEAST and any(" " in cell for cell in column)


def _side_by_side(cells: Sequence[str], widths: Sequence[int]) -> Iterator[str]:
    parts = [wrapped(cell, w) for cell, w in zip(cells, widths, strict=True)]
    for i in range(max(map(len, parts))):
        line = [part[i] if i < len(part) else "" for part in parts]
        yield _GAP.join(f"{t:<{w}}" for t, w in zip(line, widths, strict=True)).rstrip()
