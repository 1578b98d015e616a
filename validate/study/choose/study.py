"""Choice of the cheapest method that meets an error and a rate, by pilot runs.

The pilots are the cells of the trade, run rung by rung from the cheapest methods on. The choice is
the fastest cell of all that meet both. Once one does, candidates are left out whose step on their
coarsest mesh already takes longer; the bound is shown. For a scene with inertia a cell is run again
with a new state at every tick of the rate before it is named.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from validate.engine.cell import Where
from validate.engine.execution import CELLS, Finished, Report, finish
from validate.errors import UsageError
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.ladder.default import trial_of
from validate.pipeline.ladder.ladder import RUNGS, Rung, Trial
from validate.pipeline.run.job import job_of, study_folder
from validate.study.choose.facts import Fact, ShownEffects, facts, with_effects
from validate.study.filters.ranking import SAME_TIME
from validate.study.tradeoff.cell import Measured, TradeCell, cavity_pressures, driving, keyed
from validate.study.tradeoff.study import (
    ERRORS,
    KIND,
    ErrorUnit,
    Trade,
    TradeRow,
    plan_of,
    trade_cells,
    traded,
)
from validate.units import in_si

# --- pilot runs of candidate methods, from the cheapest on, with bounds on their times -----------

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
            # A bound by a short pilot run on its coarsest mesh excludes a candidate.
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
            slow = {}
            for name, pilot in pilots.items():
                bound = time_bound(self._done.records[pilot.key].value)
                if bound is not None and bound > fastest:
                    label = ", ".join(name)
                    slow[name] = Excluded(rung, label, pilot.label, bound, fastest)
            cells = [c for c in cells if (c.solver, c.element) not in slow]
            excluded = tuple(slow.values())
        self._finish((*(self._ran if not self._done.records else ()), *cells), rung)
        self._ran = (*self._ran, *cells)
        trade = traded(
            self._experiment, self._trial, self._ran, self._done, self._quick, self._unit
        )
        return Reached(trade, excluded)

    def _finish(self, cells: tuple[TradeCell, ...], rung: Rung) -> None:
        if cells:
            report = self._report
            # Progress names the rung.
            of_rung: Report | None = report and (
                lambda done, total, text: report(done, total, f"rung '{rung}': {text}")
            )
            ran = finish(plan_of(self._job, cells), self._folder, self._where, of_rung)
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


# --- choice of the cheapest method that meets an error and a rate, by pilot runs -----------------

_TRIES = 4  # cells that are run again at the rate's own step
_QUANTITY = re.compile(r"\s*([0-9.eE+-]+)\s*([^\d\s.].*)?")

_UNITS: tuple[ErrorUnit, ...] = ("m", "N", "Pa")

Again = Callable[[Trade, TradeRow, float], TradeRow]
Climbs = Callable[[Rung, float | None], Reached | None]  # see `Climb`
Meets = Literal[
    "meets both", "too slow", "too wrong", "neither", "not the scene", "nothing ran", "excluded"
]


@dataclass(frozen=True)
class Wanted:
    """The largest error, in `unit`, and the least rate 1/s."""

    error: float
    rate: float
    unit: ErrorUnit = "m"

    def __post_init__(self) -> None:
        for value, what in ((self.error, "error"), (self.rate, "rate")):
            if not (np.isfinite(value) and value > 0):
                raise UsageError(f"--{what} {value:g}: expected a positive number with its unit")


@dataclass(frozen=True)
class Climbed:
    """One rung: cells run and scored, its row nearest to what is wanted, and the verdict."""

    rung: Rung
    run: int
    scored: int
    best: TradeRow | None
    verdict: Meets
    evidence: str


@dataclass(frozen=True)
class Choice:
    """Result; `pick` is None where no method meets both, `nearest` is the nearest one.

    `by`: "total" counts what the declared law costs, "error" does not. `confirmed` is the pick with
    a state at every tick of the rate, where its own step is longer.
    """

    trade: Trade
    wanted: Wanted
    by: str
    facts: tuple[Fact, ...]
    ladder: tuple[Climbed, ...]
    excluded: tuple[Excluded, ...]
    pick: TradeRow | None
    confirmed: TradeRow | None
    nearest: TradeRow
    rejected: tuple[str, ...]


def wanted(error: str, rate: str) -> Wanted:
    """`0.5mm` (or `0.2N`, `300Pa`) and `1000Hz` in SI; the unit says what is judged.

    Raises `UsageError`.
    """
    number, unit = _split(error, "--error", "0.5mm")
    hertz, per = _split(rate, "--rate", "1000Hz")
    factors = {"hz": 1.0, "khz": 1e3, "mhz": 1e6}
    if per.lower() not in factors:
        raise UsageError(
            f"--rate {rate}: unit '{per}' is not Hz, kHz or MHz; write for example 1000Hz"
        )
    for si in _UNITS:
        if (factor := in_si(1.0, unit, si)) is not None:
            return Wanted(number * factor, hertz * factors[per.lower()], si)
    raise UsageError(
        f"--error {error}: '{unit}' is not a unit of displacement, force or pressure; write "
        "for example 0.5mm, 0.2N, 300Pa"
    )


def _split(text: str, option: str, example: str) -> tuple[float, str]:
    found = _QUANTITY.fullmatch(text)
    try:
        number = float(found[1]) if found else float("nan")
    except ValueError:
        number = float("nan")
    if found is None or not np.isfinite(number) or not found[2]:
        raise UsageError(
            f"{option} {text}: expected a number with its unit; write for example {example}"
        )
    return number, found[2].strip()


# --- which ---------------------------------------------------------------------------------------


def error_of(row: TradeRow, by: str) -> float | None:
    value = getattr(row, by)
    return None if value is None else float(value)


def misses(row: TradeRow, want: Wanted, by: str, dynamic: bool) -> tuple[float, float]:
    """Error over the one wanted, and time over the one there is: both at most 1 where it meets.

    A scene with inertia must also keep up with the clock: a step within its own dt.
    """
    error, time = error_of(row, by), row.deadline_s
    if error is None or time is None:
        return np.inf, np.inf
    late = time * want.rate
    return error / want.error, max(late, time / row.dt) if dynamic else late


def meeting(rows: Sequence[TradeRow], want: Wanted, by: str, dynamic: bool) -> list[TradeRow]:
    """Return the rows that meet both and leave nothing of the scene out, fastest first."""
    whole = [r for r in rows if not r.solver.lacks]
    good = [r for r in whole if max(misses(r, want, by, dynamic)) <= 1]
    return sorted(good, key=lambda r: r.time_s or 0.0)


def nearest(rows: Sequence[TradeRow], want: Wanted, by: str, dynamic: bool) -> TradeRow:
    """Return the row whose worse miss is least; raises `UsageError` when no row has an error."""
    scored = [r for r in rows if error_of(r, by) is not None and not r.solver.lacks]
    if not scored:
        raise UsageError(f"none of {len(rows)} pilot runs has an error; see 'study tradeoff'")
    return min(scored, key=lambda r: max(misses(r, want, by, dynamic)))


def choose(
    climb: Climbs,
    want: Wanted,
    declared_law: bool,
    again: Again,
    effects: ShownEffects | None = None,
) -> Choice:
    """Return the choice from trades that grow rung by rung; `again` runs a row's cell with another
    step s.

    Where large strain could not be solved, what the declared law costs is not counted either.
    Raises `UsageError` where no rung has a cell, or no cell an error.
    """
    rejected, excluded = list[str](), list[Excluded]()
    trade = pick = confirmed = None
    for rung in RUNGS:
        reached = climb(rung, None if pick is None else pick.time_s)
        if reached is None:
            continue
        trade = reached.trade
        excluded += reached.excluded
        found = _picked(trade, rung, want, declared_law, again, rejected, pick)
        if found is not None:
            pick, confirmed = found
    if trade is None:
        raise UsageError(
            "no candidate method of the ladder has a cell for this scene; see 'study tradeoff'"
        )
    by, rows = _by(trade, declared_law), _judged(trade, declared_law)
    unsolved = left_out(declared_law, trade.law_words)
    ladder = tuple(
        _bounded(_climbed(trade, rung, rows, want, by, unsolved), excluded) for rung in RUNGS
    )
    closest = nearest(rows, want, by, trade.trial.dynamic)
    return Choice(
        trade, want, by, facts(trade, want.error, effects), ladder, tuple(excluded), pick,
        confirmed, closest, tuple(rejected),
    )  # fmt: skip


def _by(trade: Trade, declared_law: bool) -> str:
    return "error" if declared_law or trade.gap is None else "total"


def _judged(trade: Trade, declared_law: bool) -> list[TradeRow]:
    linear = _by(trade, declared_law) == "error"
    return [r for r in trade.rows if not linear or r.solver.law == "linear"]


def _picked(
    trade: Trade, rung: Rung, want: Wanted, declared_law: bool, again: Again, rejected: list[str],
    best: TradeRow | None,
) -> tuple[TradeRow, TradeRow | None] | None:  # fmt: skip
    """The rung's fastest cell that meets both and is faster than the `best` of the rungs below, and
    its run at the rate's own step where it has a longer one; those that fail it are added to
    `rejected`."""
    by, dynamic = _by(trade, declared_law), trade.trial.dynamic
    rows = [r for r in _judged(trade, declared_law) if r.solver.rung == rung]
    faster = [
        r for r in meeting(rows, want, by, dynamic)
        if best is None or (r.time_s or 0.0) < (best.time_s or 0.0)
    ]  # fmt: skip
    for row in faster[:_TRIES]:
        # A step s no longer than a tick, where the row's own is longer and inertia matters
        if not trade.trial.dynamic or row.dt * want.rate <= 1 + 1e-9:
            dt = None
        else:
            apart = float(np.diff(trade.trial.frames).min())
            dt = float(apart / np.ceil(apart * want.rate - 1e-9))
        tried = None if dt is None else again(trade, row, dt)
        if tried is None or max(misses(tried, want, by, dynamic)) <= 1:
            return row, tried
        error, time = error_of(tried, by), tried.time_s
        every = f"{tried.label}: with a state every {1e3 * tried.dt:.3g} ms"
        if error is None or time is None:
            rejected.append(f"{every}: {tried.failed}")
        else:
            takes = f"a step takes {1e6 * time:.3g} us"
            rejected.append(f"{every} its error is {trade.shown(error)} and {takes}")
    if len(faster) > _TRIES:
        rejected.append(f"{rung}: {len(faster) - _TRIES} slower cells were not run again")
    return None


def left_out(declared_law: bool, reason: str) -> str:
    """Why a rung at large strain has no cell: asked for, or `reason` kept it from being solved."""
    if declared_law:
        return "left out: --declared-law evaluates the linear law only"
    return f"left out: large strain was not solved ({reason})"


def _climbed(
    trade: Trade, rung: Rung, rows: Sequence[TradeRow], want: Wanted, by: str, unsolved: str
) -> Climbed:
    dynamic = trade.trial.dynamic
    mine = [r for r in rows if r.solver.rung == rung]
    scored = [r for r in mine if error_of(r, by) is not None]
    if not scored:
        if by == "error" and any(s.rung == rung and s.law != "linear" for s in trade.trial.solvers):
            why = unsolved
        elif mine:
            why = f"all {len(mine)} cells failed, the first: {mine[0].failed}"
        elif dynamic:
            why = "not for this scene: it needs a plate as drive, a cavity or a touching probe"
        else:
            why = (
                "not for this scene: it declares no density, or has fluid in cavities, which "
                "linear schemes with inertia do not support"
            )
        return Climbed(rung, len(mine), 0, None, "nothing ran", why)
    if all(r.solver.lacks for r in scored):
        best = min(scored, key=lambda r: max(misses(r, want, by, dynamic)))
        words = f"{evidence(trade, best, by)}; never chosen: it leaves out {best.solver.lacks}"
        return Climbed(rung, len(mine), len(scored), best, "not the scene", words)
    good = meeting(scored, want, by, dynamic)
    best = good[0] if good else nearest(scored, want, by, dynamic)
    wrong, late = misses(best, want, by, dynamic)
    verdict: Meets = "meets both"
    if wrong > 1 or late > 1:
        verdict = "neither" if min(wrong, late) > 1 else "too wrong" if wrong > 1 else "too slow"
    words = f"{evidence(trade, best, by)}; {len(good)} of its cells meet both"
    return Climbed(rung, len(mine), len(scored), best, verdict, words)


def _bounded(climbed: Climbed, excluded: Sequence[Excluded]) -> Climbed:
    """The rung with what bounds leave out of it."""
    mine = [e for e in excluded if e.rung == climbed.rung]
    if not mine:
        return climbed
    least = min(mine, key=lambda e: e.bound)
    words = (
        f"{len(mine)} candidates are left out: at least {1e6 * least.bound:.3g} us a step, more "
        f"than {1e6 * least.pick:.3g} us of the pick"
    )
    if not climbed.run:
        return replace(climbed, verdict="excluded", evidence=words)
    return replace(climbed, evidence=f"{climbed.evidence}; {words}")


def evidence(trade: Trade, row: TradeRow, by: str) -> str:
    """Return the best result of a candidate method, and the parts of its error."""
    error, time = error_of(row, by) or 0.0, row.time_s or np.nan
    words = f"{row.label}: {trade.shown(error)} at {1 / time:.3g} Hz"
    if row.solver_error is not None and row.mesh_error is not None:
        mesh, solver = trade.shown(row.mesh_error), trade.shown(row.solver_error)
        words += f" (mesh {mesh}, solver {solver})"
    return words
