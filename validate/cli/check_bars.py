"""Checks on one screen, worst first: error, uncertainty and limit of each as one bar."""

from collections.abc import Mapping, Sequence
from typing import Any

from validate.cli.display import error_shown
from validate.cli.screen import Passage, bar, legend, rows
from validate.report.numbers import scale, shown_unit, significant

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
    """Requirements; and, where nothing is required, errors against their uncertainty."""
    several = len({c["method"] for c in checks}) > 1
    blocks = []
    for limited, against in ((True, "limit"), (False, "2 u_val")):
        some = [c for c in worst_first(checks) if (c["limit"] is not None) == limited]
        if not some:
            continue
        cells = [_row(c, several=several) for c in some]
        common = ""
        if len(cells) > 1 and len({c["verdict"] for c in some}) == 1:
            common = f", all {some[0]['verdict']}"
            cells = [row[:-1] for row in cells]
        title = f"Checks{common}, worst first ({legend(against)})"
        lines = rows([""] * len(cells[0]), cells)
        blocks.append(Passage(title, lines, 3, 8, "more, none worse: --verbose"))
    return blocks


def _row(check: Json, *, several: bool) -> list[str]:
    name = f"{check['method']}: {check['name']}" if several else check["name"]
    if not check["count"]:
        return [name, "", "compared nothing", check["verdict"]]
    limit, u_val = check["limit"], check["u_val"]
    doubt = float("inf") if u_val is None else 2 * u_val
    if limit is not None:
        drawn = bar(check["value"], doubt, limit)
    else:
        drawn = bar(check["value"], 0.0, doubt) if 0 < doubt < float("inf") else ""
    return [name, drawn, _numbers(check), check["verdict"]]


def _numbers(check: Json) -> str:
    """0.102 ± 0.271 of 0.410 mm: the error, its 2 u_val and the limit in one unit."""
    u_val, limit = check["u_val"], check["limit"]
    doubt = None if u_val is None else 2 * u_val
    factor, unit = scale(check["unit"]), shown_unit(check["unit"])
    if unit == "Pa" and max(abs(v or 0.0) for v in (check["value"], doubt, limit)) >= 1000:
        factor, unit = 1e-3, "kPa"
    error = "0" if error_shown(check) == "below noise" else significant(check["value"] * factor)
    bound = "no bound" if doubt is None else significant(doubt * factor)
    of = "" if limit is None else f" of {significant(limit * factor)}"
    return f"{error} ± {bound}{of} {unit}".strip()
