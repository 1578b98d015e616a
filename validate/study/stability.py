"""The stability map of a base scene: every scheme over time step, material, damping, cells, mesh.

from validate.study.stability import stability
found = stability("needle_block")
print(found.passed, found.points)
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Literal

from validate.errors import UsageError
from validate.replay.find import find, root_of
from validate.study.base_scenes import BaseScene, base_scene
from validate.study.stability_cell import (
    SchemeResult,
    VariantResult,
    read_variants,
    run_variant,
    write_variant,
)
from validate.study.stepping import STEPPINGS, Stepping
from validate.study.variants import VariantCell, variant_cells

KIND = "study-stability"
CELLS = "cells"
FEWEST = 500  # points of a map
TOLERANCE = 0.02  # of the predicted limit
DRIFT_TOLERANCE = 1e-6  # of the energy, over 1e5 steps in float64
RESOLVED = 6.283 / 10  # rad of the slowest mode in a step: ten steps a period
SCHEMES: Mapping[str, Stepping] = {s.name: s for s in STEPPINGS}

Regime = Literal["stable", "unresolved", "unstable", "refused"]
Report = Callable[[int, int, str], None]


@dataclass(frozen=True)
class Point:
    """One scheme, variant and step dt s; `radius` None where nothing was run, and `why`."""

    cell: VariantCell
    scheme: str
    dt: float
    regime: Regime
    radius: float | None
    why: str


@dataclass(frozen=True)
class Prediction:
    """A claim held against what was measured: the worst `value` of `count`, and its `limit`."""

    name: str
    value: float | None
    limit: float
    count: int
    holds: bool
    why: str


@dataclass(frozen=True)
class Stability:
    """All cells with results by key; `reused` were finished before; `seconds` of this call."""

    base: BaseScene
    cells: tuple[VariantCell, ...]
    results: Mapping[str, VariantResult]
    quick: bool
    reused: int
    seconds: float
    workers: str

    @property
    def schemes(self) -> tuple[str, ...]:
        """Those that know this body's cells."""
        ran = (r.schemes for r in self.results.values() if r.schemes)
        return tuple(s.scheme for s in next(ran, ()))

    @property
    def all_points(self) -> Iterator[Point]:
        for cell in self.cells:
            yield from points(cell, self.results[cell.key], self.schemes)

    @property
    def points(self) -> int:
        """Points that have a regime."""
        return sum(1 for _ in self.all_points)

    @property
    def predictions(self) -> tuple[Prediction, ...]:
        return tuple(_predictions(self))

    @property
    def passed(self) -> bool:
        return all(p.holds for p in self.predictions)


def stability(
    name: str,
    *,
    quick: bool = False,
    out: Path | None = None,
    workers: int | None = None,
    scheduler: str = "",
    report: Report | None = None,
) -> Stability:
    """Runs what is not finished yet in `out`/<name>/study-stability/cells.

    Raises `UsageError` for an unknown base scene or a scheduler that does not answer.
    """
    from validate.study.workers import Where, cores, run_each  # a second to import

    start = perf_counter()
    base = base_scene(name)
    cells = variant_cells(base, quick)
    folder = stability_folder(name, out) / CELLS
    folder.mkdir(parents=True, exist_ok=True)
    before = read_variants(folder, cells)
    results = dict(before)
    left = sorted((c for c in cells if c.key not in before), key=lambda c: not c.drift)

    def done(cell: VariantCell, result: VariantResult) -> None:
        results[cell.key] = result
        if not result.failed:
            write_variant(folder, result)
        if report:
            report(len(results), len(cells), "variants")

    run_each(run_variant, left, Where(workers, scheduler), done)
    named = f"Dask at {scheduler}" if scheduler else f"{workers or min(cores(), len(left))} local"
    seconds = perf_counter() - start
    return Stability(base, cells, results, quick, len(before), seconds, named)


def stability_folder(name: str, out: Path | None) -> Path:
    """`out`/<name>/study-stability, by default in the reports/ of the experiment's clone."""
    if out is None:
        try:
            out = root_of(find(name, Path.cwd()), Path.cwd()) / "reports"
        except UsageError:  # a base scene needs no experiment
            out = Path.cwd() / "reports"
    return out / name / KIND


def points(cell: VariantCell, result: VariantResult, schemes: tuple[str, ...]) -> Iterator[Point]:
    """Every scheme and step of one variant."""
    if result.refused or result.failed:
        why = result.refused or result.failed
        for scheme in schemes:
            for dt in cell.steps:
                yield Point(cell, scheme, dt, "refused", None, why)
        return
    for found in result.schemes:
        for dt, radius in zip(cell.steps, found.radii, strict=True):
            yield Point(cell, found.scheme, dt, *_regime(found, result, dt, radius))


def _regime(
    found: SchemeResult, result: VariantResult, dt: float, radius: float
) -> tuple[Regime, float, str]:
    scheme = SCHEMES[found.scheme]
    if radius > 1 + scheme.rounding:
        times = "" if found.predicted is None else f"{dt / found.predicted:.4g} times the limit"
        return "unstable", radius, times
    turn = result.lowest * dt
    if turn > RESOLVED and scheme.name not in ("quasi_static", "modal"):
        return "unresolved", radius, f"h too large to resolve: {turn:.3g} rad of the slowest mode"
    return "stable", radius, ""


# --- what is claimed ------------------------------------------------------------------------------


def _predictions(study: Stability) -> Iterator[Prediction]:
    ran = [r for r in study.results.values() if not r.refused and not r.failed]
    for name in study.schemes:
        own = [s for r in ran for s in r.schemes if s.scheme == name]
        yield (_limit if SCHEMES[name].limit else _no_limit)(name, own)
    yield from _drift(study, ran)
    yield _refusals(study)
    failed = [r.failed for r in study.results.values() if r.failed]
    why = failed[0] if failed else ""
    yield Prediction("variants that failed", len(failed), 0, len(study.cells), not failed, why)
    count = study.points
    yield Prediction("points", count, FEWEST, count, count >= FEWEST, f"at least {FEWEST}")


def limit_error(found: SchemeResult) -> float | None:
    """Measured over predicted limit less 1; None where either is missing."""
    if found.predicted is None or found.measured is None:
        return None
    return found.measured / found.predicted - 1


def _limit(name: str, own: list[SchemeResult]) -> Prediction:
    errors = [e for s in own if (e := limit_error(s)) is not None]
    missing = len(own) - len(errors)
    worst = max(errors, key=abs, default=None)
    holds = bool(errors) and not missing and abs(worst or 0.0) <= TOLERANCE
    why = f"{missing} limits not found" if missing else "measured over predicted limit less 1"
    return Prediction(f"limit.{name}", worst, TOLERANCE, len(errors), holds, why)


def _no_limit(name: str, own: list[SchemeResult]) -> Prediction:
    over = [r - 1 for s in own for r in s.radii]
    worst, border = max(over, default=None), SCHEMES[name].rounding
    holds = worst is not None and worst <= border
    return Prediction(f"no_limit.{name}", worst, border, len(over), holds, "radius less 1")


def _drift(study: Stability, ran: list[VariantResult]) -> Iterator[Prediction]:
    kept = [d for r in ran for d in r.drifts if SCHEMES[d.scheme].conserves]
    changes = [abs(d.double - 1) for d in kept if d.double is not None]
    worst = max(changes, default=None)
    holds = worst is not None and len(changes) == len(kept) and worst <= DRIFT_TOLERANCE
    why = "energy of schemes that conserve it, over 1e5 undamped steps in float64"
    yield Prediction("drift", worst, DRIFT_TOLERANCE, len(changes), holds, why)


def _refusals(study: Stability) -> Prediction:
    """Exactly those that cannot be are refused, each for its own reason."""
    wrong = []
    for cell in study.cells:
        refused = study.results[cell.key].refused
        if bool(refused) != bool(cell.expected) or cell.expected not in refused:
            wrong.append(f"{cell.variant}: '{refused}'")
    count = sum(1 for c in study.cells if c.expected)
    why = wrong[0] if wrong else "refused where it must be, for its reason, and nowhere else"
    return Prediction("refusals", len(wrong), 0, count, not wrong and count > 0, why)
