"""Identification of an experiment's parameters: starts and profiles in parallel, its report.

from validate.study.identify.study import identification
found = identification("silicone_beam", wanted=("material.E=1e5:1e6",))
for one in found.calibrated:
    print(one.found.estimates)
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Chart, Exhibit, Heat, NumberTable, Series, TableCell
from validate.engine.cell import C, Plan, R, Where
from validate.engine.execution import CELLS, Finished, Kept, Report, finish
from validate.engine.pool import Pool
from validate.engine.store import key_of
from validate.errors import ComparisonError, UsageError
from validate.identify.identification import Identification, Profiled, identify
from validate.identify.least_squares import RISE, Fit, Side, Space, fit, side
from validate.identify.scaled_curve import linear_fit
from validate.numbers import scale, shown_unit
from validate.parameters import describe, with_values
from validate.pipeline.calibration.calibrated import (
    Identify,
    headline,
    helping,
    identified,
    lines,
    not_identified,
    open_free,
    problem_of,
)
from validate.pipeline.calibration.calibration import Calibrates, Calibration, Free
from validate.pipeline.calibration.problem import Calibrated, Problem, with_free
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import find
from validate.pipeline.experiment.options import Options, all_methods, configure
from validate.pipeline.experiment.origins import opened
from validate.pipeline.run.job import Job, file_sha256, study_folder
from validate.report.stored.json_values import members
from validate.report.views.view_filling import Shown, sized, table
from validate.study.study_page import Findings

FreeOf = tuple[tuple[Free, ...], ...]  # of every calibration


def asked(
    experiment: Experiment, parameters: Any, wanted: Sequence[str] = ()
) -> tuple[Experiment, FreeOf]:
    """Return the experiment with its calibrations, and what is free of each.

    Nothing wanted: what stands open, or all that is declared where nothing does. What is not
    declared needs bounds, and is identified with the first calibration; an experiment without one
    is calibrated by its first accepted method, on all that it judges. Raises `UsageError`.
    """
    if not wanted:
        free = open_free(experiment, parameters)
        if not any(free):
            free = tuple(c.free for c in experiment.calibrations)
        if not any(free):
            raise UsageError(
                f"{experiment.name} declares no calibration; name parameters with their bounds: "
                "--parameters PATH=LOW:HIGH"
            )
        return experiment, free
    named = [_parsed(experiment, parameters, text) for text in wanted]
    twice = [f.path for i, f in enumerate(named) if f.path in [g.path for g in named[:i]]]
    if twice:
        raise UsageError(f"--parameters: {twice[0]} is given twice; give it once")
    experiment = experiment if experiment.calibrations else _on_all(experiment, tuple(named))
    # Every parameter to the calibration that declares it, the rest to the first one used
    own = [[f for f in named if f.path in c.paths] for c in experiment.calibrations]
    foreign = [f for f in named if not any(f in mine for mine in own)]
    first = next((i for i, mine in enumerate(own) if mine), 0)
    own[first] += foreign
    still = open_free(experiment, parameters)
    return experiment, tuple(
        (*mine, *(f for f in left if f.path not in {m.path for m in mine})) if mine else ()
        for mine, left in zip(own, still, strict=True)
    )


def _parsed(experiment: Experiment, parameters: Any, text: str) -> Free:
    path, sign, bounds = (part.strip() for part in text.partition("="))
    if path.startswith("methods."):
        raise UsageError(
            f"--parameters {path}: a setting of a method cannot be identified; give a parameter "
            f"of the experiment, see `validate list {experiment.name}`"
        )
    declared = {f.path: f for c in experiment.calibrations for f in c.free}
    if not sign:
        with_values(parameters, {path: "0"} if path not in declared else {})
        if path not in declared:
            known = f"declared: {', '.join(declared)}; or " if declared else ""
            raise UsageError(
                f"--parameters {path}: no bounds; {known}give them: --parameters {path}=LOW:HIGH"
            )
        return declared[path]
    low, colon, high = bounds.partition(":")
    if not (colon and low and high):
        raise UsageError(f"--parameters {text}: expected {path}=LOW:HIGH")
    ends = [_number(parameters, path, end) for end in (low, high)]
    known_free = declared.get(path)
    helps = known_free.helps if known_free else ""
    return Free(path, ends[0], ends[1], "asked for", helps)


def _number(parameters: Any, path: str, text: str) -> float:
    """In SI, as --set takes it."""
    found = {p.path: p.default for p in describe(with_values(parameters, {path: text}))}[path]
    if isinstance(found, bool) or not isinstance(found, float):
        raise UsageError(f"--parameters {path}: not a number that can be varied")
    return found


def _on_all(experiment: Experiment, free: tuple[Free, ...]) -> Experiment:
    names = tuple(
        name for a in experiment.accept
        for name in ([f"{a.quantity}@{load}" for load in a.loads] or [a.quantity])
    )  # fmt: skip
    method = next(iter(experiment.accepted), next(iter(experiment.methods)))
    if not names:
        raise UsageError(
            f"{experiment.name} has no accepted methods: declare a calibration in its file"
        )
    every = Calibration(method, free, (Calibrates(names, name="all checked quantities"),))
    return replace(experiment, calibrations=(every,))


Known = tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class Of:
    """Which problem: the number of a calibration, what is `wanted` as the user asks, and what
    calibrations before it found."""

    number: int
    wanted: tuple[str, ...]
    known: Known


@dataclass(frozen=True)
class StartCell:
    """A fit from coordinates `start` (p,)."""

    of: Of
    start: tuple[float, ...]
    label: str
    key: str = ""
    timed: bool = False


@dataclass(frozen=True)
class LinearCell:
    """The closed form of a parameter that the residual may be linear in."""

    of: Of
    label: str
    key: str = ""
    timed: bool = False


@dataclass(frozen=True)
class SideCell:
    """One side of a parameter's profile about the best fit."""

    of: Of
    best: Fit
    parameter: int
    sign: int
    scale: float
    label: str
    key: str = ""
    timed: bool = False


class IdentifyBench:
    """An experiment as its recordings have it, and the problems that were asked for."""

    def __init__(self, experiment: Experiment, options: Options) -> None:
        parameters, _ = configure(experiment, options)
        found = opened(experiment, parameters)
        self.parameters, self.recordings = found.parameters, found.recordings
        self.experiment: Experiment = experiment.follows(
            experiment, found.recordings, found.parameters
        )
        self.methods = all_methods(experiment, options)
        self._problems: Kept[Problem] = Kept(8)

    def problem(self, of: Of) -> Problem:
        """Raise what loading the recordings that calibrate does."""
        return self._problems.get(of, lambda: self._problem(of))

    def _problem(self, of: Of) -> Problem:
        parameters: Any = with_free(self.parameters, dict(of.known))
        experiment, free = asked(self.experiment, self.parameters, of.wanted)
        return problem_of(
            experiment, of.number, free[of.number], parameters, self.methods, self.recordings
        )


def open_bench(job: Job) -> IdentifyBench:
    return IdentifyBench(job.experiment(), Options(dict(job.values), (), job.quick))


def run_linear(bench: IdentifyBench, cell: LinearCell) -> Fit:
    problem = bench.problem(cell.of)
    return linear_fit(problem.residual, problem.space)


def run_start(bench: IdentifyBench, cell: StartCell) -> Fit:
    return fit(bench.problem(cell.of).residual, np.array(cell.start))


def run_side(bench: IdentifyBench, cell: SideCell) -> Side:
    residual = bench.problem(cell.of).residual
    return side(residual, cell.best, cell.parameter, cell.sign, cell.scale)


KIND = "identify"
STARTS, QUICK_STARTS = 10, 4
STARTS_OF_ONE = 5  # of a single parameter: every fifth of its range has one
SEED = 1


@dataclass(frozen=True)
class IdentifyStudy:
    """Every calibration that was asked for; `done` counts its cells, `failed` says why methods
    that are calibrated each by itself could not be."""

    experiment: Experiment
    calibrated: tuple[Calibrated, ...]
    done: Finished[Any]
    quick: bool
    failed: Mapping[str, str] = field(default_factory=dict)

    @property
    def identified(self) -> bool:
        return not self.failed and all(
            e.identified for c in self.calibrated for e in c.found.estimates
        )


class InCells:
    """Evaluates fits and profiles as the cells of a study; counts them. `after`: so many runs will
    follow."""

    def __init__(
        self, experiment: Experiment, options: Options, wanted: Sequence[str], starts: int | None,
        out: Path | None, where: Where | Pool | None, report: Report | None, after: int = 0,
    ) -> None:  # fmt: skip
        self._path, self._options = Path(str(experiment.path)), options
        self._wanted, self._starts = tuple(wanted), starts
        self._folder = study_folder(experiment, KIND, out) / CELLS
        self._where, self._report, self._after = where, report, after
        self._known: Known = ()
        self.done: Finished[Any] = Finished({}, 0, 0.0, "")

    def __call__(self, number: int, problem: Problem) -> Identification:
        """As `validate.pipeline.calibration.calibrated.Identify`."""
        of = Of(number, self._wanted, self._known)
        alone = len(problem.space.ranges) == 1
        usual = STARTS_OF_ONE if alone else STARTS
        usual = QUICK_STARTS if self._options.quick else usual
        starts = usual if self._starts is None else self._starts
        found = identify(problem.space, _Cells(self, of, problem), starts, SEED)
        values = {e.name: e.value for e in found.estimates}
        self._known = (*self._known, *values.items())
        return found

    def job(self, problem: Problem) -> Job:
        hashes = tuple(r.source.sha256 for part in problem.parts for r in part.recordings)
        values = tuple(sorted(self._options.values.items()))
        return Job(str(self._path), file_sha256(self._path), hashes, values, self._options.quick)

    def finished(self, plan: Plan[C, R]) -> list[R]:
        """Return the cells' values in order."""
        found = finish(
            replace(plan, shares=True, after=self._after), self._folder, self._where, self._report
        )
        new = {k: r for k, r in found.records.items() if k not in self.done.records}
        reused = max(0, found.reused - (len(found.records) - len(new)))
        own: Finished[Any] = Finished(new, reused, found.seconds, found.workers)
        self.done = own.and_also(self.done) if new else self.done.and_also(own)
        return [_value(found, cell) for cell in plan.cells]


def _value(found: Finished[R], cell: Any) -> R:
    record = found.records[cell.key]
    if record.value is None:
        raise ComparisonError(f"{cell.label}: {record.why}")
    return record.value


class _Cells:
    """The fits and sides of one problem."""

    def __init__(self, owner: InCells, of: Of, problem: Problem) -> None:
        self._owner, self._of = owner, of
        self._names, self._job = problem.space.names, owner.job(problem)

    def linear(self, space: Space) -> Fit:
        cell = _keyed(self._job, LinearCell(self._of, f"closed form of {self._names[0]}"))
        plan = Plan(self._job, (cell,), open_bench, run_linear, Fit)
        return self._owner.finished(plan)[0]

    def fits(self, starts: Floats) -> Sequence[Fit]:
        method = f"start {{}} of {len(starts)}, {', '.join(self._names)}"
        cells = tuple(
            _keyed(self._job, StartCell(self._of, tuple(x.tolist()), method.format(i + 1)))
            for i, x in enumerate(starts)
        )
        return self._owner.finished(Plan(self._job, cells, open_bench, run_start, Fit))

    def sides(self, best: Fit, wanted: Sequence[tuple[int, int]], scale: float) -> Sequence[Side]:
        cells = []
        for i, sign in wanted:
            label = f"profile of {self._names[i]}, {'upwards' if sign > 0 else 'downwards'}"
            cells.append(_keyed(self._job, SideCell(self._of, best, i, sign, scale, label)))
        return self._owner.finished(Plan(self._job, tuple(cells), open_bench, run_side, Side))


def _keyed(job: Job, cell: Any) -> Any:
    return replace(cell, key=key_of(job, replace(cell, label="")))


def beside(
    experiment: Experiment,
    options: Options,
    out: Path | None = None,
    report: Report | None = None,
    where: Where | Pool | None = None,
) -> Identify:
    """For the pipeline: what stands open, by the cells that `validate identify` keeps."""
    return InCells(experiment, options, (), None, out, where, report, after=len(experiment.methods))


def identification(
    experiment: str | Experiment,
    values: Mapping[str, str] | None = None,
    wanted: Sequence[str] = (),
    *,
    starts: int | None = None,
    quick: bool = False,
    out: Path | None = None,
    where: Where | None = None,
    report: Report | None = None,
) -> IdentifyStudy:
    """Run what is not finished yet in `out`/<name>/study-identify/cells.

    Raises children of `ValidateError` for bad input, and where no start converges.
    """
    found = find(experiment, Path.cwd()) if isinstance(experiment, str) else experiment
    options = Options(dict(values or {}), (), quick)
    bench = IdentifyBench(found, options)
    cells = InCells(found, options, wanted, starts, out, where, report)
    calibrating, free = asked(bench.experiment, bench.parameters, wanted)
    done, failed = identified(
        calibrating, bench.parameters, bench.methods, bench.recordings, cells, free
    )
    return IdentifyStudy(calibrating, done, cells.done, quick, failed)


# --- report of an identification -----------------------------------------------------------------

_STRAIGHT = 25  # points of a profile as drawn


def exhibits(study: IdentifyStudy) -> tuple[Exhibit, ...]:
    pairs = [(c, e) for c in study.calibrated for e in c.found.estimates]
    columns: Mapping[str, Shown] = {
        "parameter": "1.name", "value": sized("1.value", _unit),
        "unit": lambda pair: shown_unit(_unit(pair)) or "1", "95 % from": sized("1.low", _unit),
        "95 % to": sized("1.high", _unit), "sd": sized("1.sd", _unit), "found on": "0.on",
        "verdict": _verdict,
    }  # fmt: skip
    found = table(
        "parameters", "Identified parameters", pairs, columns, below="verdict",
        note="95 %: the interval in which chi-square rises by less than 3.84, with all other "
             "parameters fitted again.",
    )  # fmt: skip
    words = tuple(line for c in study.calibrated for line in lines(c))
    return (
        Exhibit("identified", "Identified parameters", words, (found,)),
        *map(_of, study.calibrated),
    )


def units(one: Calibrated) -> dict[str, str]:
    """SI units by path."""
    return {p.path: p.unit for p in describe(one.problem.parts[0].parameters)}


def verdict(e: Profiled) -> str:
    return "identified" if e.identified else f"not identifiable: {'; '.join(e.findings)}"


def _unit(pair: tuple[Calibrated, Profiled]) -> str:
    return units(pair[0])[pair[1].name]


def _verdict(pair: tuple[Calibrated, Profiled]) -> TableCell:
    one, e = pair
    free = next(f for f in one.problem.free if f.path == e.name)
    said = verdict(e) if e.identified else f"{verdict(e)}; {helping(free)} would identify it"
    return TableCell(said, emphasis="good" if e.identified else "bad")


def _of(one: Calibrated) -> Exhibit:
    method = one.problem.calibration.method
    charts = tuple(_profile(one, e) for e in one.found.estimates)
    words = (
        "Rise of chi-square when one parameter is changed and the others are fitted again. "
        "Points are computed; the line joins them.",
    )
    found = one.found
    named = zip(found.space.names, _si(one), strict=True)
    head = ("start", "chi-square / 1", *(f"{n} / {shown_unit(u) or '1'}" for n, u in named),
            "evaluations", "ended")  # fmt: skip
    rows = tuple(
        (i + 1, f.chi_square if f.count else None,
         *(scale(u) * found.space.value(k, float(f.x[k])) for k, u in enumerate(_si(one))),
         f.evaluations, "converged" if f.converged else f"did not: {f.why}")
        for i, f in enumerate(found.fits)
    )  # fmt: skip
    heats = (
        Heat(f"correlations_{method}", "Correlations of the estimates", "parameter", "parameter",
             found.space.names, found.space.names, found.correlations, "correlation / 1", 0.0),
    ) if len(found.space.names) > 1 else ()  # fmt: skip
    starts = NumberTable(
        f"starts_{method}", "Result of every start", head, rows, below="ended", folded=True
    )
    return Exhibit(
        f"profiles_{method}", f"Profiles, {method}", words, (starts,), charts,
        heats=heats,
    )  # fmt: skip


def _profile(one: Calibrated, e: Profiled) -> Chart:
    unit = units(one)[e.name]
    x, y = scale(unit) * np.array(e.at), np.array(e.rise)
    label = f"{e.name} / {shown_unit(unit) or '1'}"
    # Squares of straight lines through the signed roots, which are nearly straight
    best = int(np.argmin(y))
    roots = np.sqrt(np.maximum(y, 0)) * np.where(np.arange(len(y)) < best, -1, 1)
    fine = np.unique(np.concatenate([x, np.linspace(x[0], x[-1], _STRAIGHT)]))
    line = Series("through them", fine, np.interp(fine, x, roots) ** 2)
    points = Series("computed", x, y, "points")
    method = one.problem.calibration.method
    return Chart(
        f"profile_{method}_{e.name.replace('.', '_')}", f"{e.name}: profile", label,
        "rise of chi-square / 1", (line, points), (("95 %", RISE),), caption=f"{verdict(e)}.",
    )  # fmt: skip


def _si(one: Calibrated) -> list[str]:
    return [units(one)[n] for n in one.found.space.names]


def told(study: IdentifyStudy) -> Findings:
    band = (
        ("good", "Identified")
        if study.identified
        else ("open", "Some parameters are not identifiable")
    )
    rows = [
        (c.problem.calibration.method, e.name, units(c)[e.name], at, rise)
        for c in study.calibrated
        for e in c.found.estimates
        for at, rise in zip(e.at, e.rise, strict=True)
    ]
    head = ("method", "parameter", "unit", "value", "rise_of_chi_square")
    cells = NumberTable("cells", "Every point of every profile, SI.", head, tuple(rows))
    return Findings(
        f"Identification: {study.experiment.title}", sentence(study), exhibits(study),
        document(study), cells, study.quick,
        parameters=describe(study.calibrated[0].problem.parts[0].parameters), band=band,
    )  # fmt: skip


def sentence(study: IdentifyStudy) -> str:
    """Fitted on what, and what is not identifiable from it."""
    quick = " (quick: fewer starts)" if study.quick else ""
    fitted = "; ".join(headline(c) for c in study.calibrated)
    return f"{fitted}{quick}. {' '.join(f'{line}.' for line in unidentified(study))}".strip()


def unidentified(study: IdentifyStudy) -> list[str]:
    """Return a line for each parameter that its recordings do not identify, and each method that
    has no answer to them."""
    return [f"{name} could not be fitted: {why}" for name, why in study.failed.items()] + [
        not_identified(c, e, free)
        for c in study.calibrated
        for e, free in zip(c.found.estimates, c.problem.free, strict=True)
        if not e.identified
    ]


def document(study: IdentifyStudy) -> dict[str, Any]:
    """Return the study's own part of results.json: SI, nothing that is not finite."""
    return {
        "kind": "identify",
        "identified": study.identified,
        **members(study.done, "reused", "seconds", "workers"),
        "calibrations": [_calibration(c) for c in study.calibrated],
        "failed": dict(study.failed),
    }


def _calibration(one: Calibrated) -> dict[str, Any]:
    found, known = one.found, units(one)
    bounds = {f.path: f for f in one.problem.free}
    return {
        "method": one.problem.calibration.method,
        "on": [
            {"quantities": list(p.on.quantities), "recordings": [r.name for r in p.recordings],
             "sha256": [r.source.sha256 for r in p.recordings]}
            for p in one.problem.parts
        ],
        "chi_square": found.best.chi_square,
        "count": found.best.count,
        "misfit": found.misfit,
        "parameters": [
            {**asdict(e), "unit": known[e.name], "identified": e.identified,
             "bounds": [bounds[e.name].low, bounds[e.name].high],
             "source": bounds[e.name].source, "helps": bounds[e.name].helps}
            for e in found.estimates
        ],
        "correlations": found.correlations.tolist(),
        "starts": [
            {"chi_square": f.chi_square if f.count else None,
             "values": list(found.space.values(f.x)), "evaluations": f.evaluations,
             "converged": f.converged, "why": f.why}
            for f in found.fits
        ],
    }  # fmt: skip
