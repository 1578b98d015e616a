"""Pipeline: recording -> scene -> registration -> system -> run -> comparison.

One for every experiment, at holds or over time, with a twin's truth beside or without one.
"""

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

from validate.compare.effects import Declared
from validate.compare.exhibit import captioned
from validate.compare.force_error import track_scores
from validate.compare.published import Published
from validate.compare.residual import rest_residuals, unanswered
from validate.compare.result import Kind, MethodResult, Result
from validate.compare.score import Score, run_scores, scores_of
from validate.engine.execution import Report
from validate.errors import ComparisonError, UsageError, ValidateError
from validate.fem.locking import locking_notes
from validate.memory import MemoryShortError
from validate.parameters import Changed, Parameter, changed, describe, value_at
from validate.pipeline.calibration.calibrated import (
    Identify,
    calibrated,
    fitted_sentence,
    here,
    identified_by,
    middle,
    with_inputs,
)
from validate.pipeline.calibration.problem import Calibrated
from validate.pipeline.checks.checks import (
    checks_of,
    effects_of,
    joint_inputs,
    variants_of,
    with_uncertain_drives,
)
from validate.pipeline.checks.consistency import consistency_scores
from validate.pipeline.checks.likely_causes import (
    Difference,
    Failed,
    difference_of,
    explained_by,
)
from validate.pipeline.checks.plausibility import doubts
from validate.pipeline.checks.verdict_sentence import figures_sentence, verdict_sentence
from validate.pipeline.exhibits.standard import (
    error_at,
    external_exhibits,
    gate_warnings,
    speed_rows,
    standard_exhibits,
)
from validate.pipeline.experiment.experiment import (
    Experiment,
    Identified,
    ReportAdditions,
    SolvesVariants,
)
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.options import Options, all_methods, chosen_cases, configure
from validate.pipeline.experiment.origins import Opened, marked, opened
from validate.pipeline.run.estimate import coarser, require_room
from validate.pipeline.run.method_run import MAIN, Cases, MethodRun
from validate.pipeline.run.runs import ExperimentRuns, Solves
from validate.recording.types import Recording
from validate.register.markers.markers import MarkerObservation
from validate.scene.meshless import Meshless
from validate.solve.external.scheme import ExternalSimulator

LOG = logging.getLogger(__name__)
_AGAINST: Mapping[Kind, str] = {
    "measured": "measured recording",
    "twin": "recording of a twin",
    "same law, finer mesh": "recording of the same law on a finer mesh",
    "same model": "recording of the same model",
    "reference": "computation by third-party code",
}


def compare(
    experiment: Experiment,
    options: Options,
    report: Report | None = None,
    identify: Identify = here,
    by: Solves | None = None,
) -> Result:
    """Run an experiment and compute its verdicts; `identify` finds what its calibrations leave
    open, `by` solves its runs (none: in this process).

    Raises children of `ValidateError` for bad input.
    """
    try:
        return _compared(experiment, options, report, identify, by)
    except MemoryShortError as short:
        parameters, _ = configure(experiment, options)
        step = coarser(experiment.name, parameters, short.share)
        raise MemoryShortError(f"{short}, {step}", short.share) from short


@dataclass(frozen=True)
class PreparedRuns:
    """An experiment as its recordings have it, and its runs, of which none is solved yet.

    `differing` parameters are not as the experiment declares them; `fitted` are the calibrations
    that were carried out.
    """

    experiment: Experiment
    runs: ExperimentRuns
    found: Opened
    identified: Identified | None
    differing: tuple[Changed, ...]
    fitted: tuple[Calibrated, ...]


def set_out(
    experiment: Experiment,
    options: Options,
    report: Report | None = None,
    identify: Identify = here,
    *,
    since: float = 0.0,
    by: Solves | None = None,
) -> PreparedRuns:
    """Loads, requests memory and identifies. Raises children of `ValidateError` for bad input."""
    parameters, methods = configure(experiment, options)
    cases = chosen_cases(experiment, options)
    found = opened(experiment, parameters)
    declared = experiment.quick(experiment.parameters) if options.quick else experiment.parameters
    shipped_settings = _settings(declared, experiment.methods)
    differing = changed(shipped_settings, _settings(parameters, methods))
    experiment = _following(experiment, found, differing)
    shipped, parameters = found.recordings, found.parameters
    if report:
        report(0, 1, "requests memory")
    asked = middle(experiment, parameters)
    require_room(experiment, methods, asked, shipped[0], quick=options.quick)
    _require_measured(experiment, methods, asked, shipped[0])
    if report and (experiment.identify or experiment.calibrations):
        report(0, 1, "identifies parameters")
    every = all_methods(experiment, options)
    surrogate = experiment.uncertainty.surrogate if experiment.uncertainty else ""
    fitted, refused = calibrated(
        experiment, parameters, every, shipped, identify, wanted={*methods, surrogate} - {""},
        anyway=options.anyway,
    )  # fmt: skip
    experiment = with_inputs(experiment, fitted)
    began = since or perf_counter()

    def solves(asked: Any) -> SolvesVariants:
        runs = ExperimentRuns(
            experiment, every, asked, report, quick=options.quick, since=began, by=by
        )
        runs.start(shipped, remake=False)
        runs.expect(variants_of(runs))
        return runs.residuals

    identified = identified_by(experiment, shipped, parameters, every, fitted, solves)
    used = identified.parameters if identified else parameters
    experiment = identified.of(experiment) if identified else experiment
    if identified is None or identified.inputs is None:  # else the identification counts them
        experiment = with_uncertain_drives(experiment, methods, shipped, used)
    runs = ExperimentRuns(
        experiment, methods, used, report,
        quick=options.quick, cases=cases, calibrated=identified.calibrated if identified else (),
        since=began, refused=refused, by=by,
    )  # fmt: skip
    return PreparedRuns(experiment, runs, found, identified, differing, fitted)


def _require_measured(
    experiment: Experiment, methods: Mapping[str, Method], parameters: Any, recording: Recording
) -> None:
    """Raise `UsageError` for a filter whose markers the recording lacks, before anything is
    solved."""
    filters = {method.markers: (name, method) for name, method in methods.items() if method.markers}
    for name, method in filters.values():
        try:
            scene = experiment.build(recording, parameters, method.scene)
            seen = experiment.place(recording, parameters, scene)
        except ValidateError:  # it may need what is yet to be identified
            continue
        if not isinstance(scene, Meshless):
            try:
                method.require_measured(scene, seen)
            except ComparisonError as error:
                raise UsageError(
                    f"method '{name}' is a filter: {error}; name markers of the recording, or run "
                    "other methods with --methods"
                ) from error


def _compared(
    experiment: Experiment,
    options: Options,
    report: Report | None,
    identify: Identify,
    by: Solves | None,
) -> Result:
    out = set_out(experiment, options, report, identify, since=perf_counter(), by=by)
    experiment, runs, found, identified = out.experiment, out.runs, out.found, out.identified
    methods = runs.methods
    variants = variants_of(runs)
    runs.expect(variants)
    if experiment.accepted and not {*methods} & {*experiment.accepted}:
        LOG.warning(
            "none of the chosen methods is accepted, so no check is made and the run fails; add "
            "one of %s", ", ".join(experiment.accepted),
        )  # fmt: skip
    remade = runs.start(found.recordings)
    runs.ahead(variants)
    main = {name: runs.main(name) for name in methods}
    others = {case.name: runs.other(case) for case in runs.cases}
    told = ReportAdditions()
    if experiment.exhibits is not None and not runs.quick and runs.whole:
        told = runs.told({MAIN: main, **others})
    results = tuple(_method(runs, main[name], others) for name in methods)
    effects = effects_of(runs, results)
    because, causes = explained_by(
        results, lambda name, failed: _differences(main[name], methods[name], failed)
    )
    published = _published(runs, results, identified, told)
    first = main[next(iter(methods))]
    locking = locking_notes(
        (f.label, f.scene)
        for name, f in main.items()
        if not isinstance(methods[name].settings, ExternalSimulator)  # its elements are its own
    )
    parameters_used = marked(experiment, options, found, _settings(runs.parameters, methods))
    warnings = (
        *(identified.doubts if identified else ()),
        *doubts(parameters_used, found.stated, found.recordings, first),
        *gate_warnings({name: main[name] for name in methods if name in experiment.accepted}),
    )
    named = experiment.specimen or (lambda _: experiment.name)
    declared = experiment.uncertainty.inputs if experiment.uncertainty else ()
    headline = identified.headline if identified else ""
    return Result(
        name=experiment.name,
        title=experiment.title,
        source=experiment.source,
        sentence=("With warnings on the input; " if warnings else "")
        + (f"{headline}; " if headline and not out.fitted else "")
        + verdict_sentence(results, runs.kind, quick=options.quick)
        + because
        + (fitted_sentence(headline, results) if out.fitted else "")
        + figures_sentence(published),
        parameters=parameters_used,
        methods=results,
        recordings=runs.recordings,
        rest=rest_residuals(first.seen, first.run),
        effects=effects,
        published=published,
        identified=identified.scores if identified else (),
        notes=_notes(remade, identified, main, {n: methods[n].settings for n in main}, locking),
        locking=locking,
        warnings=warnings,
        quick=options.quick,
        kind=runs.kind,
        seed=experiment.seed,
        twin_notice="" if runs.kind == "measured" else experiment.twin_notice,
        inputs=tuple(Declared(i.name, i.doc, i.source) for i in declared),
        joint=joint_inputs(runs) if any(m.accepted for m in results) else (),
        exhibits=tuple(
            captioned(exhibit, experiment.captions)
            for exhibit in (
                *causes,
                *external_exhibits(runs, main),
                *standard_exhibits(experiment, main, others),
                *told.exhibits,
            )
        ),
        rows=(*speed_rows(experiment, main), *told.rows),
        views=experiment.views,
        changed=out.differing,
        specimens=tuple(named(recording) for recording in runs.recordings),
        expected=() if options.quick else experiment.expected,
        identified_values=identified.values if identified else (),
    )


def _differences(followed: MethodRun, method: Method, failed: Failed) -> list[Difference]:
    """Histories of the observations that a failed quantity is of."""
    handles = getattr(method.settings, "handles", None)
    inertia = handles is None or handles.inertia
    units = {o.name: tuple(o.units) for o in followed.seen.observations}
    return [
        difference_of(followed, h, inertia) for h in followed.histories
        if any(f == q or f.startswith(f"{q}.") for f in failed for q in units[h.name])
    ]  # fmt: skip


def _following(experiment: Experiment, found: Opened, differing: tuple[Changed, ...]) -> Experiment:
    """The experiment as its recordings have it; no figure belongs to what the user changed, before
    the recordings filled what stood open."""
    followed: Experiment = experiment.follows(experiment, found.recordings, found.parameters)
    if differing:  # declared verdicts are those of what is shipped
        followed = replace(followed, expected=())
    own = [f"{c.path} = {c.value}" for c in differing if c.path not in experiment.locates]
    if not own:
        return followed
    other = f"printed for this experiment's default settings; not compared with {', '.join(own)}"
    return replace(
        followed, published=tuple(replace(f, other=f.other or other) for f in followed.published)
    )


def _settings(parameters: Any, methods: Mapping[str, Method]) -> tuple[Parameter, ...]:
    return describe(parameters) + describe(methods, "methods.")


def _method(runs: ExperimentRuns, mine: MethodRun, others: Cases) -> MethodResult:
    experiment, accepted = runs.experiment, mine.method in runs.experiment.accepted
    followed = [mine, *(case[mine.method] for case in others.values() if mine.method in case)]
    return MethodResult(
        name=mine.method,
        label=mine.label,
        accepted=accepted,
        scene=mine.scene,
        registered=mine.registered,
        runs=mine.runs,
        residuals=mine.residuals,
        scores=(
            *(s for f in followed for s in truth_scores(f, experiment.axis)),
            *(s for r in mine.residuals.values() for s in scores_of(r, _AGAINST[runs.kind])),
            *run_scores(mine.run),
            *_outside(mine),
            *(s for f in followed for s in consistency_scores(f)),
        ),
        checks=checks_of(runs, mine) if accepted else (),
        band=value_at(runs.parameters, experiment.band)[0] if experiment.band else 0.0,
        chosen=runs.methods[mine.method].chosen,
    )


def truth_scores(followed: MethodRun, axis: str) -> tuple[Score, ...]:
    """Errors at every probe against the truth; none for a run that did not reach the end."""
    return tuple(
        score
        for name in followed.scored
        for score in track_scores(
            error_at(followed, name, axis), "truth of the twin", followed.case
        )
    )


def _outside(followed: MethodRun) -> tuple[Score, ...]:
    """How many samples lie beyond the law's validity and were not compared."""
    outside = sum(r.outside for r in followed.registered)
    if outside == 0:
        return ()
    words = "samples beyond the law's validity, not compared"
    count = outside + sum(len(r.t) for r in followed.registered)
    return (Score("samples.outside_law", float(outside), "1", count, "none", words),)


def _published(
    runs: ExperimentRuns,
    results: tuple[MethodResult, ...],
    identified: Identified | None,
    told: ReportAdditions,
) -> tuple[Published, ...]:
    """Printed figures beside ours; none in a quick run.

    One that is not computed stands among them with its fault; not where a part was left out.
    """
    if runs.quick:
        return ()
    values = {m.name: {s.name: s.value for s in m.scores} for m in results}
    values["identified"] = {s.name: s.value for s in (identified.scores if identified else ())}
    values["told"] = dict(told.numbers)
    figures = [figure.beside(values) for figure in runs.experiment.published]
    return tuple(figure for figure in figures if runs.whole or not figure.missing)


def _notes(
    remade: tuple[str, ...],
    identified: Identified | None,
    main: Mapping[str, MethodRun],
    settings: Mapping[str, Any],
    locking: tuple[str, ...],
) -> tuple[str, ...]:
    """What was made anew, identified, noticed by registration or schemes, not compared; locks.

    What external simulators say stands in a table of their own.
    """
    first = next(iter(main.values()))
    found = [f for r in first.registered for f in r.findings]
    markers = [m for r in first.registered for m in r.of(MarkerObservation)]
    found += [f for m in markers for f in m.registration.findings]
    own = [f for n, f in main.items() if not isinstance(settings[n], ExternalSimulator)]
    found += [f"{f.label}: {w}" for f in own for run in f.runs for w in run.said]
    found += [
        f for pair in zip(first.registered, first.runs, strict=True) for f in unanswered(*pair)
    ]
    said = (
        *remade,
        *(identified.notes if identified else ()),
        *found,
        *gate_warnings(main),
        *locking,
    )
    return tuple(dict.fromkeys(said))
