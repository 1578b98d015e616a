"""Pilot runs of candidate methods, from the cheapest on, with bounds on their times.

Once a pick is known, a candidate (a solver with one element) is first timed for a few steps on the
coarsest mesh. Finer meshes are slower, so that its other cells run only where this time is not
longer than the pick's.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from validate.engine.cell import Where
from validate.engine.execution import CELLS, Finished, Report, finish
from validate.errors import UsageError
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.ladder.default import trial_of
from validate.pipeline.ladder.ladder import Rung, Trial
from validate.pipeline.run.job import job_of
from validate.pipeline.run.named_run import study_folder
from validate.study.choose.facts import ShownEffects, with_effects
from validate.study.filters.ranking import SAME_TIME
from validate.study.tradeoff.cell import Measured, TradeCell, cavity_pressures, driving, keyed
from validate.study.tradeoff.study import (
    ERRORS,
    KIND,
    ErrorUnit,
    Trade,
    plan_of,
    trade_cells,
    traded,
)

_PILOT = 0.0  # s: the budget of a cell that is timed and not run to its end


@dataclass(frozen=True)
class Excluded:
    """A candidate that cannot be faster than the pick: seconds of a step, at least `bound`.

    `bound` is the median step of the `pilot` (with its displacements), the fastest of its time
    steps, divided by `SAME_TIME` for a noisy clock; `pick` is the time that it is compared with.
    """

    rung: Rung
    candidate: str
    pilot: str
    bound: float
    pick: float

    @property
    def why(self) -> str:
        return (
            f"a step of {self.pilot} takes {1e6 * self.bound * SAME_TIME:.3g} us; finer meshes "
            f"are slower. The pick's step takes {1e6 * self.pick:.3g} us"
        )


@dataclass(frozen=True)
class Reached:
    """A trade of all cells up to a rung, and the rung's candidates that a bound excludes."""

    trade: Trade
    excluded: tuple[Excluded, ...]


class Climb:
    """Runs one rung after another; nothing of a rung runs before it is asked for.

    `declared_law`: solvers at large strain are left out. As `trade` otherwise. Raises `UsageError`
    for errors in a `unit` of which the scene has no number.
    """

    def __init__(
        self,
        experiment: Experiment,
        *,
        unit: ErrorUnit = "m",
        effects: ShownEffects | None = None,
        declared_law: bool = False,
        quick: bool = False,
        out: Path | None = None,
        where: Where | None = None,
        report: Report | None = None,
    ) -> None:
        trial = trial_of(experiment, quick)
        require_judged(trial, unit)
        self._trial = with_effects(trial, experiment, effects)
        self._experiment, self._quick, self._unit = experiment, quick, unit
        self._declared_law, self._where, self._report = declared_law, where, report
        self._job = job_of(experiment, quick=quick)
        self._folder = study_folder(experiment, KIND, out) / CELLS
        self._cells = trade_cells(self._trial, self._job)
        self._ran = tuple(c for c in self._cells if c.part != "solver")  # what errors come from
        self._done = Finished[Measured]({}, 0, 0.0, "")

    def __call__(self, rung: Rung, fastest: float | None) -> Reached | None:
        """The rung, with bounds against the time s of the `fastest` cell that is wanted (None:
        there is none yet); None where the rung has no cell."""
        solvers = {c: self._trial.solver(c.solver) for c in self._cells if c.part == "solver"}
        cells = [c for c, solver in solvers.items() if solver.rung == rung
                 and not (self._declared_law and solver.law != "linear")]  # fmt: skip
        if not cells:
            return None
        excluded: tuple[Excluded, ...] = ()
        if fastest is not None:
            cells, excluded = self._within(cells, rung, fastest)
        self._finish((*(self._ran if not self._done.records else ()), *cells), rung)
        self._ran = (*self._ran, *cells)
        trade = traded(
            self._experiment, self._trial, self._ran, self._done, self._quick, self._unit
        )
        return Reached(trade, excluded)

    def _within(
        self, cells: Sequence[TradeCell], rung: Rung, fastest: float
    ) -> tuple[list[TradeCell], tuple[Excluded, ...]]:
        """Cells of the candidates that no bound excludes, and the excluded ones."""
        coarsest: dict[tuple[str, str], TradeCell] = {}
        for c in cells:
            known = coarsest.setdefault((c.solver, c.element), c)
            if c.level < known.level:
                coarsest[c.solver, c.element] = c
        pilots = {
            name: keyed(self._job, replace(c, budget=_PILOT, key=""))
            for name, c in coarsest.items()
        }
        self._finish(tuple(pilots.values()), rung)
        excluded = {}
        for name, pilot in pilots.items():
            bound = time_bound(self._done.records[pilot.key].value)
            if bound is not None and bound > fastest:
                solver, element = name
                excluded[name] = Excluded(
                    rung, f"{solver}, {element}", pilot.label, bound, fastest
                )  # fmt: skip
        kept = [c for c in cells if (c.solver, c.element) not in excluded]
        return kept, tuple(excluded.values())

    def _finish(self, cells: tuple[TradeCell, ...], rung: Rung) -> None:
        if cells:
            report = _above(rung, self._report)
            ran = finish(plan_of(self._job, cells), self._folder, self._where, report)
            self._done = self._done.and_also(ran)


def time_bound(pilot: Measured | None) -> float | None:
    """Seconds that a step with its displacements takes at least, on the pilot's mesh and on finer
    ones; None where no step was timed."""
    times = [s.step.p50 + s.field_s for s in (pilot.strides if pilot else ()) if s.step is not None]
    return min(times) / SAME_TIME if times else None


def require_judged(trial: Trial, unit: ErrorUnit) -> None:
    """Raise `UsageError` where the scene has nothing in that unit, naming what it has."""
    element, levels = next(iter(trial.meshes.items()))
    scene = trial.build(element, levels[0], "linear")
    has = {"m": ("displacements",), "N": driving(scene), "Pa": cavity_pressures(scene)}
    if not has[unit]:
        names = "; ".join(f"{u}: {', '.join(has[u])}" for u in ERRORS if has[u])
        raise UsageError(
            f"--error in {unit}: this scene has no quantity in that unit; it has {names}"
        )


def _above(rung: Rung, report: Report | None) -> Report | None:
    """Progress that names the rung."""
    if report is None:
        return None
    return lambda done, total, text: report(done, total, f"rung '{rung}': {text}")
