"""A comparison of stored runs cut down to what is asked for, and put in order."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from types import MappingProxyType
from typing import Any

from validate.errors import UsageError
from validate.parameters import nearest_names
from validate.study.stored import Row, SideBySide, StoredRun

_TIMES = ("setup", "step.")  # scores that differ from run to run whatever was changed


def narrowed(
    runs: Sequence[StoredRun], methods: Sequence[str] = (), scores: Sequence[str] = ()
) -> tuple[StoredRun, ...]:
    """The runs with the methods and scores that any of the patterns (`kf_*`) fits; none: all.

    Raises `UsageError` for a pattern that fits nothing in any run.
    """
    _require_fitting("--method", methods, {m for r in runs for m in r.methods})
    _require_fitting("--score", scores, {score for r in runs for _, score in r.scores})
    return tuple(
        replace(
            r,
            methods=tuple(m for m in r.methods if _fits(m, methods)),
            scores={k: v for k, v in r.scores.items()
                    if _fits(k[0], methods) and _fits(k[1], scores)},
        )
        for r in runs
    )  # fmt: skip


def _require_fitting(option: str, patterns: Sequence[str], names: set[str]) -> None:
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for name in names):
            hint = nearest_names(pattern, names)
            raise UsageError(f"{option} {pattern} matches none of {len(names)} names; {hint}")


def _fits(name: str, patterns: Sequence[str]) -> bool:
    return not patterns or any(fnmatchcase(name, p) for p in patterns)


def _largest(values: Iterable[float | None]) -> float:
    return max((abs(v) for v in values if v is not None), default=0.0)


def _by_change(row: Row) -> tuple[bool, float]:
    """The largest first, from nothing to something before all; times last."""
    apart, relative = _largest(row.differences), _largest(row.changes)
    from_nothing = apart > 0 and relative == 0
    return row.score.startswith(_TIMES), -math.inf if from_nothing else -relative


SORTS: Mapping[str, Callable[[Row], Any]] = MappingProxyType(
    {
        "change": _by_change,
        "difference": lambda row: (row.unit, -_largest(row.differences)),
        "score": lambda row: (row.score, row.method),
        "method": lambda row: (row.method, row.score),
        "stored": lambda row: 0,
    }
)


def ordered(found: SideBySide, sort: str) -> SideBySide:
    """Its rows by one of `SORTS`; equal ones stay as they were stored."""
    return replace(found, rows=tuple(sorted(found.rows, key=SORTS[sort])))
