"""Parser of sweeps and their grid: `path=log:1e-6:1e-1:7`, `path=lin:1kPa:5kPa:5`, `path=a,b,c`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from validate.errors import UsageError
from validate.units import in_si, split

LARGEST = 1_000_000  # values of one axis: beyond it a slip of the keyboard, not a study


@dataclass(frozen=True)
class Axis:
    """A parameter's path and the texts it takes, as `--set` would be given them."""

    path: str
    values: tuple[str, ...]

    @property
    def unit(self) -> str:
        """What the first value has behind its number; "" for a bare one, which is SI."""
        return (split(self.values[0]) or (0.0, ""))[1]

    @property
    def numbers(self) -> tuple[float, ...] | None:
        """The values as numbers in `unit`; None where one is none, or only some have a unit."""
        found = [_number(v, self.unit) for v in self.values]
        return None if None in found else tuple(v for v in found if v is not None)

    @property
    def label(self) -> str:
        """As an axis has it: with the unit that the values were given in."""
        return f"{short(self.path)} / {self.unit}" if self.unit else short(self.path)


def axis(text: str) -> Axis:
    """Raises `UsageError` for a text that is no sweep, holds no value, or one of them twice."""
    path, sign, values = (part.strip() for part in text.partition("="))
    if not (sign and path and values):
        raise UsageError(f"--sweep {text}: expected PATH=log:A:B:N, PATH=lin:A:B:N or PATH=A,B,C")
    kind = values.partition(":")[0]
    if kind in ("log", "lin") and ":" in values:
        parts = values.split(":")
        unit = (split(parts[1]) or (0.0, ""))[1] if len(parts) == 4 else ""
        try:
            count = int(parts[3])
            start, end = (_number(part, unit) for part in parts[1:3])
        except (IndexError, ValueError):
            raise UsageError(f"--sweep {text}: expected {kind}:FIRST:LAST:COUNT") from None
        if start is None or end is None:
            raise UsageError(
                f"--sweep {text}: expected FIRST and LAST as numbers, without a unit "
                "(SI) or with the same unit"
            )
        if len(parts) != 4 or not 2 <= count <= LARGEST or not np.isfinite([start, end]).all():
            raise UsageError(
                f"--sweep {text}: expected {kind}:FIRST:LAST:COUNT with 2 to {LARGEST} values"
            )
        if kind == "log" and min(start, end) <= 0:
            raise UsageError(f"--sweep {text}: a logarithmic sweep needs ends above 0")
        spaced = np.geomspace if kind == "log" else np.linspace
        found = tuple(f"{v:.6g}{unit}" for v in spaced(start, end, count))
    else:
        found = tuple(part.strip() for part in values.split(","))
        if not all(found):
            raise UsageError(
                f"--sweep {text}: there is an empty value between commas; give one value between "
                "two commas"
            )
    twice = [v for i, v in enumerate(found) if v in found[:i]]
    if twice:
        raise UsageError(f"--sweep {text}: '{twice[0]}' is given twice; give each value once")
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


def _number(text: str, unit: str) -> float | None:
    """`10kPa` in `unit`; None for no number, another dimension, or a bare one among those with
    units."""
    found = split(text)
    if found is None or bool(found[1]) != bool(unit):
        return None
    return in_si(found[0], found[1], unit) if unit else found[0]
