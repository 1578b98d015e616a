"""Error, uncertainty and limit as one bar of characters."""

import math
import sys

_BAR = 14  # characters of a bar
_LIMIT = 10  # of them up to the limit


def bar(error: float, doubt: float, limit: float) -> str:
    """Return an error, `doubt` above it, and a limit, all in one unit, as characters.

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
