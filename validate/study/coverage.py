"""Coverage of our own verdicts: how often a perfect model is called different, and a wrong one not.

from validate.study.coverage import coverage
found = coverage("kf_cube")
print(found.passed, [(q.stated.name, q.share.value) for q in found.quantities])
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import TypeVar

import numpy as np

from validate.errors import ComparisonError, UsageError
from validate.replay.experiment import Experiment
from validate.replay.find import find
from validate.replay.options import Report
from validate.study.coverage_bench import (
    AllStated,
    CoverageBench,
    ExactReading,
    Opening,
    Stated,
    opened_here,
    run_reading,
    run_terms,
)
from validate.study.coverage_cell import DrawBench, Draws, Given, run_draws
from validate.study.coverage_found import JointShare, Power, Quantity, power, quantity, together
from validate.study.coverage_plan import (
    BLOCK,
    BUDGET_S,
    CHECKS,
    DRAWS,
    HERE_S,
    NUMBERS,
    QUICK_DRAWS,
    WRONG,
    DrawCell,
    TermsCell,
    World,
    draws_of,
    inputs_of,
    reading_cells,
    steps_of,
    true_method,
    wrong_paths,
)
from validate.study.engine import CELLS, Finished, finish, study_folder
from validate.study.job import C, Job, Plan, R, Where, job_of
from validate.study.store import Record, key_of

KIND = "coverage"
T = TypeVar("T")


@dataclass(frozen=True)
class Coverage:
    """All that was found; `done` has every draw by key."""

    experiment: Experiment
    quantities: tuple[Quantity, ...]
    together: tuple[JointShare, ...]
    power: tuple[Power, ...]
    still: tuple[str, ...]
    notes: tuple[str, ...]
    done: Finished[Draws]
    draws: int
    noise: float
    quick: bool

    @property
    def passed(self) -> bool:
        """Whether every check holds, and so does the verdict over all of them."""
        return all(q.holds for q in self.quantities) and all(t.holds for t in self.together)


@dataclass(frozen=True)
class _Study:
    """What all parts of a study are told."""

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
        return tuple(inputs_of(self.bench.road.experiment))


def coverage(
    experiment: str | Experiment,
    *,
    draws: int | None = None,
    noise: float = 1.0,
    seed: int = 1,
    values: Mapping[str, str] | None = None,
    quick: bool = False,
    out: Path | None = None,
    where: Where | None = None,
    report: Report | None = None,
) -> Coverage:
    """Runs what is not finished yet in `out`/<name>/study-coverage/cells.

    `noise` is the real noise over the declared one: 2 asks what a standard deviation that is
    declared too small would do. Raises `UsageError` for too few draws or a noise that is none,
    `ComparisonError` where nothing is judged, and what running the experiment does.
    """
    found = find(experiment, Path.cwd()) if isinstance(experiment, str) else experiment
    draws = draws if draws is not None else QUICK_DRAWS if quick else DRAWS
    if draws < BLOCK or not 0 < noise < 1e6:
        raise UsageError(f"{draws} draws of {noise:g} times the noise: at least {BLOCK}, above 0")
    job = job_of(found, values, quick)
    start = perf_counter()
    bench, opening = opened_here(job)
    opened = perf_counter() - start
    accepted = [
        m
        for m in bench.road.experiment.accepted
        if m in bench.road.methods and m not in bench.road.refused
    ]
    if not accepted or not bench.road.experiment.accept:
        raise ComparisonError(f"{found.name} accepts no method or no quantity: nothing is judged")
    folder = study_folder(found, KIND, out) / CELLS
    study = _Study(job, folder, where, report, bench, opening, opened, draws, seed, noise)
    parts = [_of_method(study, method) for method in accepted]
    done = parts[0].done
    for part in parts[1:]:
        done = done.and_also(part.done)
    return Coverage(
        found,
        tuple(q for p in parts for q in p.quantities),
        tuple(p.together for p in parts),
        tuple(row for p in parts for row in p.power),
        tuple(dict.fromkeys(path for p in parts for path in p.still)),
        tuple(note for p in parts for note in p.notes),
        done, draws, noise, quick,
    )  # fmt: skip


@dataclass(frozen=True)
class _Part:
    """One method's share of a study."""

    quantities: tuple[Quantity, ...]
    together: JointShare
    power: tuple[Power, ...]
    still: tuple[str, ...]
    notes: tuple[str, ...]
    done: Finished[Draws]


def _of_method(study: _Study, method: str) -> _Part:
    true = true_method(study.bench.road.experiment, method)
    stated = _terms(study, method)
    z = draws_of(study.bench.road.experiment, study.draws, study.seed)
    base = _readings(study, true, (World(),))[World()]
    read = _needed(base, method)
    steps = _readings(study, true, steps_of(study.inputs), base.seconds)
    # Of a body that is moved: the judged one's mesh and registration may stand in a cache.
    each = max([base.seconds, *(r.seconds for r in steps.values())])
    whole = bool(study.inputs) and (
        each * study.draws <= BUDGET_S and read.size * study.draws <= NUMBERS
    )
    drawn = range(study.draws) if whole else range(CHECKS if study.inputs else 0)
    worlds = {k: World(tuple(zip(study.inputs, z[k].tolist(), strict=True))) for k in drawn}
    found = _readings(study, true, tuple(worlds.values()), each)
    solved = {w: _alike(r, read) for w, r in found.items()}
    several = {k: r.value for k, w in worlds.items() if (r := solved[w]).value is not None}
    paths = tuple(p.path for p in wrong_paths(study.bench.road.parameters))
    wrong = {(p, by): World(wrong=(p, by)) for p in paths for by in WRONG}
    found = _readings(study, true, tuple(wrong.values()), each)
    mistaken = {w: _alike(r, read) for w, r in found.items()}
    known = {w.label: r.value for w, r in mistaken.items() if r.value is not None}
    moved = {k: r for k, r in known.items() if _moves(r, read)}
    sides = {
        name: tuple(
            _needed(_alike(steps[World(((name, sign),))], read), method) for sign in (1.0, -1.0)
        )
        for name in study.inputs
    }
    given = Given(
        key_of(study.job, KIND, method, study.draws, study.seed, study.noise, sorted(moved), whole),
        method, stated, read, {k: (a, b) for k, (a, b) in sides.items()}, moved,
        several if whole else {}, {k: several[k] for k in list(several)[:CHECKS]},
        z, study.seed, study.noise, study.opening,
    )  # fmt: skip
    done = _draws(study, given)
    records = [r.value for r in done.records.values() if r.value is not None]
    if not records:
        why = next(r.why for r in done.records.values())
        raise ComparisonError(f"{method}: no draw could be judged: {why}")
    return _Part(
        tuple(quantity(given, s, records, whole) for s in stated),
        together(given, records),
        tuple(power(given, records, wrong, mistaken)),
        tuple(p for p in paths if _still(p, known, moved)),
        _unsolved(method, [r.why for r in solved.values() if r.value is None]),
        done,
    )


def _terms(study: _Study, method: str) -> tuple[Stated, ...]:
    bare = TermsCell(method)
    cell = TermsCell(method, key_of(study.job, "terms", bare))
    plan = Plan(study.job, (cell,), study.opening, run_terms, AllStated)
    # Here: this process has identified already, and one cell gains nothing from a second.
    record = _finished(study, plan, Where(0)).records[cell.key]
    if record.value is None:
        raise ComparisonError(record.why)
    return record.value.checks


def _readings(
    study: _Study, method: str, worlds: tuple[World, ...], seconds: float = 0.0
) -> dict[World, Record[ExactReading]]:
    """`seconds` that one takes, where that is known."""
    if not worlds:
        return {}
    cells = reading_cells(study.job, method, worlds)
    plan = Plan(study.job, cells, study.opening, run_reading, ExactReading)
    done = _finished(study, plan, _place(study, seconds * len(cells)))
    return {c.world: done.records[c.key] for c in cells}


def _place(study: _Study, seconds: float) -> Where | None:
    """This process for what takes less than starting workers, which all open the experiment."""
    asked = study.where is not None and bool(study.where.scheduler)
    return study.where if asked or seconds > HERE_S + 2 * study.opened else Where(0)


def _finished(study: _Study, plan: Plan[C, R], where: Where | None) -> Finished[R]:
    if where is not None and where.workers == 0 and not where.scheduler:
        plan = Plan(plan.job, plan.cells, partial(_kept, study.bench), plan.run, plan.kind)
    return finish(plan, study.folder, where, study.report)


def _kept(bench: T, job: Job) -> T:
    return bench


def _alike(record: Record[ExactReading], base: ExactReading) -> Record[ExactReading]:
    """Its reading at the samples of another, or why not: another body may have other samples."""
    if record.value is None:
        return record
    try:
        return replace(record, value=record.value.on(base))
    except ComparisonError as error:
        return replace(record, value=None, refused=str(error))


def _needed(record: Record[ExactReading], method: str) -> ExactReading:
    """Raises `ComparisonError` for a truth that could not be run."""
    if record.value is None:
        raise ComparisonError(f"{method}: its own truth could not be run: {record.why}")
    return record.value


def _draws(study: _Study, given: Given) -> Finished[Draws]:
    blocks = range(0, study.draws, BLOCK)
    cells = tuple(
        DrawCell(given.method, k, min(BLOCK, study.draws - k), key_of(given.key, k)) for k in blocks
    )
    mine = study.bench.followed(given.method)
    here = partial(_kept, DrawBench(given, study.bench.road, mine))
    first = finish(
        Plan(study.job, cells[:1], here, run_draws, Draws), study.folder, Where(0), study.report
    )
    left = first.records[cells[0].key].seconds * (len(cells) - 1)
    where = _place(study, left)
    opened = here if where == Where(0) else given
    rest = Plan(study.job, cells[1:], opened, run_draws, Draws)
    done = finish(rest, study.folder, where, study.report).and_also(first)
    return replace(done, records={c.key: done.records[c.key] for c in cells})  # as they are drawn


def _moves(reading: ExactReading, base: ExactReading) -> bool:
    return not all(
        np.allclose(a, b, rtol=1e-9, atol=0.0) for a, b in zip(reading.left, base.left, strict=True)
    )


def _unsolved(method: str, why: list[str]) -> tuple[str, ...]:
    """A line where drawn inputs leave the truth without a solution: those draws are linear."""
    if not why:
        return ()
    return (f"{method}: {len(why)} drawn truths have no solution, straight lines there: {why[0]}",)


def _still(path: str, known: Mapping[str, ExactReading], moved: Mapping[str, ExactReading]) -> bool:
    """Whether a parameter moves nothing that is measured."""
    labels = [World(wrong=(path, by)).label for by in WRONG]
    return any(k in known for k in labels) and not any(k in moved for k in labels)
