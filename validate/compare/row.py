"""Rows of the long table: one labelled number, or many with common labels as arrays."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from validate.arrays import Floats, checked
from validate.compare.bias import kind_of
from validate.errors import ComparisonError, UsageError
from validate.parameters import nearest_names
from validate.units import is_unit, si_of, split

# --- Conditions on the columns of a table: texts with wildcards, numbers, or several of them.

Label = str | float | int | None
Wanted = Label | tuple[Label, ...]


def require_columns(labels: Mapping[str, Wanted], columns: Iterable[str]) -> None:
    """Raise `UsageError` that names the nearest column for an unknown one."""
    known = set(columns)
    for name in labels:
        if name not in known:
            raise UsageError(f"where: no column '{name}'; {nearest_names(name, known)}")


def selects(wanted: Wanted) -> Callable[[Label], bool]:
    """Return whether a value fits a label, or one of several; `*` and `?` stand for any text, and
    a text behind `!` must not fit."""
    options = wanted if isinstance(wanted, tuple) else (wanted,)
    refused = [o[1:] for o in options if isinstance(o, str) and o.startswith("!")]
    taken = [o for o in options if not (isinstance(o, str) and o.startswith("!"))]
    everything = bool(refused) and not taken
    return lambda value: (
        (everything or any(_fits(value, option) for option in taken))
        and not any(_fits(value, option) for option in refused)
    )  # fmt: skip


def _fits(value: Label, option: Label) -> bool:
    if isinstance(value, str) and isinstance(option, str):
        return fnmatchcase(value, option.replace("[", "[[]"))  # names may hold brackets
    return value == option


# -------------------------------------------------------------------------------------------------

POINT = "point"  # the part of rows that are residuals, point by point
SAMPLE = "sample"  # that of rows over time or load: what was measured, and each method there
TRACE = "trace"  # that of rows which are what a method computed over time
TABLE, CHART = "table", "chart"  # those of numbers that an experiment or a study shows
MEASURED = "measured"  # the `method` of rows that the recording holds
_STATISTICS = frozenset(
    ("rms", "mean", "max", "bias", "simulated", "measured", "mae", "rmse", "nrmse", "sd", "p50",
     "p99", "per_dof", "last", "separation")
)  # fmt: skip
VALUE = "value"  # the statistic of a quantity that has none


class LongRow(NamedTuple):
    """A number with its labels, SI. None: no such number; "": no such label.

    `variation` is what was changed from the declared run, or the effect that was switched. `kind`
    is what was measured: force, displacement, ... `at` is the time (s) or the load (SI) of the
    `condition`. `axis` is a component, from 1. `sd` is the standard uncertainty of the value: u_val
    of a check, the noise of a point. `n` counts the values behind it. `role` is that of the
    observation. `note` defines the value.
    """

    run: str = ""
    experiment: str = ""
    recording: str = ""
    method: str = ""
    variation: str = ""
    part: str = ""
    kind: str = ""
    quantity: str = ""
    statistic: str = VALUE
    condition: str = ""
    at: float | None = None
    point: int | None = None
    axis: str = ""
    value: float | None = None
    unit: str = ""
    sd: float | None = None
    n: int | None = None
    role: str = ""
    against: str = ""
    validation: str = ""
    acceptance: str = ""
    note: str = ""

    @property
    def name(self) -> str:
        """The name in results.json, `<quantity>.<statistic>@<condition>`."""
        statistic = "" if self.statistic == VALUE else f".{self.statistic}"
        return f"{self.quantity}{statistic}" + (f"@{self.condition}" if self.condition else "")


def named(one: LongRow, name: str, unit: str) -> LongRow:
    """Return the row with the labels that a name `<quantity>.<statistic>@<condition>` holds."""
    whole, _, condition = name.partition("@")
    quantity, _, last = whole.rpartition(".")
    statistic = last if quantity and last in _STATISTICS else VALUE
    quantity = whole if statistic == VALUE else quantity
    return one._replace(
        quantity=quantity, statistic=statistic, condition=condition, at=at_of(condition), unit=unit,
        kind=kind_of(quantity, unit),
    )  # fmt: skip


@lru_cache(maxsize=1000)
def at_of(condition: str) -> float | None:
    """Time or load of a condition as `9mm` or `0.5s`, SI; None where it is none."""
    found = split(condition)
    if found is None or not found[1] or not is_unit(found[1]):
        return None
    return found[0] * si_of(found[1])[0]


@dataclass(frozen=True)
class RowBlock:
    """values (k,) at times s or loads `at` (k,), with `sd` (k,), SI, and their labels `row`.

    An experiment's own numbers become rows by it: `row` says quantity, unit, method, part, ...
    """

    row: LongRow
    values: Floats
    at: Floats | None = None
    sd: Floats | None = None

    def __post_init__(self) -> None:
        values = checked(self.values, f"rows of '{self.row.quantity}'", (None,), nan=True,
                         error=ComparisonError)  # fmt: skip
        object.__setattr__(self, "values", values)
        for name in ("at", "sd"):
            if (given := getattr(self, name)) is not None:
                found = checked(given, f"{name} of '{self.row.quantity}'", values.shape,
                                error=ComparisonError)  # fmt: skip
                object.__setattr__(self, name, found)

    def rows(self) -> Iterator[LongRow]:
        """Each value as a row, None where there is no number; `point` counts without times."""
        values = [v if np.isfinite(v) else None for v in self.values.tolist()]
        rows = [self.row._replace(value=v) for v in values]
        if self.at is not None:
            rows = [r._replace(at=at) for r, at in zip(rows, self.at.tolist(), strict=True)]
        elif len(rows) > 1:
            rows = [r._replace(point=i) for i, r in enumerate(rows)]
        if self.sd is not None:
            rows = [r._replace(sd=sd) for r, sd in zip(rows, self.sd.tolist(), strict=True)]
        yield from rows
