"""Runs as cells of the engine: stored, in parallel on workers, resumed after an interruption.

A cell names a method, a case and the parameters as JSON; its key is the hash of all that its
numbers rest on: these, the recordings, mesh files, the code and the experiment's own files. Two
runs that differ only in which meshes are compared share the cells that both need. An external
simulator is known by the files that it is made of; one without any is run anew.
"""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from uuid import uuid4

from validate.engine.cell import Plan, Record
from validate.engine.execution import CELLS, fingerprint, finish
from validate.engine.pool import Pool
from validate.engine.store import key_of, oldest_removed
from validate.errors import SceneError
from validate.pipeline.experiment.declaration import decoded, encoded
from validate.pipeline.experiment.experiment import Experiment, ReportAdditions
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.options import (
    Options,
    configure,
    folder_of,
    mesh_files,
    with_simulators,
)
from validate.pipeline.experiment.origins import opened
from validate.pipeline.experiment.tree import Meshes
from validate.pipeline.run.job import Job, job_on
from validate.pipeline.run.method_run import NO_TRUTH, Cases, Truth
from validate.pipeline.run.runs import ExperimentRuns, RunFound, RunWanted
from validate.solve.external.program import version_of
from validate.solve.external.scheme import ExternalSimulator
from validate.solve.types import Run

MOST_BYTES = 1_000_000_000  # of the cells of an experiment: the oldest go
_AT = "parameters"  # where in an experiment a cell's parameters stand
_SMALL = 50_000_000  # bytes of the fields of a run on another mesh
_TIMED_BESIDE = 2  # runs at once, while one of them is timed


@dataclass(frozen=True)
class RunCell:
    """A run that is wanted; `parameters` are JSON. `whole`: with fields and traces; `other_mesh`:
    these too, if they are small, for a later run may have this mesh for its own. `truth`: what the
    twin did, instead."""

    case: str
    method: str
    split: int
    off: tuple[float, ...]
    parameters: str
    truth: bool
    label: str = ""
    whole: bool = False
    other_mesh: bool = False
    timed: bool = False
    key: str = ""


@dataclass(frozen=True)
class AdditionsCell:
    """Cell of the report items and rows that an experiment adds to its runs."""

    key: str
    label: str = "what the experiment adds"
    timed: bool = False


@dataclass(frozen=True)
class CellFound:
    """Result of a cell."""

    solved: RunFound | None = None
    truth: Truth | None = None


@dataclass(frozen=True)
class RunJob:
    """An experiment with what its user set, and the nominal `parameters` of the run as JSON; not
    `remakes`: on its recordings as they are, whatever was set of their twin."""

    of: Job
    parameters: str
    remakes: bool = True

    def identity(self) -> Mapping[str, str]:
        return self.of.identity()


def open_runs(job: RunJob) -> ExperimentRuns:
    """Return the runs of an experiment on a worker, with its recordings."""
    experiment = with_simulators(job.of.experiment(), job.of.simulators)
    options = Options(dict(job.of.values), (), job.of.quick, simulators=job.of.simulators)
    declared, methods = configure(experiment, options)
    recordings = opened(experiment, declared).recordings
    parameters = decoded(job.parameters, _AT, experiment)
    experiment = experiment.follows(experiment, recordings, parameters)
    runs = ExperimentRuns(experiment, methods, parameters, None, quick=False)
    runs.start(recordings, remake=job.remakes)
    return runs


def run_cell(runs: ExperimentRuns, cell: RunCell) -> CellFound:
    parameters = decoded(cell.parameters, _AT, runs.experiment)
    whole = cell.whole or cell.other_mesh
    wanted = RunWanted(cell.case, cell.method, parameters, cell.split, cell.off, whole)
    if cell.truth:
        return CellFound(truth=runs.true(wanted))
    solved = runs.solve(wanted)
    if not cell.whole and sum(run.u.nbytes for run in solved.runs) > _SMALL:
        solved = replace(solved, runs=())
    return CellFound(solved)


def make_additions(make: Callable[[], ReportAdditions], cell: AdditionsCell) -> ReportAdditions:
    return make()


def _enough(cell: RunCell, found: CellFound) -> bool:
    return not cell.whole or found.solved is None or bool(found.solved.runs)


class InStore:
    """Solves by the engine: what is in `folder` is taken from there, the rest by `pool`."""

    def __init__(self, experiment: Experiment, options: Options, folder: Path, pool: Pool) -> None:
        self._experiment, self._options = experiment, options
        self._folder, self._pool = folder / CELLS, pool
        self._records: dict[str, Record[Any]] = {}
        self._cells: dict[tuple[RunWanted, bool, bool], RunCell] = {}
        self._jobs: dict[tuple[str, bool], RunJob] = {}
        self._externals: dict[str, str] = {}
        self.reused = 0

    @property
    def words(self) -> str:
        """What was computed before, for the end of a sentence."""
        count = len(self._records)
        return f", {self.reused} of {count} computations were stored" if self.reused else ""

    def ahead(self, runs: ExperimentRuns, wanted: Sequence[RunWanted]) -> None:
        """All of it, timed runs first: they have nothing beside them but each other; then long ones
        before short ones, so that none of them is left for the end."""
        twin = runs.experiment.twin
        cases = dict.fromkeys(w.case for w in wanted if w.whole)
        first = next((name for name in runs.methods if name not in runs.refused), "")
        truths = [RunWanted(case, first, runs.parameters, whole=True) for case in cases if first]
        told = twin is not None and twin.truth is not None
        order = sorted(wanted, key=lambda w: (not w.whole, -runs.pace.cost(w)))
        cells = [self._cell(runs, w) for w in order]
        cells += [self._cell(runs, w, truth=True) for w in truths if told]
        self._finish(runs, cells)
        oldest_removed(self._folder, MOST_BYTES)

    def solved(self, runs: ExperimentRuns, wanted: RunWanted) -> RunFound:
        found = self._found(runs, self._cell(runs, wanted)).solved
        assert found is not None
        return found

    def truth(self, runs: ExperimentRuns, wanted: RunWanted) -> Truth:
        twin = runs.experiment.twin
        if twin is None or twin.truth is None:
            return NO_TRUTH
        found = self._found(runs, self._cell(runs, wanted, truth=True)).truth
        assert found is not None
        return found

    def told(
        self, runs: ExperimentRuns, cases: Cases, make: Callable[[], ReportAdditions]
    ) -> ReportAdditions:
        """Kept under all that it is made of: the code, the experiment, its parameters, recordings
        and what the runs gave, but for what they cost. Raises what making it raises."""
        job = self._job(runs)
        computed = [
            (case, name, followed.residuals, followed.truth, *map(_but_costs, followed.runs))
            for case, by_name in cases.items() for name, followed in by_name.items()
        ]  # fmt: skip
        hashes = [r.source.sha256 or fingerprint(r) for r in runs.recordings]
        key = key_of("told", dict(job.identity()), job.parameters, hashes, fingerprint(computed))
        plan = Plan(
            job, (AdditionsCell(key),), open_runs, make_additions, ReportAdditions, bench=make
        )
        found = finish(plan, self._folder, self._pool, lambda _, __, what: runs.tell(what))
        self._records |= found.records
        self.reused += found.reused
        value = found.records[key].value
        return make() if value is None else value

    def _found(self, runs: ExperimentRuns, cell: RunCell) -> CellFound:
        """Raises what the cell raised: it is then computed again, here."""
        self._finish(runs, [cell])
        record = self._records[cell.key]
        if record.value is None:
            if record.error == SceneError.__name__:
                raise SceneError(record.refused)
            return run_cell(runs, cell)
        found: CellFound = record.value
        return found

    def _finish(self, runs: ExperimentRuns, asked: Sequence[RunCell]) -> None:
        """Of these, what this run has not asked for before."""
        records = ((cell, self._records.get(cell.key)) for cell in asked)
        cells = [cell for cell, r in records
                 if r is None or not (r.value is None or _enough(cell, r.value))]  # fmt: skip
        if not cells:
            return
        wanted = {cell.key: w for (w, truth, _), cell in self._cells.items() if not truth}
        # The first of those that have a key in common, which asks for the most
        once: dict[str, RunCell] = {}
        for c in cells:
            once.setdefault(c.key, c)
        plan = Plan(
            self._job(runs), tuple(once.values()), open_runs, run_cell, CellFound,
            bench=runs, enough=_enough, shares=True, beside=_TIMED_BESIDE,
            after=max(0, runs.pace.expected - len(cells)),
        )  # fmt: skip

        def done(cell: RunCell, record: Record[CellFound]) -> None:
            if cell.key in wanted:
                runs.pace.took(wanted[cell.key], record.seconds / max(1, self._pool.busy))

        found = finish(plan, self._folder, self._pool, lambda _, __, what: runs.tell(what), done)
        self._records |= found.records
        self.reused += found.reused

    def _cell(self, runs: ExperimentRuns, wanted: RunWanted, *, truth: bool = False) -> RunCell:
        at = wanted, truth, runs.remakes
        if at not in self._cells:
            what = f"{wanted.method} on {wanted.case}" if wanted.case else wanted.method
            cell = RunCell(
                wanted.case, wanted.method, wanted.split, wanted.off,
                encoded(_compared_left_out(wanted.parameters), _AT), truth,
            )  # fmt: skip
            # What the numbers of a run rest on besides what its cell says. A recording that is no
            # file is known by its content.
            recordings, true = runs.of_case(wanted.case)
            hashes = [r.source.sha256 or fingerprint(r) for r in recordings]
            method = replace(runs.method(wanted), label="")
            if truth:  # seen in the scene of a method, whatever solves it
                method = Method(scene=method.scene)
            read = mesh_files(wanted.parameters, folder_of(self._experiment))
            external = isinstance(method.settings, ExternalSimulator)
            key = key_of(
                cell, dict(self._job(runs).identity()),
                encoded(method, f"methods.{wanted.method}"), hashes,
                encoded(_compared_left_out(true), _AT) if truth else "",
                [hashlib.sha256(f.read_bytes()).hexdigest() for f in read],
                self._external(method.settings.command) if external else "",
            )  # fmt: skip
            self._cells[at] = replace(
                cell, key=key, label="truth of the twin" if truth else what, whole=wanted.whole,
                other_mesh=_body(wanted.parameters) != _body(runs.parameters),
                timed=wanted.whole and not truth,
            )  # fmt: skip
        return self._cells[at]

    def _external(self, command: str) -> str:
        """An external simulator as it is now; one of which that cannot be said, by this run."""
        if command not in self._externals:
            self._externals[command] = version_of(command) or uuid4().hex
        return self._externals[command]

    def _job(self, runs: ExperimentRuns) -> RunJob:
        at = encoded(runs.parameters, _AT), runs.remakes
        if at not in self._jobs:
            hashes = tuple(r.source.sha256 for r in runs.recordings)
            base = job_on(self._experiment, hashes, self._options.values, self._options.quick)
            self._jobs[at] = RunJob(replace(base, simulators=self._options.simulators), *at)
        return self._jobs[at]


def _but_costs(run: Run) -> Run:
    return replace(run, setup_s=0.0, step_s=None, seconds=None, memory=0)


def _body(parameters: Any) -> Any:
    return getattr(getattr(parameters, "scene", None), "body", None)


def _compared_left_out(parameters: Any) -> Any:
    """Parameters without those that only say which meshes are compared."""
    settings = getattr(parameters, "settings", None)
    if not isinstance(getattr(settings, "mesh", None), Meshes):
        return parameters
    return parameters.with_settings(mesh=Meshes())
