"""Studies: common part of `validate study`, `validate identify` and the function `study`.

Each returns what it found and the page that it wrote; an interruption keeps finished cells.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Generic, TypeVar

from validate.engine.cell import Where
from validate.engine.execution import CELLS, Report
from validate.errors import UsageError
from validate.library.single_run import Progress, no_progress, warn_of_units
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import sources_of
from validate.pipeline.experiment.options import Options
from validate.pipeline.run.job import differences, study_folder, tag
from validate.report.stored.environment import made
from validate.report.stored.folder import locked, try_results
from validate.study.choose.facts import stored_effects
from validate.study.choose.study import Choice, Climb, choose, wanted
from validate.study.coverage import page as coverage_page
from validate.study.coverage.plan import DRAWS
from validate.study.coverage.study import Coverage, coverage
from validate.study.filters import page as filter_page
from validate.study.filters.ranking import FilterEndings, filter_endings, with_endings
from validate.study.filters.study import FilterStudy, study
from validate.study.identify import study as identify_page
from validate.study.identify.study import STARTS, IdentifyStudy, identification
from validate.study.stability import page as stability_page
from validate.study.stability.gain import GainMap, gain_map, told_gain, told_nothing
from validate.study.stability.study import Stability, stability
from validate.study.study_page import Findings, write_study
from validate.study.tradeoff import page as trade_page
from validate.study.tradeoff.study import Trade, again, trade

F = TypeVar("F")


@dataclass(frozen=True)
class StudySettings:
    """Where a study's folder lies, where its cells run, what shows its progress, and the command
    that is recorded as what made it."""

    out: Path | None = None
    quick: bool = False
    where: Where = field(default_factory=Where)
    command: tuple[str, ...] = ()
    progress: Progress = no_progress


@dataclass(frozen=True)
class Studied(Generic[F]):
    """Result of a study, and the path of its report.html."""

    found: F
    page: Path


@dataclass(frozen=True)
class StabilityFound:
    """Of schemes that step in time the map and how filters end, of a static loop its gain; None for
    what the experiment does not have."""

    map: Stability | None
    gain: GainMap | None
    endings: FilterEndings | None
    passed: bool


def filters(
    experiment: Experiment,
    settings: StudySettings,
    *,
    sweeps: Sequence[str] = (),
    seeds: str = "",
    values: Mapping[str, str] | None = None,
    methods: tuple[str, ...] = (),
    by: str = "",
    hold_out: tuple[str, ...] = (),
) -> Studied[FilterStudy]:
    """Rank filter settings; the arguments are those of `validate study filters`."""
    options = Options(dict(values or {}), methods, settings.quick)
    warn_of_units(experiment, options)
    words, content = differences(experiment, options)
    words += [text.partition("=")[0].strip() for text in sweeps]
    words += ["seeds"] * bool(seeds) + [by] * bool(by) + ["hold_out"] * bool(hold_out)
    place = f"filters{tag(words, [content, sorted(sweeps), seeds, by, hold_out])}"
    with _running(experiment, place, "filters", settings) as report:
        found = study(
            experiment, sweeps, methods=methods, values=options.values,
            seeds=seeds_of(seeds) if seeds else None, by=by, hold_out=hold_out,
            quick=settings.quick, out=settings.out, where=settings.where, report=report,
        )  # fmt: skip
    return _written(experiment, found, filter_page.findings(found), place, settings)


def stability_map(experiment: Experiment, settings: StudySettings) -> Studied[StabilityFound]:
    """Map where schemes are stable; of a static experiment the gain of its loop, if it has one."""
    place = f"stability{tag(['quick'] * settings.quick, settings.quick)}"
    out, quick, where = settings.out, settings.quick, settings.where
    with _running(experiment, place, "stability", settings) as report:
        found = stability(experiment, quick=quick, out=out, where=where, report=report)
        gain = None
        if found is None:
            gain = gain_map(experiment, out=out, where=where, report=report)
        endings = filter_endings(experiment, quick=quick, out=out, where=where, report=report)
    if found is None:
        told = told_gain(gain, quick) if gain else told_nothing(
            experiment, quick
        )  # fmt: skip
        passed = told.passed is not False
    else:
        told = stability_page.told(found)
        told = told if endings is None else with_endings(told, endings)
        passed = found.passed and not (endings and endings.bugs)
    answer = StabilityFound(found, gain, endings, passed)
    return _written(experiment, answer, told, place, settings)


def tradeoff(
    experiment: Experiment, settings: StudySettings, simulators: tuple[str, ...] = ()
) -> Studied[Trade]:
    """Measure error against time per step; `simulators` are commands of external ones."""
    words = ["quick"] * settings.quick + ["external"] * bool(simulators)
    content = [settings.quick, simulators] if simulators else settings.quick
    place = f"tradeoff{tag(words, content)}"
    with _running(experiment, place, "pilot runs", settings) as report:
        found = trade(
            experiment, quick=settings.quick, simulators=simulators, out=settings.out,
            where=settings.where, report=report,
        )  # fmt: skip
    return _written(experiment, found, trade_page.told(found), place, settings)


def choice(
    experiment: Experiment,
    settings: StudySettings,
    *,
    error: str,
    rate: str,
    declared_law: bool = False,
) -> Studied[Choice]:
    """Find the cheapest method within an `error` as "0.5mm" at a `rate` as "1000Hz"."""
    want = wanted(error, rate)
    words = ["quick"] * settings.quick + [error, rate] + ["declared_law"] * declared_law
    place = f"choose{tag(words, [settings.quick, want, declared_law])}"
    out, where = settings.out, settings.where
    with _running(experiment, place, "pilot runs", settings) as report:
        effects = stored_effects(experiment, out)
        climb = Climb(
            experiment, unit=want.unit, effects=effects, declared_law=declared_law,
            quick=settings.quick, out=out, where=where, report=report,
        )  # fmt: skip
        found = choose(
            climb, want, declared_law,
            lambda trade, row, dt: again(trade, row, dt, out, where), effects,
        )  # fmt: skip
    return _written(experiment, found, trade_page.told_choice(found), place, settings)


def coverage_of_verdicts(
    experiment: Experiment,
    settings: StudySettings,
    *,
    draws: int | None = None,
    noise: float = 1.0,
    values: Mapping[str, str] | None = None,
) -> Studied[Coverage]:
    """Measure the share of right verdicts on `draws` simulated recordings; `noise` is the ratio
    of real to declared noise."""
    options = Options(dict(values or {}), (), settings.quick)
    warn_of_units(experiment, options)
    words, content = differences(experiment, options)
    words += ["draws"] * (draws not in (None, DRAWS)) + ["noise"] * (noise != 1)
    place = f"coverage{tag(words, [content, draws, noise])}"
    with _running(experiment, place, "coverage", settings) as report:
        found = coverage(
            experiment, draws=draws, noise=noise, values=options.values, quick=settings.quick,
            out=settings.out, where=settings.where, report=report,
        )  # fmt: skip
    return _written(experiment, found, coverage_page.told(found), place, settings)


def identified(
    experiment: Experiment,
    settings: StudySettings,
    *,
    parameters: tuple[str, ...] = (),
    starts: int | None = None,
    values: Mapping[str, str] | None = None,
) -> Studied[IdentifyStudy]:
    """Identify `parameters` (none: those that are open), as "material.E=1kPa:100kPa"."""
    options = Options(dict(values or {}), (), settings.quick)
    warn_of_units(experiment, options)
    words, content = differences(experiment, options)
    words += [w.partition("=")[0] for w in parameters]
    words += ["seeds"] * (starts not in (None, STARTS))
    place = f"identify{tag(words, [content, sorted(parameters), starts])}"
    with _running(experiment, place, "identification", settings) as report:
        found = identification(
            experiment, options.values, parameters, starts=starts, quick=settings.quick,
            out=settings.out, where=settings.where, report=report,
        )  # fmt: skip
    return _written(experiment, found, identify_page.told(found), place, settings)


def seeds_of(text: str) -> int | tuple[int, ...]:
    """Return the number of seeds of "50", the seeds of "3,7,9"; raises `UsageError`."""
    try:
        numbers = tuple(int(part) for part in text.split(","))
    except ValueError:
        raise UsageError(
            f"--seeds {text}: expected a number of seeds, or seeds separated by commas"
        ) from None
    return numbers if len(numbers) > 1 else numbers[0]


@contextmanager
def _running(
    experiment: Experiment, place: str, title: str, settings: StudySettings
) -> Iterator[Report]:
    """Progress, once the place was tried; an interruption has a note that cells are kept."""
    folder = study_folder(experiment, place, settings.out)
    try:
        with locked(folder):
            try_results(folder, (CELLS,))
            with settings.progress(f"{experiment.name}: {title}") as report:
                yield report
    except KeyboardInterrupt as interrupted:
        kind = place.partition("+")[0].replace("choose", "tradeoff")  # whose cells it climbs over
        cells = study_folder(experiment, kind, settings.out) / CELLS
        kept = sum(1 for _ in cells.glob("*.json"))
        interrupted.add_note(f"{kept} finished cells are kept; the same command resumes from there")
        raise


def _written(
    experiment: Experiment, found: F, told: Findings, place: str, settings: StudySettings
) -> Studied[F]:
    by = made(settings.command, sources_of(experiment.path) if experiment.path else ())
    folder = study_folder(experiment, place, settings.out)
    return Studied(found, write_study(experiment, told, folder, by))
