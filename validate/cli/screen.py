"""One screen of text: passages of lines that share a number of lines, and bars in characters.

show([Passage("Checks", rows, keep=2, most=8)])  # on at most 25 lines
"""

import math
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from validate.cli.arguments import Detail
from validate.cli.display import console, say
from validate.cli.layout import wrapped

LINES = 25
_BAR = 14  # characters of a bar
_LIMIT = 10  # of them up to the limit
_NAME = 12  # characters of a name that is cut


@dataclass(frozen=True)
class Passage:
    """Lines below a title ("" for none), of which the first `most` are shown.

    `keep` lines stay however little room there is (None: all). `rest` follows the number of lines
    that are left out, `hidden` ones among them that are no lines here. With `wrap` the lines are
    sentences, each shown on at most `each` lines of a screen (None: on as many as it takes).
    """

    title: str
    lines: tuple[str, ...]
    keep: int | None = None
    most: int | None = None
    rest: str = "more: --verbose"
    hidden: int = 0
    wrap: bool = False
    each: int | None = None

    def laid(self, *, whole: bool) -> "Passage":
        """The passage in lines of the screen's width; sentences are cut unless `whole`."""
        if not self.wrap:
            return self
        each = None if whole else self.each
        lines = tuple(k for text in self.lines for k in _wrapped(text, each))
        return replace(self, lines=lines, wrap=False)

    def height(self, shown: int) -> int:
        """Lines on the screen where so many of its own are shown."""
        return bool(self.title) + shown + (shown < len(self.lines) + self.hidden)


def fitted(passages: Sequence[Passage], most: float = LINES) -> list[Passage]:
    """The passages that have lines, the longest shortened until all have room."""
    found = [b for b in passages if b.lines]
    counts = [min(len(b.lines), b.most or len(b.lines)) for b in found]
    least = [n if b.keep is None else min(n, b.keep) for b, n in zip(found, counts, strict=True)]
    while sum(b.height(n) for b, n in zip(found, counts, strict=True)) > most:
        i = max(range(len(found)), key=lambda i: counts[i] - least[i])
        if counts[i] == least[i]:
            break
        counts[i] -= 1
    return [
        replace(b, lines=(*b.lines[:n], f"  {len(b.lines) - n + b.hidden} {b.rest}"))
        if n < len(b.lines) + b.hidden else b
        for b, n in zip(found, counts, strict=True)
    ]  # fmt: skip


def show(passages: Sequence[Passage], detail: Detail = "screen") -> None:
    """Print passages with their titles in bold: on one screen, whole, or the first one alone."""
    screen = console()
    found = [p.laid(whole=detail == "full") for p in passages if p.lines]
    if detail == "screen":
        found = fitted(found)
    if detail == "short":
        screen.print(
            " ".join(line.strip() for line in found[0].lines), markup=False, soft_wrap=True
        )
        return
    for passage in found:
        if passage.title:
            say(cut(passage.title, width()), "bold")
        for line in passage.lines:
            screen.print(line, markup=False, soft_wrap=True)


def width() -> int:
    """Columns of the screen."""
    return console().width


def sentences(
    texts: Iterable[str], each: int | None = 2, keep: int | None = None, most: int | None = None
) -> Passage:
    """A passage of sentences, each of at most `each` lines on a screen and whole with --verbose."""
    return Passage("", tuple(texts), keep, most, wrap=True, each=each)


def _wrapped(text: str, most: int | None) -> tuple[str, ...]:
    """A sentence in lines of the screen's width; an ellipsis stands for what follows `most`."""
    lines = wrapped(text, width(), "  ")
    if most is None or len(lines) <= most:
        return tuple(lines)
    return (*lines[: most - 1], f"{lines[most - 1][: width() - 2].rstrip(' ,;:')} …")


def rows(head: Sequence[str], cells: Sequence[Sequence[str]], soft: int = 0) -> tuple[str, ...]:
    """A table with one line a row, indented; the texts of column `soft` are cut where they have no
    room. None without cells."""
    every = [*([head] if any(head) else []), *cells] if cells else []
    widths = [max(map(len, column)) for column in zip(*every, strict=True)]
    room = width() - sum(w + 2 for i, w in enumerate(widths) if i != soft) - 2
    if widths:
        widths[soft] = min(widths[soft], max(room, _NAME))
    texts = ([cut(t, w) for t, w in zip(row, widths, strict=True)] for row in every)
    return tuple(
        "  " + "  ".join(f"{t:<{w}}" for t, w in zip(row, widths, strict=True)).rstrip()
        for row in texts
    )


def cut(text: str, room: int) -> str:
    """A text of at most `room` characters."""
    return text if len(text) <= room else f"{text[: room - 1]}…"


def bar(error: float, doubt: float, limit: float) -> str:
    """An error, `doubt` above it, and a limit, all in one unit, as characters.

    The limit always stands at the same place; what goes beyond the bar ends in ">". An error or a
    doubt that is not finite fills the bar.
    """
    full, soft, mark = _characters()
    size = abs(error) if math.isfinite(error) else math.inf
    reach = size + (doubt if math.isfinite(doubt) else math.inf)
    places = [(i + 0.5) * limit / _LIMIT for i in range(_BAR)]
    text = "".join(full if x < size else soft if x < reach else " " for x in places)
    text = f"{text[:_LIMIT]}{mark}{text[_LIMIT:]}"
    return f"{text[:-1]}>" if reach > _BAR / _LIMIT * limit else text


def legend(limit: str) -> str:
    """What the characters of a bar are."""
    full, soft, mark = _characters()
    return f"{full} error, {soft} 2 u_val, {mark} {limit}"


def _characters() -> tuple[str, str, str]:
    unicode = (getattr(sys.stdout, "encoding", None) or "utf-8").lower().startswith("utf")
    return ("█", "░", "│") if unicode else ("#", "-", "|")
