"""Coverage study: how often a perfect model is rejected, and a wrong one accepted.

from validate.study.coverage.study import coverage
found = coverage("kf_cube")
print(found.passed, [(q.stated.name, q.share.value) for q in found.quantities])
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from time import perf_counter

import numpy as np

from validate.arrays import rms
from validate.compare.coverage import (
    FALSE_ACCEPTANCE,
    MEASUREMENT,
    MOST,
    Finding,
    Share,
    Term,
    find_fault,
    reach,
    term,
)
from validate.compare.verdict import OWN_COVARIANCE
from validate.engine.cell import Plan, Record, Where
from validate.engine.execution import CELLS, Finished, Report, finish
from validate.engine.store import key_of
from validate.errors import ComparisonError, UsageError
from validate.pipeline.calibration.calibrated import here
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import find
from validate.pipeline.experiment.options import Options
from validate.pipeline.run.job import job_of, study_folder
from validate.study.coverage.bench import (
    PERFECT,
    AllStated,
    DrawBench,
    Draws,
    ExactReading,
    Given,
    Judged,
    Stated,
    opened_here,
    run_draws,
    run_terms,
)
from validate.study.coverage.plan import (
    BLOCK,
    CHECKS,
    DRAWS,
    QUICK_DRAWS,
    DrawCell,
    TermsCell,
    World,
    draws_of,
)
from validate.study.coverage.worlds import Study, finished, kept, place, read_worlds
from validate.study.identify.study import beside


@dataclass(frozen=True)
class Quantity:
    """One check of a method: how often the perfect model differs, and by which term.

    `undecided`: of the perfect model's acceptance; `rejected`: not good enough though perfect.
    `false_good` and `false_bad`: answers about models whose error is the limit; None without one.

    `off` is the largest error of the linear response, in the check's unit; None: solved whole.
    """

    method: str
    stated: Stated
    share: Share
    undecided: Share
    rejected: Share
    false_good: Share | None
    false_bad: Share | None
    terms: tuple[Term, ...]
    finding: Finding
    judged: Judged
    spread: float
    u_val: float | None
    off: float | None

    @property
    def holds(self) -> bool:
        false = [s for s in (self.rejected, self.false_good, self.false_bad) if s is not None]
        return self.finding.word in ("holds", "blunt", "no evidence") and all(
            s.value <= FALSE_ACCEPTANCE for s in false
        )


@dataclass(frozen=True)
class Power:
    """How often a check (None: all together) calls a model different whose parameter is wrong;
    `why` there is no share."""

    method: str
    name: str | None
    path: str
    by: float
    share: Share | None
    why: str = ""


@dataclass(frozen=True)
class JointShare:
    """A method's verdict over all its checks, corrected for their number."""

    method: str
    share: Share
    checks: int

    @property
    def holds(self) -> bool:
        """Holm's correction keeps the share at most, not at, its level."""
        return self.share.value <= MOST


def _joined(records: Sequence[Draws], label: str, name: str) -> Judged:
    parts = [r.worlds[label][name] for r in records]
    return Judged(
        tuple(e for p in parts for e in p.E),
        tuple(u for p in parts for u in p.u_D),
        tuple(u for p in parts for u in p.u_val),
        tuple(v for p in parts for v in p.validations),
        tuple(v for p in parts for v in p.acceptances),
    )


def quantity(given: Given, stated: Stated, records: Sequence[Draws], whole: bool) -> Quantity:
    """One check over all draws; `whole`: each was solved."""
    judged = _joined(records, PERFECT, stated.name)
    n = len(judged.validations)
    share = Share(judged.validations.count("differs"), n)
    undecided, rejected = (
        Share(judged.acceptances.count(word), n) for word in ("undecided", "not good enough")
    )
    at_limit = [a for r in records for a in r.at_limit.get(stated.name, ())]
    false_good, false_bad = (
        Share(at_limit.count(word), len(at_limit)) if at_limit else None
        for word in ("good enough", "not good enough")
    )
    terms = tuple(_terms_shown(given, stated, records, judged))
    known = [u for u in judged.u_val if u is not None]
    errors = np.array([e for e in judged.E if e is not None])
    off = {k: v for r in records for k, v in r.off.items()}
    if stated.fitted:
        finding = Finding("no evidence", None, stated.fitted)
    elif None in stated.numerical.values():
        finding = Finding("no answer", None, f"nothing bounds u_num: {stated.words}")
    else:
        finding = find_fault(share, terms)
    return Quantity(
        given.method, stated, share, undecided, rejected, false_good, false_bad, terms,
        finding, judged,
        float(np.sqrt(np.mean(errors**2))) if len(errors) else 0.0,
        float(np.median(known)) if known else None,
        off.get(stated.name) if given.steps and not whole else None,
    )  # fmt: skip


def _terms_shown(
    given: Given, stated: Stated, records: Sequence[Draws], judged: Judged
) -> Iterator[Term]:
    measured = np.array([e for r in records for e in r.measured[stated.name]])
    u_D = float(np.median(judged.u_D)) if stated.measurement is None else stated.measurement
    own = rms(stated.inputs[OWN_COVARIANCE]) if OWN_COVARIANCE in stated.inputs else None
    shown = reach(measured)
    if own is None:
        yield term(MEASUREMENT, u_D, measured, "measurement")
    else:  # a filter's error and the measurement's are seen together only
        rest = float(np.sqrt(max(shown**2 - u_D**2, 0.0)))
        yield Term(MEASUREMENT, u_D, min(shown, u_D), min(shown, u_D), "measurement")
        yield Term(OWN_COVARIANCE, own, rest, rest, "filter")
    for part, u in stated.numerical.items():
        yield Term(f"u_num ({part})", u or 0.0, 0.0, 0.0, "numerical")
    alone = {k: v for r in records for k, v in r.alone.items()}
    for i, (name, by_check) in enumerate(alone.items()):
        plus, minus = (*by_check.get(stated.name, ()), 0.0, 0.0)[:2]
        z = given.z[:, i]
        errors = np.where(z > 0, z * plus, -z * minus)
        yield term(f"u_input ({name})", rms(stated.inputs.get(name, (0.0,))), errors)


def together(given: Given, records: Sequence[Draws]) -> JointShare:
    """Return the verdict over all checks of a method."""
    differing = [d for r in records for d in r.overall[PERFECT]]
    return JointShare(given.method, Share(sum(differing), len(differing)), len(given.stated))


def power(
    given: Given,
    records: Sequence[Draws],
    wrong: Mapping[tuple[str, float], World],
    mistaken: Mapping[World, Record[ExactReading]],
) -> Iterator[Power]:
    """All checks together, then each; those that are evidence."""
    names = [s.name for s in given.stated if not s.fitted]
    for (path, by), world in wrong.items():
        record = mistaken[world]
        if record.value is None:
            yield Power(given.method, None, path, by, None, record.why)
        elif world.label in given.wrong:
            all_of = [d for r in records for d in r.overall[world.label]]
            yield Power(given.method, None, path, by, Share(sum(all_of), len(all_of)))
            for name in names:
                verdicts = _joined(records, world.label, name).validations
                share = Share(verdicts.count("differs"), len(verdicts))
                yield Power(given.method, name, path, by, share)


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
