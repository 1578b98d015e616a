"""Variations: a path of the parameters and a rule for the change of its value.

    {"twin.stiffness": 0.8, "membranes.wall.thickness": "0.1 mm"}   values, of a case or an effect
    {"material.E": "x 1.1", "mesh.cells": "+ 1"}              a factor, a step
    {"material.nu": "as nu.svk"}                              what another parameter has
    vary("material.E", "relative 3 %")                        one standard uncertainty of an input
    vary("material.nu", "absolute 0.005, below 0.5")          the same, with a bound
    vary("material.E", "relative ranges.E")                   ... as large as another parameter says

A standard uncertainty has one meaning: the value moves up by z of them. "below": where one of them
upwards would reach the bound, it moves down instead. "at most", "at least": it stops there. It
never lies beyond a bound.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from validate.errors import UsageError
from validate.parameters import known, value_at, with_given
from validate.units import in_si, si_of, split

#: Relative distance to a bound that is not reached: of nu below .5 the largest value is .4999.
_SHORT_OF = 2e-4
_RULES = '"relative 3 %", "absolute 0.005, below 0.5", "absolute 1 mm, at least 0"'


@dataclass(frozen=True)
class Values:
    """Values by path, or factors and steps; called with parameters, it returns them so changed."""

    by_path: tuple[tuple[str, Any], ...] = ()

    def __call__(self, parameters: Any) -> Any:
        return with_given(parameters, {path: self._value(parameters, path, given)
                                       for path, given in self.by_path})  # fmt: skip

    @staticmethod
    def _value(parameters: Any, path: str, given: Any) -> Any:
        if str(given).startswith("as "):
            other = str(given).removeprefix("as ")
            return known(value_at(parameters, other)[0], other)
        if not (isinstance(given, str) and given[:2] in ("x ", "+ ", "- ")):
            return given
        value, unit = value_at(parameters, path)
        sign, amount = given[0], _number(given[2:], path, "1" if given[0] == "x" else unit)
        new = value * amount if sign == "x" else value + (amount if sign == "+" else -amount)
        if not isinstance(value, int):
            return new
        # Of a count one stays; a step down to none goes up instead, past the next one up.
        least = value + 2 * round(amount) if sign == "-" else 1
        return round(new) if round(new) >= 1 else least


class ByPath(Mapping[str, Any]):
    """Values by path that can be a key: what a method changes of the scene."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        self._values = dict(values)
        for path, value in self._values.items():
            if isinstance(value, dict | list | set):
                raise UsageError(
                    f"{path}: a {type(value).__name__}; expected a number, a text or a tuple"
                )

    def __getitem__(self, path: str) -> Any:
        return self._values[path]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __hash__(self) -> int:
        return hash(tuple(sorted(self._values.items(), key=lambda item: item[0])))

    def __repr__(self) -> str:
        return repr(self._values)


Change = Callable[[Any], Any]


def unchanged(parameters: Any) -> Any:
    return parameters


def change_of(given: Mapping[str, Any] | Change) -> Change:
    """What a declaration gives: values by path; or, where a value is computed, a function."""
    if not isinstance(given, Mapping):
        return given
    return Values(tuple(given.items())) if given else unchanged


@dataclass(frozen=True)
class Shift:
    """Change of an uncertain input: `paths` by z standard uncertainties, as `rule` says."""

    paths: tuple[str, ...]
    rule: str

    def __post_init__(self) -> None:
        _parts(self.rule, self.paths[0])

    def __call__(self, parameters: Any, z: float) -> Any:
        new = {path: self._moved(parameters, path, z) for path in self.paths}
        return with_given(parameters, {k: v for k, v in new.items() if v is not None})

    def sd(self, value: float, parameters: Any, path: str) -> float:
        """One standard uncertainty of this value of a path, in its SI unit."""
        kind, amount, _ = _parts(self.rule, path)
        unit = value_at(parameters, path)[1]
        if split(amount) is None:  # the value of the parameter that is named
            size = float(value_at(parameters, amount)[0] or 0.0)
        else:
            size = _number(amount, path, "1" if kind == "relative" else unit)
        return size * abs(value) if kind == "relative" else size

    def _moved(self, parameters: Any, path: str, z: float) -> Any:
        value, _ = value_at(parameters, path)
        if value is None:  # identified later, with an uncertainty of its own
            return None
        if isinstance(value, tuple):
            return tuple(self._number(parameters, path, v, z) for v in value)
        return self._number(parameters, path, value, z)

    def _number(self, parameters: Any, path: str, value: float, z: float) -> float:
        bounds = _parts(self.rule, path)[2]
        low, high, turns = _bounds(bounds, path, value_at(parameters, path)[1])
        by = self.sd(value, parameters, path)
        if value + by >= turns:
            by = -by
        return max(min(low, value), min(value + z * by, max(high, value)))


def _parts(rule: str, path: str) -> tuple[str, str, tuple[str, ...]]:
    """Kind, amount and bounds of a rule; raises `UsageError` for anything else."""
    head, *bounds = (part.strip() for part in rule.split(","))
    kind, _, amount = head.partition(" ")
    if kind not in ("relative", "absolute") or not amount:
        raise UsageError(f"{path}: rule '{rule}': expected for example {_RULES}")
    return kind, amount, tuple(bounds)


def _number(text: str, path: str, unit: str) -> float:
    given = split(text)
    value = in_si(given[0], given[1] or unit, unit) if given else None
    if value is None or not math.isfinite(value):
        raise UsageError(f"{path}: '{text}': expected a number in {unit}")
    return value


def _bounds(bounds: tuple[str, ...], path: str, unit: str) -> tuple[float, float, float]:
    """The least and the largest value, and the one from which on a value moves down instead."""
    low, high, turns = -math.inf, math.inf, math.inf
    for bound in bounds:
        words, _, number = bound.rpartition(" ")
        if words == "below":
            high = turns = _number(number, path, unit) * (1 - _SHORT_OF)
        elif words == "at most":
            high = _number(number, path, unit)
        elif words == "at least":
            low = _number(number, path, unit)
        else:
            raise UsageError(f"{path}: bound '{bound}': expected below, at most or at least")
    return low, high, turns


def shares(rule: str, path: str) -> tuple[tuple[float, ...], float]:
    """Factors and formal order of "x 0.5 0.75, order 2"; raises `UsageError` for anything else."""
    head, _, order = (part.strip() for part in rule.partition(","))
    try:
        factors = tuple(float(word) for word in head.removeprefix("x").split())
        formal = float(order.removeprefix("order")) if order else 2.0
    except ValueError:
        factors, formal = (), 0.0
    if len(factors) < 1 or not formal > 0 or not all(x > 0 and x != 1 for x in factors):
        raise UsageError(f"{path}: rule '{rule}': expected for example x 0.5 0.75 1.3, order 2")
    return factors, formal


def swept(rule: str, path: str) -> str:
    """As `--sweep` takes it: "log 1e-9 1e-5" (a value a decade), "log 1e-9 1e-5, 9 values", "linear
    0 1, 5 values" or "of 1e-9, 1e-7". Raises `UsageError` for anything else."""
    kind, _, rest = rule.partition(" ")
    if kind == "of" and rest.strip():
        return f"{path}={','.join(part.strip() for part in rest.split(','))}"
    ends, _, count = (part.strip() for part in rest.partition(","))
    try:
        low, high = (float(word) for word in ends.split())
        decades = round(math.log10(high / low)) + 1 if kind == "log" and 0 < low < high else 0
        number = int(count.removesuffix("values")) if count else decades
    except ValueError:
        number = 0
    if kind not in ("log", "linear") or number < 2:
        raise UsageError(
            f"{path}: rule '{rule}': expected for example log 1e-9 1e-5, 9 values; or of 1e-9, 1e-7"
        )
    return f"{path}={'log' if kind == 'log' else 'lin'}:{low!r}:{high!r}:{number}"


def bound(given: str | float, path: str) -> float:
    """Return a bound in SI, from a number or a text with its unit."""
    if not isinstance(given, str):
        return given
    parts = split(given)
    if parts is None:
        raise UsageError(f"{path}: bound '{given}': expected a number with its unit, as 10 kPa")
    return parts[0] * (si_of(parts[1])[0] if parts[1] else 1.0)
