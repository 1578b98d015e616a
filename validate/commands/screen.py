"""One screen of text: passages that share a limited number of lines.

show([Passage("Checks", rows, keep=2, most=8)])  # on at most 25 lines
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from validate.commands.arguments import Detail
from validate.commands.display import console, error_shown, say
from validate.numbers import scale, shown_unit, significant, to_decimal_of
from validate.report.views.bars import bar, legend
from validate.report.views.layout import wrapped

LINES = 25
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
        """Return the passage in lines of the screen's width; sentences are cut unless `whole`."""
        if not self.wrap:
            return self
        each = None if whole else self.each
        lines = tuple(k for text in self.lines for k in _wrapped(text, each))
        return replace(self, lines=lines, wrap=False)

    def height(self, shown: int) -> int:
        """Lines on the screen where so many of its own are shown."""
        return bool(self.title) + shown + (shown < len(self.lines) + self.hidden)


def fitted(passages: Sequence[Passage], most: float = LINES) -> list[Passage]:
    """Return the passages that have lines, the longest shortened until all have room."""
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
    """Return a passage of sentences, each of at most `each` lines on a screen and whole with
    --verbose."""
    return Passage("", tuple(texts), keep, most, wrap=True, each=each)


def _wrapped(text: str, most: int | None) -> tuple[str, ...]:
    """A sentence in lines of the screen's width; an ellipsis stands for what follows `most`."""
    lines = wrapped(text, width(), "  ")
    if most is None or len(lines) <= most:
        return tuple(lines)
    return (*lines[: most - 1], f"{lines[most - 1][: width() - 2].rstrip(' ,;:')} …")


def rows(head: Sequence[str], cells: Sequence[Sequence[str]], soft: int = 0) -> tuple[str, ...]:
    """Return a table with one line a row, indented; the texts of column `soft` are cut where they
    have no room. None without cells."""
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
    """Return a text of at most `room` characters."""
    return text if len(text) <= room else f"{text[: room - 1]}…"


# --- Checks on one screen, worst first: error, uncertainty and limit of each as one bar.

Json = Mapping[str, Any]  # a check as in results.json, and the "method" that it is of
_ORDER = (
    "nothing compared", "not good enough", "undecided", "differs", "no answer", "good enough",
    "not distinguishable", "fitted", "same model",
)  # fmt: skip


def worst_first(checks: Sequence[Json]) -> list[Json]:
    """Failed checks, then undecided ones, then the others, each by how little room is left."""
    return sorted(checks, key=lambda c: (_ORDER.index(c["verdict"]), -_fraction(c)))


def _fraction(check: Json) -> float:
    """|E| + 2 u_val over the limit; without a limit |E| over 2 u_val."""
    if not check["count"] or check["u_val"] is None:
        return float("inf")
    error, doubt = abs(check["value"]), 2 * check["u_val"]
    if check["limit"]:
        return float((error + doubt) / check["limit"])
    return float(error / doubt) if doubt else 0.0


def check_passages(checks: Sequence[Json]) -> list[Passage]:
    """One passage a verdict, the failed ones first; the bars of all stand below each other."""
    ordered = worst_first(checks)
    several = len({c["method"] for c in checks}) > 1
    lines = rows([""] * 3, [_row(c, several=several) for c in ordered])
    groups: dict[str, list[str]] = {}
    for check, line in zip(ordered, lines, strict=True):
        groups.setdefault(check["verdict"], []).append(line)
    passages = []
    for i, (verdict, members) in enumerate(groups.items()):
        title = f"Checks: {verdict}{', worst first' if len(members) > 1 else ''}"
        if i == 0:
            limits = {c["limit"] is not None for c in ordered}
            one = "limit" if True in limits else "2 u_val"
            title += f" ({legend('limit, or 2 u_val without one' if len(limits) > 1 else one)})"
        keep = 3 if i == 0 else 1
        more = "more, none of them worse: --verbose"
        passages.append(Passage(title, tuple(members), keep, 8, more))
    return passages


def _row(check: Json, *, several: bool) -> list[str]:
    name = f"{check['method']}: {check['name']}" if several else check["name"]
    if not check["count"]:
        return [name, "", check["why"]]
    limit, u_val = check["limit"], check["u_val"]
    doubt = float("inf") if u_val is None else 2 * u_val
    if limit is not None:
        drawn = bar(check["value"], doubt, limit)
    else:
        drawn = bar(check["value"], 0.0, doubt) if 0 < doubt < float("inf") else ""
    # 0.10 ± 0.27 of 0.410 mm: the error, its 2 u_val and the limit in one unit
    half = None if u_val is None else 2 * u_val
    factor, unit = scale(check["unit"]), shown_unit(check["unit"])
    if unit == "Pa" and max(abs(v or 0.0) for v in (check["value"], half, limit)) >= 1000:
        factor, unit = 1e-3, "kPa"
    error, bound = significant(check["value"] * factor), "no bound"
    if half is not None:  # both to the same decimal
        bound, error = to_decimal_of(half * factor, check["value"] * factor)
    if error_shown(check) == "below noise":
        error = "0"
    of = "" if limit is None else f" of {significant(limit * factor)}"
    return [name, drawn, f"{error} ± {bound}{of} {unit}".strip()]
