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
            title += f" ({_legend(ordered)})"
        keep = 3 if i == 0 else 1
        more = "more, none of them worse: --verbose"
        passages.append(Passage(title, tuple(members), keep, 8, more))
    return passages


def _legend(checks: Sequence[Json]) -> str:
    limits = {c["limit"] is not None for c in checks}
    if len(limits) > 1:
        return legend("limit, or 2 u_val without one")
    return legend("limit" if True in limits else "2 u_val")


def _row(check: Json, *, several: bool) -> list[str]:
    name = f"{check['method']}: {check['name']}" if several else check["name"]
    if not check["count"]:
        return [name, "", "compared nothing"]
    limit, u_val = check["limit"], check["u_val"]
    doubt = float("inf") if u_val is None else 2 * u_val
    if limit is not None:
        drawn = bar(check["value"], doubt, limit)
    else:
        drawn = bar(check["value"], 0.0, doubt) if 0 < doubt < float("inf") else ""
    return [name, drawn, _numbers(check)]


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
