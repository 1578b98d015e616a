"""Summary of all stored runs: bias and scatter of predictions, by measured quantity."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from validate.compare.bias import Predicted, Statement, area_metric, statement
from validate.errors import UsageError
from validate.report.stored.json_values import Json
from validate.study.stored_runs.predictions import Foretold, Seen, predictions, stored_runs

Range = tuple[float, float] | None


@dataclass(frozen=True)
class Covered:
    """The least and the largest that the predictions of a kind reached: size in `unit`, strain 1,
    rate 1/s, side of the body m. None where no run says."""

    size: Range
    unit: str
    strain: Range
    rate: Range
    sides: Range


@dataclass(frozen=True)
class OfKind:
    """Bias and scatter of predictions of one kind of quantity.

    `stated` is None where a prediction has the wrong sign: then there is no ratio; `why` says so,
    and why an interval is missing.
    """

    kind: str
    points: tuple[Foretold, ...]
    stated: Statement | None
    covered: Covered
    why: str


@dataclass(frozen=True)
class Summary:
    """`kinds` of measured recordings, `twins` apart; the runs with why they do not count; checks
    that do not count, by reason."""

    reports: Path
    runs: tuple[Seen, ...]
    kinds: tuple[OfKind, ...]
    twins: tuple[OfKind, ...]
    left: dict[str, int]

    @property
    def taken(self) -> tuple[Seen, ...]:
        return tuple(run for run in self.runs if not run.why)


def summary(reports: Path) -> Summary:
    """Over every run below a folder of reports. Raises `UsageError` where none counts."""
    runs = stored_runs(reports) if reports.is_dir() else ()
    measured = [r for r in runs if not r.why and r.kind == "measured"]
    twins = [r for r in runs if not r.why and r.kind == "twin"]
    if not measured and not twins:
        seen = "; ".join(f"{r.folder}: {r.why or r.kind}" for r in runs[:3])
        raise UsageError(
            f"no run below {reports} counts ({seen or '0 runs'}); `validate run silicone_beam` "
            "makes one of a measured recording"
        )
    (points, left), (made, _) = predictions(measured), predictions(twins)
    return Summary(reports, runs, _kinds(points, measured), _kinds(made, twins), left)


def area_of(point: Foretold) -> float:
    """Return the area metric of one prediction, in its unit."""
    return area_metric(point.error, point.u_simulated, point.u_measured)


def _kinds(points: Sequence[Foretold], runs: Sequence[Seen]) -> tuple[OfKind, ...]:
    """By kind, and by unit where a kind has several: newtons and an unknown unit stay apart."""
    groups = dict.fromkeys((p.kind, p.unit) for p in points)
    return tuple(
        _of_kind(kind, [p for p in points if (p.kind, p.unit) == (kind, unit)], runs)
        for kind, unit in sorted(groups)
    )


def _of_kind(kind: str, points: list[Foretold], runs: Sequence[Seen]) -> OfKind:
    turned = [p for p in points if p.simulated <= 0]
    covered = _covered(points, runs)
    if turned:
        first = turned[0]
        why = (
            f"{len(turned)} of {len(points)} predictions have the wrong sign "
            f"({first.experiment}: {first.check}): a ratio is not possible"
        )
        return OfKind(kind, tuple(points), None, covered, why)
    stated = statement(
        [Predicted(p.specimen, float(np.log(p.simulated / p.measured)), p.u / p.measured)
         for p in points]
    )  # fmt: skip
    few = "one specimen: no interval over specimens" if stated.specimens == 1 else ""
    return OfKind(kind, tuple(points), stated, covered, few)


def _covered(points: Sequence[Foretold], runs: Sequence[Seen]) -> Covered:
    folders = {f for p in points for f in p.folders}
    domains = [d for r in runs if r.folder in folders for d in r.domain]
    sizes = [p.measured for p in points]
    return Covered(
        (min(sizes), max(sizes)), points[0].unit, _range(domains, lambda d: [d["strain"]]),
        _range(domains, lambda d: [d["rate"]]), _range(domains, lambda d: d["sides"] or []),
    )  # fmt: skip


def _range(domains: Sequence[Json], of: Callable[[Json], list[Any]]) -> Range:
    found = [float(value) for d in domains for value in of(d) if value is not None]
    return (min(found), max(found)) if found else None
