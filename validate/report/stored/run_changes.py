"""Changes between two runs: parameters, files, code, and scores beyond their uncertainty."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from validate.errors import UsageError
from validate.report.stored.history import LINES, lines_of
from validate.report.stored.json_values import Json
from validate.report.stored.tables import is_called

BEYOND = 2.0  # standard uncertainties of the difference: as a check's |E| against u_val
_ROUNDING = 1e-9  # relative: the same computation on another machine


@dataclass(frozen=True)
class PastCheck:
    """A check of an accepted method: error E and its standard uncertainties, SI."""

    method: str
    name: str
    value: float | None
    limit: float | None
    u_val: float
    u_num: float
    unit: str
    verdict: str
    within_noise: bool


@dataclass(frozen=True)
class PastRun:
    """A run as its folder remembers it; `files` are hashes by name, `line` is all that is kept."""

    folder: str
    created: str
    verdict: str
    commit: str
    code: str
    methods: tuple[str, ...]
    recordings: tuple[str, ...]
    files: Mapping[str, str]
    parameters: Mapping[str, tuple[Any, str]]
    checks: tuple[PastCheck, ...]
    line: Json


@dataclass(frozen=True)
class Move:
    """A check whose error moved by so many standard uncertainties; None: there is none."""

    method: str
    name: str
    one: float
    other: float
    unit: str
    ratio: float | None


@dataclass(frozen=True)
class Since:
    """What differs of a run from the one before it: texts before and after, by name.

    Settings of a method that only one of them has are no difference: it is `added` or `left_out`.
    `moved` beyond their uncertainty, `within` so many more that did not, by at most `most` standard
    uncertainties.
    """

    parameters: Mapping[str, tuple[str, str]]
    files: Mapping[str, tuple[str, str]]
    code: tuple[str, str] | None
    verdict: tuple[str, str] | None
    added: tuple[str, ...]
    left_out: tuple[str, ...]
    moved: tuple[Move, ...]
    within: int
    most: float


def history(reports: Path, name: str) -> tuple[PastRun, ...]:
    """Every run of an experiment (or, of `NAME+quick`, of those variations) below a folder of
    reports, the oldest first.

    Raises `UsageError` for a damaged line.
    """
    folders = sorted(reports.iterdir()) if reports.is_dir() else []
    found = (run for f in folders if f.is_dir() and is_called(f, name) for run in _runs(f))
    mine = (r for r in found if r.line["experiment"] == name.partition("+")[0])
    return tuple(sorted(mine, key=lambda r: r.created))


def _runs(folder: Path) -> Iterator[PastRun]:
    try:
        for line in lines_of(folder):
            made = line.get("made") or {}
            files = [*line["inputs"], *made.get("files", [])]
            verdict = "passed" if line.get("passed") else "failed"
            if overall := line.get("overall"):
                checks = f"{overall['evidence']} of {overall['checks']} checks"
                verdict = f"{overall['verdict']}; evidence: {checks}"
            sha = str(made.get("commit") or "")[:10]
            commit = f"{sha}{', with changes' if made.get('dirty') else ''}" if sha else "unknown"
            yield PastRun(
                folder.name, str(line["created"]), verdict, commit,
                str(made.get("code_sha256") or ""),
                tuple(str(m) for m in line["methods"]),
                tuple(str(i["sha256"]) for i in line["inputs"]),
                {str(f["path"]): str(f["sha256"]) for f in files},
                {k: (v["value"], v["unit"]) for k, v in line["parameters"].items()},
                tuple(_check(c) for c in line["checks"]), line,
            )  # fmt: skip
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise UsageError(
            f"{folder / LINES} has a line that `validate` did not write ({error!r:.60}); "
            "correct or remove the file"
        ) from error


def _check(c: Json) -> PastCheck:
    value, raw = c["value"], c.get("raw")
    return PastCheck(
        str(c["method"]), str(c["name"]), value, c["limit"], float(c["u_val"] or 0),
        float(c["u_num"] or 0), str(c["unit"]), str(c["verdict"]), bool(value == 0 and raw),
    )  # fmt: skip


# --- from one to the next ------------------------------------------------------------------------


def since(one: PastRun, other: PastRun) -> Since:
    """What changed from `one` to `other`.

    Two runs of the same recordings share their noise and their inputs' ranges, so a difference of
    theirs has the uncertainty of the numbers alone (u_num); with other recordings it is all of
    u_val. A check moved where |E' - E| > 2 sqrt(u'^2 + u^2).
    """
    moves: list[Move] = []
    same = one.recordings == other.recordings
    before = {(c.method, c.name): c for c in one.checks}
    for c in other.checks:
        earlier = before.get((c.method, c.name))
        if not earlier or earlier.unit != c.unit or earlier.value is None or c.value is None:
            continue
        by = abs(c.value - earlier.value)
        u = math.hypot(earlier.u_num, c.u_num) if same else math.hypot(earlier.u_val, c.u_val)
        ratio = by / u if u else None
        if by <= _ROUNDING * max(abs(earlier.value), abs(c.value)):
            ratio = 0.0
        moves.append(Move(c.method, c.name, earlier.value, c.value, c.unit, ratio))
    moved = [m for m in moves if m.ratio is None or m.ratio > BEYOND]
    rest = [m.ratio for m in moves if m.ratio is not None and m.ratio <= BEYOND]
    same_code = one.code == other.code and one.commit == other.commit
    return Since(
        parameters=_apart(_shown(one, other), _shown(other, one)),
        files=_apart(one.files, other.files),
        code=None if same_code else (one.commit, other.commit),
        verdict=None if one.verdict == other.verdict else (one.verdict, other.verdict),
        added=tuple(m for m in other.methods if m not in one.methods),
        left_out=tuple(m for m in one.methods if m not in other.methods),
        moved=tuple(sorted(moved, key=lambda m: -(m.ratio or math.inf))),
        within=len(rest),
        most=max(rest, default=0.0),
    )


def _shown(run: PastRun, beside: PastRun) -> dict[str, str]:
    """Parameters as texts, those of methods that only this run has left out."""
    alone = tuple(f"methods.{m}." for m in run.methods if m not in beside.methods)
    return {k: with_unit(*v) for k, v in run.parameters.items() if not k.startswith(alone)}


def with_unit(value: Any, unit: str) -> str:
    """Return a parameter's value in SI as text."""
    return _plain(value) if unit == "1" else f"{_plain(value)} {unit}"


def _plain(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(map(_plain, value))
    if isinstance(value, float):
        return f"{value:.6g}"
    return "not set" if value is None else str(value)


def _apart(one: Mapping[str, str], other: Mapping[str, str]) -> dict[str, tuple[str, str]]:
    """By name, what differs or one of them lacks ("-")."""
    names: Sequence[str] = list(dict.fromkeys([*one, *other]))
    return {n: (one.get(n, "-"), other.get(n, "-")) for n in names if one.get(n) != other.get(n)}
