"""Trade-off study: every solver x element x mesh x step of an experiment's ladder.

The error is taken apart: what is left with a solver that makes none on that mesh is the mesh's, the
rest is the solver's; what the declared law costs is a pair of runs at large strain.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Literal

from validate.arrays import Floats, rms
from validate.compare.convergence import Richardson, richardson
from validate.engine.cell import Plan, Record, Where
from validate.engine.execution import CELLS, Finished, Report, finish
from validate.errors import ComparisonError
from validate.fem.locking import locking_notes
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import find
from validate.pipeline.ladder.default import trial_of
from validate.pipeline.ladder.ladder import Rival, Trial
from validate.pipeline.run.job import Job, job_of, study_folder
from validate.solve.types import StepTimes
from validate.study.filters.ranking import dominator
from validate.study.tradeoff.cell import (
    AGAIN_S,
    Measured,
    Part,
    Stride,
    TradeCell,
    keyed,
    open_trial,
    run_cell,
    with_simulators,
)

KIND = "tradeoff"
ErrorUnit = Literal["m", "N", "Pa"]
ERRORS: Mapping[ErrorUnit, str] = MappingProxyType(
    {
        "m": "root mean square over frames and points of |u - u_reference|; displacements are "
        "read at the same points of the body on every mesh",
        "N": "root mean square over frames and drives of the force minus that of the reference",
        "Pa": "root mean square over frames and cavities of the pressure minus that of the "
        "reference",
    }
)
_SHOWN: Mapping[ErrorUnit, tuple[float, str]] = MappingProxyType(
    {"m": (1e3, "mm"), "N": (1.0, "N"), "Pa": (1.0, "Pa")}
)
Answers = Mapping[tuple[str, int], Floats]  # by element and level, as `Trade.reference`


@dataclass(frozen=True)
class TradeRow:
    """One solver on one mesh with one step dt s, measured. Errors in the trade's unit, None where
    `failed` says why, or where what they are taken from failed.

    `error` is against the reference of its own law, `total` against the one at large strain;
    `mesh_error` is that of `Trial.best` on this mesh, `solver_error` the distance from it.
    `setup_s` is that of the solver's first dt on this mesh; see `Stride` for the other costs.
    """

    solver: Rival
    element: str
    level: int
    dt: float
    unknowns: int = 0
    setup_s: float = 0.0
    step: StepTimes | None = None
    field_s: float = 0.0
    memory: int = 0
    assembled: str = ""
    error: float | None = None
    total: float | None = None
    mesh_error: float | None = None
    solver_error: float | None = None
    failed: str = ""

    @property
    def own_dt(self) -> float | None:
        """The step s; None of a solver without a step of its own."""
        return self.dt if self.solver.stepped else None

    @property
    def time_s(self) -> float | None:
        """Median seconds of a step with the displacements of all nodes."""
        return None if self.step is None else self.step.p50 + self.field_s

    @property
    def rate_hz(self) -> float | None:
        """Steps a second, with these displacements."""
        return None if self.time_s is None else 1 / self.time_s

    @property
    def deadline_s(self) -> float | None:
        """Seconds that a tick must have: the median, of an uneven solver the slow hundredth."""
        if self.step is None or not self.solver.uneven:
            return self.time_s
        return self.step.p99 + self.field_s

    @property
    def label(self) -> str:
        return f"{self.solver.name}, {self.element} mesh {self.level}"


@dataclass(frozen=True)
class Refinement:
    """Convergence of one element over its meshes, or of one solver over its steps."""

    what: str
    sizes: tuple[float, ...]
    unit: str
    found: Richardson


@dataclass(frozen=True)
class ParetoFront:
    """Cells that nothing beats by `by`, fastest first; the beaten ones' beaters; methods off it."""

    by: str
    rows: tuple[TradeRow, ...]
    beaten: tuple[tuple[TradeRow, TradeRow], ...]

    @property
    def dominated(self) -> tuple[str, ...]:
        """Solvers that are nowhere on the front."""
        on = {r.solver.name for r in self.rows}
        off = dict.fromkeys(r.solver.name for r, _ in self.beaten)
        return tuple(name for name in off if name not in on)


@dataclass(frozen=True)
class Trade:
    """All rows and convergences; `reference` (no, p, d) is the answer, `gap` its law's share
    (None: the pair of laws gave none, for the reason `law_words`). All errors are in `unit`: m for
    displacements at points, N for the forces of what drives the scene, Pa for its cavities.

    `floor` is the reference's own error (Richardson; 0: only one mesh of its element): smaller
    errors than it are all the same.
    """

    experiment: Experiment
    trial: Trial
    rows: tuple[TradeRow, ...]
    refinements: tuple[Refinement, ...]
    answers: Answers
    gap: Floats | None
    law_words: str
    done: Finished[Measured]
    quick: bool = False
    unit: ErrorUnit = "m"

    @property
    def scale(self) -> float:
        """Shown units in one SI unit of an error."""
        return _SHOWN[self.unit][0]

    @property
    def shown_unit(self) -> str:
        """The unit that errors are shown in."""
        return _SHOWN[self.unit][1]

    def shown(self, error: float, digits: int = 3) -> str:
        """Return an error as text with its unit."""
        return f"{self.scale * error:.{digits}g} {self.shown_unit}"

    @property
    def reference(self) -> Floats:
        return self.answers[self.trial.reference]

    @property
    def floor(self) -> float:
        own = f"meshes of {self.trial.reference[0]}"
        return next((x.found.error for x in self.refinements if x.what == own), 0.0)

    @property
    def moved(self) -> float:
        """Rms of the reference."""
        return rms(self.reference)

    @property
    def law_error(self) -> float | None:
        """Rms of what large strain changes."""
        return None if self.gap is None else rms(self.gap)

    @property
    def locking(self) -> tuple[str, ...]:
        """Which elements lock on their coarsest mesh, and how to see it."""
        trial = self.trial
        return locking_notes(
            (element, trial.build(element, levels[0], "linear"))
            for element, levels in trial.meshes.items()
        )

    def front(self, by: str = "error") -> ParetoFront:
        """Return the Pareto front of `by` ("error" or "total") against time per step."""
        return front(self.rows, by, self.floor)


def front(rows: tuple[TradeRow, ...], by: str, floor: float = 0.0) -> ParetoFront:
    """See `Trade.front`; rows without this error or a time are left out, errors below `floor`
    count as equal."""
    good = [r for r in rows if getattr(r, by) is not None and r.time_s is not None]
    if by == "error":  # one law, one reference
        good = [r for r in good if r.solver.law == "linear"]
    errors = [max(float(getattr(r, by)), floor) for r in good]
    times = [float(r.time_s or 0.0) for r in good]
    by_whom = [dominator(i, errors, times) for i in range(len(good))]
    free = [r for r, j in zip(good, by_whom, strict=True) if j is None]
    beaten = tuple((r, good[j]) for r, j in zip(good, by_whom, strict=True) if j is not None)
    return ParetoFront(by, tuple(sorted(free, key=lambda r: r.time_s or 0.0)), beaten)


# --- which cells ----------------------------------------------------------------------------------


def trade_cells(trial: Trial, job: Job) -> tuple[TradeCell, ...]:
    """Return the answers that errors are taken from, then every solver on every mesh it takes."""
    shortest = trial.steps[-1:]
    meshes = [(e, n) for e, levels in trial.meshes.items() for n in levels]
    found = [
        TradeCell("best", *mesh, shortest) for mesh in dict.fromkeys([trial.reference, *meshes])
    ]
    if (p := trial.pair) is not None:
        parts: tuple[Part, Part] = ("declared", "large")
        found += [TradeCell(part, p.element, p.level, (p.dt,)) for part in parts]
    for element, level in meshes:
        for solver in trial.solvers:
            if steps := solver.steps(element, level, trial.steps):
                found.append(TradeCell("solver", element, level, steps, solver.name))
    return tuple(keyed(job, c) for c in found)


def trade(
    experiment: str | Experiment,
    *,
    quick: bool = False,
    simulators: tuple[str, ...] = (),
    out: Path | None = None,
    where: Where | None = None,
    report: Report | None = None,
) -> Trade:
    """Run the cells that are not finished in `out`/<name>/study-tradeoff/cells.

    A cell that fails is a row with the reason; `simulators` are command lines of external
    simulators. Raises `ComparisonError` without a reference.
    """
    found = find(experiment, Path.cwd()) if isinstance(experiment, str) else experiment
    trial = with_simulators(trial_of(found, quick), simulators)
    job = replace(job_of(found, quick=quick), simulators=simulators)
    cells = trade_cells(trial, job)
    done = finish(plan_of(job, cells), study_folder(found, KIND, out) / CELLS, where, report)
    return traded(found, trial, cells, done, quick)


def plan_of(job: Job, cells: tuple[TradeCell, ...]) -> Plan[TradeCell, Measured]:
    return Plan(job, cells, open_trial, run_cell, Measured)


def again(
    trade: Trade, row: TradeRow, dt: float, out: Path | None = None, where: Where | None = None
) -> TradeRow:
    """Return the row's solver on its mesh with another step s, measured against the same
    reference."""
    job = job_of(trade.experiment, quick=trade.quick)
    bare = TradeCell("solver", row.element, row.level, (dt,), row.solver.name, AGAIN_S)
    cell = keyed(job, bare)
    folder = study_folder(trade.experiment, KIND, out) / CELLS
    record = finish(plan_of(job, (cell,)), folder, where).records[cell.key]
    return _rows(trade.trial, cell, record, trade.answers, trade.gap, trade.unit)[0]


# --- rows from records ----------------------------------------------------------------------------


def traded(
    experiment: Experiment,
    trial: Trial,
    cells: tuple[TradeCell, ...],
    done: Finished[Measured],
    quick: bool,
    unit: ErrorUnit = "m",
) -> Trade:
    """Errors in `unit`, and convergence over meshes and steps, of finished cells."""
    records = [(c, done.records[c.key]) for c in cells]
    answers = {
        (c.element, c.level): u
        for c, record in records
        if c.part == "best" and (u := _answer(record, unit)) is not None
    }
    if trial.reference not in answers:
        why = next(r.why for c, r in records if c.part == "best")
        why = why or f"the reference solver has no number in {unit}"
        raise ComparisonError(f"no reference, so nothing was compared: {why}")
    # What large strain changes, at frames and points: the pair's difference, and on what.
    gap, words = None, "the ladder has no pair of laws"
    if (pair := trial.pair) is not None:
        of_part = {c.part: r for c, r in records}
        linear, large = (_answer(of_part[part], unit) for part in ("declared", "large"))
        if linear is None or large is None:
            why = of_part["large"].why or of_part["declared"].why
            words = why or f"the pair of laws has no number in {unit}"
        else:
            gap = large - linear
            words = f"{pair.element} mesh {pair.level}, steps of {pair.dt:.3g} s"
    solved = [(c, r) for c, r in records if c.part == "solver"]
    rows = tuple(row for c, r in solved for row in _rows(trial, c, r, answers, gap, unit))
    refinements = (*_over_meshes(trial, answers), *_over_steps(trial, solved, unit))
    return Trade(experiment, trial, rows, refinements, answers, gap, words, done, quick, unit)


def _answer(record: Record[Measured], unit: ErrorUnit) -> Floats | None:
    return None if record.value is None else _found(record.value.strides[0], unit)


def _found(stride: Stride, unit: ErrorUnit) -> Floats | None:
    """What a stride found of the quantity that is judged."""
    return {"m": stride.u, "N": stride.force, "Pa": stride.pressure}[unit]


def _rows(
    trial: Trial,
    cell: TradeCell,
    record: Record[Measured],
    answers: Answers,
    gap: Floats | None,
    unit: ErrorUnit,
) -> list[TradeRow]:
    if record.value is None:
        strides = [Stride(dt, failed=record.why) for dt in cell.steps]
    else:
        strides = list(record.value.strides)
    return [_row(trial, cell, stride, answers, gap, unit) for stride in strides]


def _row(
    trial: Trial,
    cell: TradeCell,
    s: Stride,
    answers: Answers,
    gap: Floats | None,
    unit: ErrorUnit,
) -> TradeRow:
    errors: dict[str, float | None] = {}
    failed = s.failed
    if (u := _found(s, unit)) is not None:
        reference, mesh = answers[trial.reference], answers.get((cell.element, cell.level))
        total = None if gap is None else rms(u - reference - gap)
        mesh_error = None if mesh is None else rms(mesh - reference)
        errors = {"error": total, "total": total, "mesh_error": mesh_error}
        if trial.solver(cell.solver).law == "linear":
            errors["error"] = rms(u - reference)
            errors["solver_error"] = None if mesh is None else rms(u - mesh)
    elif s.u is not None:
        failed = f"the solver has no number in {unit}"
    return TradeRow(
        trial.solver(cell.solver), cell.element, cell.level, s.dt, s.unknowns, s.setup_s, s.step,
        s.field_s, s.memory, s.assembled, failed=failed, **errors,
    )  # fmt: skip


def _over_meshes(trial: Trial, answers: Answers) -> Iterator[Refinement]:
    """The reference's element first, then the others' meshes."""
    of, finest = trial.reference
    for element in sorted(trial.meshes, key=lambda e: e != of):
        known = trial.meshes[element] + ((finest,) if element == of else ())
        falling = [n for n in known[::-1] if (element, n) in answers]
        sizes = tuple(trial.size(level) for level in falling)
        if len(falling) > 1:
            found = richardson(sizes, [answers[element, n] for n in falling], trial.orders[element])
            yield Refinement(f"meshes of {element}", sizes, "m", found)


def _over_steps(
    trial: Trial, solved: list[tuple[TradeCell, Record[Measured]]], unit: ErrorUnit
) -> Iterator[Refinement]:
    """Every stepped linear solver on a middle mesh of the first element."""
    element, levels = next(iter(trial.meshes.items()))
    level = levels[(len(levels) - 1) // 2]
    for cell, record in solved:
        solver = trial.solver(cell.solver)
        linear = solver.law == "linear" and solver.stepped
        if not linear or (cell.element, cell.level) != (element, level) or record.value is None:
            continue
        answered = [(s.dt, u) for s in record.value.strides if (u := _found(s, unit)) is not None]
        rising = sorted(answered, key=lambda pair: pair[0])
        if len(rising) > 1:
            dts, us = tuple(dt for dt, _ in rising), [u for _, u in rising]
            found = richardson(dts, us, solver.order)
            yield Refinement(f"steps of {solver.name}, {element} mesh {level}", dts, "s", found)
