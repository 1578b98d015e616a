"""Exact readings of a tested method in all worlds of a coverage study, each solved once.

What is dear is solved less often: inputs and wrong parameters then act by straight lines, and the
study says so.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np

from validate.arrays import Floats
from validate.engine.cell import C, Plan, R, Record, Where
from validate.engine.execution import Finished, Report, finish
from validate.errors import ComparisonError
from validate.pipeline.run.job import Job
from validate.study.coverage.bench import CoverageBench, ExactReading, Opening, run_reading
from validate.study.coverage.plan import (
    BUDGET_S,
    CHECKS,
    FEW_CHECKS,
    HERE_S,
    NUMBERS,
    WRONG,
    World,
    inputs_of,
    reading_cells,
    steps_of,
    true_method,
    wrong_paths,
)

T = TypeVar("T")
Records = Mapping[World, Record[ExactReading]]


@dataclass(frozen=True)
class Study:
    """What all parts of a study are told; opening the experiment took `opened` s."""

    job: Job
    folder: Path
    where: Where | None
    report: Report | None
    bench: CoverageBench
    opening: Opening
    opened: float
    draws: int
    seed: int
    noise: float

    @property
    def inputs(self) -> tuple[str, ...]:
        return tuple(inputs_of(self.bench.runs.experiment))


@dataclass(frozen=True)
class Worlds:
    """Readings as judged, of each input to both sides, of draws by number (`whole`: all of them),
    and of wrong parameters by path and share: those that could be read (`mistaken`), and by label
    those that move anything. Parameters that stand `still` move nothing."""

    base: ExactReading
    sides: Mapping[str, tuple[ExactReading, ExactReading]]
    drawn: Mapping[int, ExactReading]
    whole: bool
    wrong: Mapping[tuple[str, float], World]
    mistaken: Records
    moved: Mapping[str, ExactReading]
    still: tuple[str, ...]
    notes: tuple[str, ...]


def read_worlds(study: Study, method: str, z: Floats) -> Worlds:
    """z (draws, inputs) standard uncertainties. Raises `ComparisonError` for a method whose own
    truth cannot be run."""
    true = true_method(study.bench.runs.experiment, method)
    base = _readings(study, true, (World(),))[World()]
    read = _needed(base, method)
    declared = study.bench.runs.experiment.uncertainty
    by = declared.stand_in.get(true, true) if declared else true
    truth = _Truth(study, true, by, read)
    steps = truth.in_worlds(steps_of(study.inputs), base.seconds)
    sides, instead = _sides(truth, steps)
    # Of a body that is moved: the judged one's mesh and registration may stand in a cache.
    each = max((r.seconds for r in steps.values()), default=base.seconds)
    whole = bool(study.inputs) and (
        each * study.draws <= BUDGET_S and read.size * study.draws <= NUMBERS
    )
    checks = CHECKS if each * CHECKS <= BUDGET_S else FEW_CHECKS
    count = study.draws if whole else checks if study.inputs else 0
    rows = z[:count].tolist()
    worlds = [World(tuple(zip(study.inputs, row, strict=True))) for row in rows]
    with_inputs = truth.in_worlds(tuple(worlds), each)
    solved = [with_inputs[w] for w in worlds]
    paths = tuple(p.path for p in wrong_paths(study.bench.runs.parameters))
    wrong, mistaken, lines = _mistaken(truth, paths, each)
    known = {w.label: r.value for w, r in mistaken.items() if r.value is not None}
    moved = {
        k: r
        for k, r in known.items()
        if not all(
            np.allclose(a, b, rtol=1e-9, atol=0.0) for a, b in zip(r.left, read.left, strict=True)
        )
    }
    drawn = {k: r.value for k, r in enumerate(solved) if r.value is not None}
    why = [r.why for r in solved if r.value is None]
    unsolved = why and [
        f"{method}: {len(why)} drawn truths have no solution and use straight lines: {why[0]}"
    ]
    return Worlds(
        read, sides, drawn, whole, wrong, mistaken, moved,
        tuple(p for p in paths if _still(p, known, moved)),
        (*truth.notes, *instead, *unsolved, *lines),
    )  # fmt: skip


@dataclass(frozen=True)
class _Truth:
    """A method's readings `read` as judged; `by` is the method whose differences take them to other
    worlds: itself, or what stands in for it where it is too slow."""

    study: Study
    method: str
    by: str
    read: ExactReading

    @property
    def notes(self) -> tuple[str, ...]:
        if self.by == self.method:
            return ()
        return (f"{self.method}: other truths by differences of {self.by}, its surrogate",)

    def in_worlds(self, worlds: tuple[World, ...], seconds: float) -> Records:
        """`seconds` that one takes, where that is known."""
        if self.by == self.method:
            found = _readings(self.study, self.by, worlds, seconds)
            return {w: _alike(r, self.read) for w, r in found.items()}
        first = _readings(self.study, self.by, (World(),))[World()]
        base = _needed(_alike(first, self.read), self.by)
        found = _readings(self.study, self.by, worlds, first.seconds)
        alike = {w: _alike(r, self.read) for w, r in found.items()}
        return {w: r if r.value is None else replace(r, value=self.read.plus(1.0, r.value, base))
                for w, r in alike.items()}  # fmt: skip


def _sides(
    truth: _Truth, steps: Records
) -> tuple[dict[str, tuple[ExactReading, ExactReading]], tuple[str, ...]]:
    """Each input one standard uncertainty to both sides: by the surrogate, as u_input is found,
    where the method itself has no solution; and what to say of that."""
    declared = truth.study.bench.runs.experiment.uncertainty
    bad = {w: r.why for w, r in steps.items() if r.value is None}
    if bad and declared and declared.surrogate not in ("", truth.by):
        other = replace(truth, by=declared.surrogate)
        steps = {**steps, **other.in_worlds(tuple(bad), 0.0)}
    each = {
        name: (
            _needed(steps[World(((name, 1.0),))], truth.method),
            _needed(steps[World(((name, -1.0),))], truth.method),
        )
        for name in truth.study.inputs
    }
    told = (
        f"{truth.method}: {w.label} by the surrogate's difference: {why}" for w, why in bad.items()
    )
    return each, tuple(told)


def _mistaken(
    truth: _Truth, paths: tuple[str, ...], each: float
) -> tuple[dict[tuple[str, float], World], Records, tuple[str, ...]]:
    """Every wrong parameter by every share; where that takes too long by straight lines through
    the middle one, and then says so."""
    wrong = {(p, by): World(wrong=(p, by)) for p in paths for by in WRONG}
    if each * len(wrong) <= BUDGET_S:
        return wrong, truth.in_worlds(tuple(wrong.values()), each), ()
    middle = WRONG[1]
    found = truth.in_worlds(tuple(wrong[p, middle] for p in paths), each)
    lines = {
        w: _scaled(found[wrong[p, middle]], by / middle, truth.read) for (p, by), w in wrong.items()
    }
    alone = (
        f"wrong parameters were solved at {100 * middle:g} % only, with straight lines elsewhere"
    )
    return wrong, lines, (f"{truth.method}: {alone}",)


def _scaled(record: Record[ExactReading], share: float, base: ExactReading) -> Record[ExactReading]:
    if record.value is None:
        return record
    return replace(record, value=base.plus(share, record.value, base))


def _readings(
    study: Study, method: str, worlds: tuple[World, ...], seconds: float = 0.0
) -> Records:
    if not worlds:
        return {}
    cells = reading_cells(study.job, method, worlds)
    plan = Plan(study.job, cells, study.opening, run_reading, ExactReading)
    done = finished(study, plan, place(study, seconds * len(cells)))
    return {c.world: done.records[c.key] for c in cells}


def place(study: Study, seconds: float) -> Where | None:
    """This process for what takes less than starting workers, which all open the experiment."""
    asked = study.where is not None and bool(study.where.scheduler)
    return study.where if asked or seconds > HERE_S + 2 * study.opened else Where(0)


def finished(study: Study, plan: Plan[C, R], where: Where | None) -> Finished[R]:
    """All cells of a plan; in this process on the bench that is open."""
    if where is not None and where.workers == 0 and not where.scheduler:
        plan = Plan(plan.job, plan.cells, partial(kept, study.bench), plan.run, plan.kind)
    return finish(plan, study.folder, where, study.report)


def kept(bench: T, job: Job) -> T:
    """Return the bench that is open already."""
    return bench


def _needed(record: Record[ExactReading], method: str) -> ExactReading:
    """Raises `ComparisonError` for a truth that could not be run."""
    if record.value is None:
        raise ComparisonError(f"{method}: its truth could not be run: {record.why}")
    return record.value


def _alike(record: Record[ExactReading], base: ExactReading) -> Record[ExactReading]:
    """Its reading at the samples of another, or why not: another body may have other samples."""
    if record.value is None:
        return record
    try:
        return replace(record, value=record.value.on(base))
    except ComparisonError as error:
        return replace(record, value=None, refused=str(error))


def _still(path: str, known: Mapping[str, ExactReading], moved: Mapping[str, ExactReading]) -> bool:
    """Whether a parameter moves nothing that is measured."""
    labels = [World(wrong=(path, by)).label for by in WRONG]
    return any(k in known for k in labels) and not any(k in moved for k in labels)
