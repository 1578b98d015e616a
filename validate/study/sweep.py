"""Sweeps as text: `path=log:1e-6:1e-1:7`, `path=lin:0:1:5`, `path=a,b,c`; several make a grid."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from validate.errors import UsageError

LARGEST = 1_000_000  # values of one axis: beyond it a slip of the keyboard, not a study


@dataclass(frozen=True)
class Axis:
    """A parameter's path and the texts it takes, as `--set` would be given them."""

    path: str
    values: tuple[str, ...]

    @property
    def numbers(self) -> tuple[float, ...] | None:
        """The values as numbers; None where one is none."""
        try:
            return tuple(float(v) for v in self.values)
        except ValueError:
            return None


def axis(text: str) -> Axis:
    """Raises `UsageError` for a text that is no sweep, holds no value, or one of them twice."""
    path, sign, values = (part.strip() for part in text.partition("="))
    if not (sign and path and values):
        raise UsageError(f"--sweep {text}: expected PATH=log:A:B:N, PATH=lin:A:B:N or PATH=A,B,C")
    kind = values.partition(":")[0]
    spaced = kind in ("log", "lin") and ":" in values
    found = _spaced(text, kind, values) if spaced else _listed(text, values)
    twice = [v for i, v in enumerate(found) if v in found[:i]]
    if twice:
        raise UsageError(f"--sweep {text}: '{twice[0]}' stands twice; each value once")
    return Axis(path, found)


def axes(texts: Sequence[str]) -> tuple[Axis, ...]:
    """All sweeps of a command; raises `UsageError` for a path that is swept twice."""
    found = tuple(axis(text) for text in texts)
    paths = [a.path for a in found]
    twice = [p for i, p in enumerate(paths) if p in paths[:i]]
    if twice:
        raise UsageError(f"'{twice[0]}' is swept twice; give all its values in one --sweep")
    return found


def grid(axes: Sequence[Axis]) -> tuple[Mapping[str, str], ...]:
    """Every combination, the last axis fastest; one empty one without axes."""
    rows = product(*(a.values for a in axes))
    return tuple(dict(zip((a.path for a in axes), row, strict=True)) for row in rows)


def named(values: Mapping[str, str] | Sequence[tuple[str, str]]) -> str:
    """Settings as read: `Q=1e-09, R=1e-09`."""
    pairs = values.items() if isinstance(values, Mapping) else values
    return ", ".join(f"{short(k)}={v}" for k, v in pairs) or "as declared"


def short(path: str) -> str:
    """`Q` of `methods.kf.Q`, `twin.noise` as it is."""
    inner = path.split(".", 2)[2] if path.startswith("methods.") else path
    return inner.removeprefix("settings.")


def _listed(text: str, values: str) -> tuple[str, ...]:
    found = tuple(part.strip() for part in values.split(","))
    if not all(found):
        raise UsageError(f"--sweep {text}: an empty value between commas")
    return found


def _spaced(text: str, kind: str, values: str) -> tuple[str, ...]:
    parts = values.split(":")
    try:
        start, end, count = float(parts[1]), float(parts[2]), int(parts[3])
    except (IndexError, ValueError):
        raise UsageError(f"--sweep {text}: expected {kind}:FIRST:LAST:COUNT") from None
    if len(parts) != 4 or not 2 <= count <= LARGEST or not np.isfinite([start, end]).all():
        raise UsageError(
            f"--sweep {text}: expected {kind}:FIRST:LAST:COUNT with 2 to {LARGEST} values"
        )
    if kind == "lin":
        return tuple(f"{v:.6g}" for v in np.linspace(start, end, count))
    if min(start, end) <= 0:
        raise UsageError(f"--sweep {text}: a logarithmic sweep needs ends above 0")
    return tuple(f"{v:.6g}" for v in np.geomspace(start, end, count))
