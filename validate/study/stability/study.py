"""Stability map of an experiment's body: every scheme over step, material, damping, mesh.

from validate.study.stability.study import stability
found = stability("needle_block")
print(found.passed, found.points)
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from validate.engine.cell import Plan, Record, Where
from validate.engine.execution import CELLS, Finished, Report, finish
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import find
from validate.pipeline.ladder.default import body_of
from validate.pipeline.ladder.ladder import StabilityBody
from validate.pipeline.run.job import job_of, study_folder
from validate.solve.schemes import steppings
from validate.solve.study_entries import Stepping
from validate.study.stability.cell import SchemeResult, Stepped, open_bench, run_cell
from validate.study.stability.plan import StabilityCell, stability_cells

KIND = "stability"
FEWEST = 500  # points of a map
TOLERANCE = 0.02  # of the predicted limit
DRIFT_TOLERANCE = 1e-6  # of the energy, over 1e5 steps in float64
RESOLVED = 6.283 / 10  # rad of the slowest mode in a step: ten steps a period

Regime = Literal["stable", "unresolved", "unstable", "refused"]


def declared() -> Mapping[str, Stepping]:
    """Return the step maps of all schemes by name."""
    return {s.name: s for s in steppings()}


@dataclass(frozen=True)
class Point:
    """One scheme, variant and step dt s; `radius` None where nothing was run, and `why`."""

    cell: StabilityCell
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
    """All cells with their records by key."""

    experiment: Experiment
    base: StabilityBody
    cells: tuple[StabilityCell, ...]
    done: Finished[Stepped]
    quick: bool

    @property
    def ran(self) -> tuple[Stepped, ...]:
        return tuple(r.value for r in self.done.records.values() if r.value is not None)

    @property
    def schemes(self) -> tuple[str, ...]:
        """Those that know this body's cells."""
        return tuple(s.scheme for s in self.ran[0].schemes) if self.ran else ()

    @property
    def all_points(self) -> Iterator[Point]:
        for cell in self.cells:
            yield from points(cell, self.done.records[cell.key], self.schemes)

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
    experiment: str | Experiment,
    *,
    quick: bool = False,
    out: Path | None = None,
    where: Where | None = None,
    report: Report | None = None,
) -> Stability | None:
    """Run what is not finished yet in `out`/<name>/study-stability/cells.

    None for an experiment without density, in which nothing steps in time. Raises `UsageError` for
    a body with too many modes, or a scheduler that does not answer.
    """
    found = find(experiment, Path.cwd()) if isinstance(experiment, str) else experiment
    base = body_of(found)
    if base is None:
        return None
    job = job_of(found, quick=quick)
    cells = stability_cells(base, job, quick)
    longest_first = tuple(sorted(cells, key=lambda c: not c.drift))
    plan = Plan(job, longest_first, open_bench, run_cell, Stepped)
    done = finish(plan, study_folder(found, KIND, out) / CELLS, where, report)
    return Stability(found, base, cells, done, quick)


def points(
    cell: StabilityCell, record: Record[Stepped], schemes: tuple[str, ...]
) -> Iterator[Point]:
    """Every scheme and step of one variant."""
    if record.value is None:
        for scheme in schemes:
            for dt in cell.steps:
                yield Point(cell, scheme, dt, "refused", None, record.why)
        return
    for found in record.value.schemes:
        stepping = declared()[found.scheme]
        for dt, radius in zip(cell.steps, found.radii, strict=True):
            turn = record.value.lowest * dt
            regime: Regime = "stable"
            why = ""
            if radius > 1 + stepping.rounding:
                regime = "unstable"
                if found.predicted is not None:
                    why = f"{dt / found.predicted:.4g} times the limit"
            elif turn > RESOLVED and stepping.name not in ("quasi_static", "modal"):
                regime = "unresolved"
                why = f"h too large to resolve: {turn:.3g} rad of the slowest mode"
            yield Point(cell, found.scheme, dt, regime, radius, why)


# --- what is claimed ------------------------------------------------------------------------------


def _predictions(study: Stability) -> Iterator[Prediction]:
    for name in study.schemes:
        own = [s for r in study.ran for s in r.schemes if s.scheme == name]
        yield (_limit if declared()[name].limit else _no_limit)(name, own)
    kept = [d for r in study.ran for d in r.drifts if declared()[d.scheme].conserves]
    changes = [abs(d.double - 1) for d in kept if d.double is not None]
    worst = max(changes, default=None)
    holds = worst is not None and len(changes) == len(kept) and worst <= DRIFT_TOLERANCE
    why = "energy of conservative schemes over 1e5 undamped steps in float64"
    yield Prediction("drift", worst, DRIFT_TOLERANCE, len(changes), holds, why)
    # Exactly those that cannot be are refused, each for its own reason
    wrong = []
    for cell in study.cells:
        refused = study.done.records[cell.key].refused
        if bool(refused) != bool(cell.expected) or cell.expected not in refused:
            wrong.append(f"{cell.variant}: '{refused}'")
    expected = sum(1 for c in study.cells if c.expected)
    refusal = wrong[0] if wrong else "refused exactly where required, for the right reason"
    yield Prediction("refusals", len(wrong), 0, expected, not wrong and expected > 0, refusal)
    failed = [r.failed for r in study.done.records.values() if r.failed]
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
    worst, border = max(over, default=None), declared()[name].rounding
    holds = worst is not None and worst <= border
    return Prediction(f"no_limit.{name}", worst, border, len(over), holds, "radius less 1")
