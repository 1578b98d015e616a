"""Coverage study: how often a perfect model is rejected, and a wrong one accepted.

from validate.study.coverage.study import coverage
found = coverage("kf_cube")
print(found.passed, [(q.stated.name, q.share.value) for q in found.quantities])
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from time import perf_counter

from validate.engine.cell import Plan, Where
from validate.engine.execution import CELLS, Finished, Report, finish
from validate.engine.store import key_of
from validate.errors import ComparisonError, UsageError
from validate.pipeline.calibration.calibrated import here
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import find
from validate.pipeline.experiment.options import Options
from validate.pipeline.run.job import job_of
from validate.pipeline.run.named_run import study_folder
from validate.study.coverage.bench import AllStated, Stated, opened_here, run_terms
from validate.study.coverage.cell import DrawBench, Draws, Given, run_draws
from validate.study.coverage.coverage_results import (
    JointShare,
    Power,
    Quantity,
    power,
    quantity,
    together,
)
from validate.study.coverage.plan import (
    BLOCK,
    CHECKS,
    DRAWS,
    QUICK_DRAWS,
    DrawCell,
    TermsCell,
    draws_of,
)
from validate.study.coverage.worlds import Study, finished, kept, place, read_worlds
from validate.study.identify.study import beside

KIND = "coverage"


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
    """Run what is not finished yet in `out`/<name>/study-coverage/cells.

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
    options = Options(dict(values or {}), (), quick)
    identify = beside(found, options, out, report, where) if found.calibrations else here
    bench, opening = opened_here(job, identify)
    opened = perf_counter() - start
    accepted = [
        m
        for m in bench.runs.experiment.accepted
        if m in bench.runs.methods and m not in bench.runs.refused
    ]
    if not accepted or not bench.runs.experiment.accept:
        raise ComparisonError(
            f"{found.name} accepts no method or no quantity: there is "
            "nothing to check; declare both"
        )
    folder = study_folder(found, KIND, out) / CELLS
    study = Study(job, folder, where, report, bench, opening, opened, draws, seed, noise)
    parts = [_of_method(study, method) for method in accepted]
    done = parts[0].done
    for part in parts[1:]:
        done = done.and_also(part.done)
    return Coverage(
        found,
        tuple(q for p in parts for q in p.quantities),
        tuple(p.together for p in parts),
        tuple(row for p in parts for row in p.power),
        tuple(k for k in parts[0].still if all(k in p.still for p in parts)),
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


def _of_method(study: Study, method: str) -> _Part:
    stated = _terms(study, method)
    z = draws_of(study.bench.runs.experiment, study.draws, study.seed)
    found = read_worlds(study, method, z)
    whole = found.whole
    given = Given(
        key_of(study.job, KIND, method, study.draws, study.seed, study.noise,
               sorted(found.moved), whole),
        method, stated, found.base, found.sides, found.moved,
        found.drawn if whole else {}, {k: found.drawn[k] for k in list(found.drawn)[:CHECKS]},
        z, study.seed, study.noise, study.opening,
    )  # fmt: skip
    done = _draws(study, given)
    records = [r.value for r in done.records.values() if r.value is not None]
    if missing := [r.why for r in done.records.values() if r.value is None]:
        raise ComparisonError(
            f"{method}: {len(missing)} of {len(done.records)} blocks of {BLOCK} draws could "
            f"not be checked: {missing[0]}"
        )
    return _Part(
        tuple(quantity(given, s, records, whole) for s in stated),
        together(given, records),
        tuple(power(given, records, found.wrong, found.mistaken)),
        found.still, found.notes, done,
    )  # fmt: skip


def _terms(study: Study, method: str) -> tuple[Stated, ...]:
    bare = TermsCell(method)
    cell = TermsCell(method, key_of(study.job, "terms", bare))
    plan = Plan(study.job, (cell,), study.opening, run_terms, AllStated)
    # Here: this process has identified already, and one cell gains nothing from a second.
    record = finished(study, plan, Where(0)).records[cell.key]
    if record.value is None:
        raise ComparisonError(record.why)
    return record.value.checks


def _draws(study: Study, given: Given) -> Finished[Draws]:
    blocks = range(0, study.draws, BLOCK)
    cells = tuple(
        DrawCell(given.method, k, min(BLOCK, study.draws - k), key_of(given.key, k)) for k in blocks
    )
    mine = study.bench.followed(given.method)
    here = partial(kept, DrawBench(given, study.bench.runs, mine))
    first = finish(
        Plan(study.job, cells[:1], here, run_draws, Draws), study.folder, Where(0), study.report
    )
    left = first.records[cells[0].key].seconds * (len(cells) - 1)
    where = place(study, left)
    opened = here if where == Where(0) else given
    rest = Plan(study.job, cells[1:], opened, run_draws, Draws)
    done = finish(rest, study.folder, where, study.report).and_also(first)
    return replace(done, records={c.key: done.records[c.key] for c in cells})  # as they are drawn
