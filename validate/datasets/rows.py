"""Rows of numbers that others keep inside a program, written as the CSV file that is registered.

Numbers are rounded to nine significant digits and not changed. Nothing of the text is run.
"""

import re
from collections.abc import Sequence

_NUMBER = r"-?\d+(?:\.\d+)?"
_PAIR = re.compile(rf"^\s*({_NUMBER})\s+({_NUMBER})\s*$", re.MULTILINE)
_SERIES = re.compile(
    rf"λ₁ == ({_NUMBER})\s+λ₂ = \[(.*?)\].*?s₁ = \[(.*?)\]\s+s₂ = \[(.*?)\]", re.DOTALL
)


def csv_of(text: str, function: str, header: str) -> str:
    """The rows that a function of a Julia file holds, below `header`; the header alone for none.

    A matrix of two columns, or Kawabata's series: one stretch 1, then lists of stretch 2 and of
    both stresses.
    """
    begin = text.find(f"function {function}(")
    end = text.find("\nend", begin)
    body = text[begin:end] if 0 <= begin < end else ""
    rows = _series(body) or [tuple(map(float, pair)) for pair in _PAIR.findall(body)]
    lines = [header, *(",".join(f"{value:.9g}" for value in row) for row in rows)]
    return "\n".join(lines) + "\n"


def _series(body: str) -> list[tuple[float, ...]]:
    return [
        (float(first), *row)
        for first, *lists in _SERIES.findall(body)
        for row in zip(*map(_listed, lists), strict=False)
    ]


def _listed(text: str) -> Sequence[float]:
    return [float(number) for number in re.findall(_NUMBER, text)]
