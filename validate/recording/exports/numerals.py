"""Numbers as spreadsheets write them: decimal sign and thousands separators, decided per file.

One file has one decimal sign. A cell such as `1,234` alone proves nothing; where no other cell
decides, it is refused instead of guessed.
"""

import math
import re
from collections.abc import Iterable

from validate.errors import RecordingError

_LOOSE = re.compile(
    r"[-+]?(?=[.,]?[0-9])[0-9]*(?:[.,' \u00a0\u202f][0-9]+)*[.,]?(?:[eE][-+]?[0-9]{1,3})?"
)
_EITHER = re.compile(r"[1-9][0-9]{0,2}[.,][0-9]{3}")
_GROUPS = re.compile(r"[0-9]{1,3}(?P<mark>[.,])[0-9]{3}(?:(?P=mark)[0-9]{3})*")


def _form(decimal: str, other: str) -> re.Pattern[str]:
    grouped = rf"[0-9]{{1,3}}(?P<mark>[{other}' \u00a0\u202f])[0-9]{{3}}(?:(?P=mark)[0-9]{{3}})*"
    return re.compile(
        rf"(?P<whole>[-+]?(?:[0-9]+|{grouped})?)(?:{re.escape(decimal)}(?P<part>[0-9]*))?"
        r"(?P<power>[eE][-+]?[0-9]{1,3})?"
    )


_FORMS = {".": _form(".", ","), ",": _form(",", ".")}


def looks_numeric(cell: str) -> bool:
    """Whether the cell is a number in some notation."""
    return _LOOSE.fullmatch(_plain_minus(cell)) is not None


def decimal_sign(cells: Iterable[tuple[int, str]]) -> str:
    """`.` or `,`: the decimal sign of (line number, cell) pairs; cells without numbers are ignored.

    Raises `RecordingError` naming lines when cells contradict each other or when a comma may be
    either a decimal or a thousands sign.
    """
    shown: dict[str, tuple[int, str]] = {}
    for line, cell in cells:
        if "." in cell or "," in cell:
            for vote in _votes(_plain_minus(cell)):
                shown.setdefault(vote, (line, cell))
    if "." in shown and "," in shown:
        (a, dot), (b, comma) = shown["."], shown[","]
        raise RecordingError(
            f"two decimal signs: '{dot}' in line {a}, '{comma}' in line {b}; export it with one"
        )
    decimal = "," if "," in shown else "."
    doubtful = shown.get("?." if decimal == "," else "?,")
    if doubtful and "grouped" not in shown:
        line, cell = doubtful
        raise RecordingError(
            f"line {line}: '{cell}' may hold a thousands or a decimal sign; "
            "export without thousands separators"
        )
    return decimal


def number(cell: str, decimal: str) -> float | None:
    """The finite number in the cell, or None: empty, text, NaN, infinite or wrongly grouped."""
    found = _FORMS[decimal].fullmatch(_plain_minus(cell))
    if found is None or not looks_numeric(cell):
        return None
    whole = re.sub(r"[^-+0-9]", "", found["whole"])
    value = float(f"{whole}.{found['part'] or '0'}{found['power'] or ''}")
    return value if math.isfinite(value) else None


def decimals(cell: str) -> int:
    """How many digits follow the last decimal or thousands sign; 0 for whole numbers."""
    found = re.search(r"[.,]([0-9]*)[^.,]*$", cell)
    return len(found[1]) if found else 0


def _votes(cell: str) -> tuple[str, ...]:
    """What a cell shows: the decimal sign, `?.` or `?,` when it may be either, and grouping."""
    if _LOOSE.fullmatch(cell) is None:
        return ()
    body, *power = re.split("[eE]", cell.lstrip("-+"))
    dots, commas = body.count("."), body.count(",")
    if dots and commas:
        decimal = "." if body.rfind(".") > body.rfind(",") else ","
        whole, _, _ = body.rpartition(decimal)
        return (decimal, "grouped") if _GROUPS.fullmatch(whole) else ()
    mark, other = (",", ".") if commas else (".", ",")
    if body.count(mark) > 1:
        return (other, "grouped") if _GROUPS.fullmatch(body) else ()
    if _EITHER.fullmatch(body) and not power:
        return ("?" + mark,)
    return (mark,)


def _plain_minus(cell: str) -> str:
    return cell.strip().replace("\u2212", "-")
