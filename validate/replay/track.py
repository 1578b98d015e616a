"""The road of experiments over time: every method on every case, scored against the truth."""

from collections.abc import Mapping
from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np

from validate.compare.exhibit import Exhibit
from validate.compare.residual import Residual
from validate.compare.result import MethodResult, Result
from validate.compare.score import Score, run_scores, scores_of
from validate.compare.track import track_scores
from validate.compare.verdict import OWN_COVARIANCE, Check, Sensitivity, judge
from validate.errors import ComparisonError
from validate.fem.locate import barycentric_rows
from validate.fem.locking import locking_warning
from validate.fem.system import build as build_system
from validate.parameters import describe
from validate.recording.types import Recording
from validate.register.observe import MarkerObservation, Registered, SignalObservation
from validate.replay.follow import error_at, standard_exhibits
from validate.replay.made import made_by
from validate.replay.options import Options, Report, configure, folder_of
from validate.replay.sentence import verdict_sentence
from validate.replay.sureness import consistency_exhibit, consistency_scores
from validate.replay.tracking import Case, Cases, Followed, Told, Tracking, Truth
from validate.scene.scene import Scene
from validate.solve.march import march, output_frames
from validate.solve.types import Run

MAIN = ""  # the case that was recorded


def track(experiment: Tracking, options: Options, report: Report | None = None) -> Result:
    """Runs the road and judges it. Raises children of `ValidateError` for bad input."""
    parameters, methods = configure(experiment, options)
    cases = () if options.quick else _cases(experiment, methods)
    road = _Road(experiment, methods, report, _total(experiment, methods, cases))
    shipped = experiment.load(parameters, folder_of(experiment))[0]
    recording, true, remade = road.made_by(shipped, parameters)
    main = road.case(MAIN, recording, parameters, true, tuple(methods))
    others = {case.name: road.other(case, parameters, true) for case in cases}
    told = _told(experiment, parameters, {MAIN: main, **others}, road, options)
    results = tuple(_method(experiment, road, parameters, main[n], others) for n in methods)
    values = {m.name: {s.name: s.value for s in m.scores} for m in results}
    values["told"] = dict(told.numbers)
    printed = experiment.published(values) if experiment.published and not options.quick else ()
    first = main[next(iter(methods))]
    return Result(
        name=experiment.name,
        title=experiment.title,
        source=experiment.source,
        sentence=verdict_sentence(results, quick=options.quick),
        parameters=describe(parameters) + describe(methods, "methods."),
        methods=results,
        recordings=(recording,),
        rest=(),
        effects=(),
        published=printed,
        notes=(*remade, *first.seen.findings, *_locking(main)),
        quick=options.quick,
        same_model=experiment.same_model,
        seed=experiment.seed,
        twin_notice=experiment.twin_notice,
        exhibits=_exhibits(experiment, main, others, told),
    )


def _locking(main: Mapping[str, Followed]) -> tuple[str, ...]:
    """Which methods' cells lock near incompressibility, by warning."""
    found: dict[str, list[str]] = {}
    for followed in main.values():
        warning = locking_warning(followed.scene)
        if warning:
            found.setdefault(warning, []).append(followed.label)
    return tuple(f"{warning} ({'; '.join(labels)})" for warning, labels in found.items())


def _exhibits(
    experiment: Tracking,
    main: Mapping[str, Followed],
    others: Cases,
    told: Told,
) -> tuple[Exhibit, ...]:
    docs = {case.name: case.doc for case in experiment.cases}
    sure = consistency_exhibit(main, others, experiment.accepted)
    standard = standard_exhibits(experiment, main, others, docs)
    return (*standard, *((sure,) if sure else ()), *told.exhibits)


def _total(experiment: Tracking, methods: Mapping[str, Any], cases: tuple[Case, ...]) -> int:
    per_case = [len(_of_case(experiment, methods, case)) for case in cases]
    return len(methods) + sum(per_case) + 1


def _cases(experiment: Tracking, methods: Mapping[str, Any]) -> tuple[Case, ...]:
    """The cases that any of the chosen methods is run on."""
    return tuple(case for case in experiment.cases if _of_case(experiment, methods, case))


def _of_case(experiment: Tracking, methods: Mapping[str, Any], case: Case) -> tuple[str, ...]:
    """The methods a case is run with: those it names, or all that are not only timed."""
    whole = [n for n, m in methods.items() if getattr(m, "steps", None) is None]
    return tuple(n for n in whole if not case.methods or n in case.methods)


class _Road:
    """Runs methods on cases and counts them for the progress bar."""

    def __init__(
        self, experiment: Tracking, methods: Mapping[str, Any], report: Report | None, total: int
    ) -> None:
        self.experiment, self.methods, self._report = experiment, methods, report
        self._done, self._total = 0, total

    def tell(self, what: str) -> None:
        if self._report:
            self._report(min(self._done, self._total), self._total, what)

    def made_by(
        self, recording: Recording, parameters: Any
    ) -> tuple[Recording, Any, tuple[str, ...]]:
        """The recording, the parameters of its truth, and what is to be said of them."""
        experiment = self.experiment
        return made_by(
            recording, parameters, experiment.remake, lambda p: experiment.record(p, self.tell)
        )

    def other(self, case: Case, parameters: Any, true: Any) -> dict[str, Followed]:
        """A case: the truth's parameters changed, its recording shipped or made in memory."""
        experiment = self.experiment
        if case.shipped:
            shipped = experiment.load(case.change(parameters), folder_of(experiment))[0]
            recording, true, _ = self.made_by(shipped, case.change(parameters))
        else:
            true = case.change(true)
            recording = experiment.record(true, self.tell)
        names = _of_case(experiment, self.methods, case)
        return self.case(case.name, recording, parameters, true, names)

    def case(
        self, name: str, recording: Recording, parameters: Any, true: Any, methods: tuple[str, ...]
    ) -> dict[str, Followed]:
        """Every method, with `parameters`, on a recording that the twin made with `true` ones."""
        found: dict[str, Followed] = {}
        truth: Truth | None = None
        for method in methods:
            self.tell(f"{method} {name}".strip())
            scene, seen, run = self.run(method, recording, parameters)
            truth = truth or self.experiment.truth(true, seen)
            label = str(self.methods[method].label)
            found[method] = Followed(method, label, name, scene, seen, run, truth)
            self._done += 1
        return found

    def run(
        self, method: str, recording: Recording, parameters: Any
    ) -> tuple[Scene, Registered, Run]:
        settings = self.methods[method]
        start = perf_counter()
        scene = self.experiment.build(recording, parameters, settings)
        system = build_system(scene)
        built = perf_counter() - start
        seen = self.experiment.place(recording, parameters, scene)
        start = perf_counter()
        stepper = self.experiment.stepper(settings, parameters, system, seen)
        setup = built + perf_counter() - start
        stride = getattr(settings, "stride", 1)
        t, inputs = seen.stage.t[stride - 1 :: stride], seen.stage.y[stride - 1 :: stride]
        steps = getattr(settings, "steps", None) or len(t)
        at = output_frames(len(t), self.experiment.frames)
        run = march(method, stepper, t[:steps], inputs[:steps], at[at < steps], setup)
        return scene, seen, run


def _told(
    experiment: Tracking, parameters: Any, cases: Cases, road: _Road, options: Options
) -> Told:
    """What the experiment adds; only when all of it was run."""
    whole = set(cases[MAIN]) == set(experiment.methods)
    if experiment.tell is None or options.quick or not whole:
        return Told()
    return experiment.tell(parameters, cases, road.tell)


def _method(
    experiment: Tracking,
    road: _Road,
    parameters: Any,
    mine: Followed,
    others: Cases,
) -> MethodResult:
    accepted = mine.method in experiment.accepted
    residuals = held_out(mine)
    runs = [mine, *(case[mine.method] for case in others.values() if mine.method in case)]
    return MethodResult(
        name=mine.method,
        label=mine.label,
        accepted=accepted,
        scene=mine.scene,
        registered=(mine.seen,),
        runs=(mine.run,),
        residuals=residuals,
        scores=(
            *(s for f in runs for s in truth_scores(f, experiment.axis)),
            *(s for r in residuals.values() for s in scores_of(r, "measured recording")),
            *run_scores(mine.run),
            *(s for f in runs for s in consistency_scores(f)),
        ),
        checks=_checks(experiment, road, parameters, mine, residuals) if accepted else (),
    )


def truth_scores(followed: Followed, axis: str) -> tuple[Score, ...]:
    """Errors at every probe against the truth; none for a run that did not reach the end."""
    return tuple(
        score
        for name in followed.scored
        for score in track_scores(
            error_at(followed, name, axis), "truth of the twin", followed.case
        )
    )


def held_out(followed: Followed) -> dict[str, Residual]:
    """Simulated less measured over the whole time: markers that are probes of the scene, signals
    that the run traces."""
    if not followed.whole:
        return {}
    markers, probes = followed.seen.markers, {p.name for p in followed.scene.probes}
    rows = (
        [_residual(followed, markers, n) for n in markers.names if n in probes] if markers else []
    )
    rows += [_signal(followed, s) for s in followed.seen.signals if s.trace in followed.run.traces]
    return {r.name: r for r in rows if r is not None}


def _signal(followed: Followed, seen: SignalObservation) -> Residual | None:
    run = followed.run
    inside = (seen.t >= run.t[0] - 1e-9) & (seen.t <= run.t[-1] + 1e-9)
    if not inside.any():
        return None
    off = np.interp(seen.t[inside], run.t, run.traces[seen.trace].y) - seen.y[inside]
    words = "simulated less measured signal, every sample"
    return Residual(seen.quantity, "all", off[:, None], seen.sd, 0.0, seen.unit, words)


def _residual(followed: Followed, markers: MarkerObservation, name: str) -> Residual | None:
    j, run = markers.names.index(name), followed.run
    moved = markers.x[:, j] - markers.rest[j]
    inside = (markers.t >= run.t[0] - 1e-9) & (markers.t <= run.t[-1] + 1e-9)
    seen = np.isfinite(moved).all(axis=1) & inside
    if not seen.any():
        return None
    t = markers.t[seen]
    axes = "xyz"[: moved.shape[1]]
    estimate = np.stack([np.interp(t, run.t, run.traces[f"{name}.{c}"].y) for c in axes], axis=1)
    words = "estimate less measured displacement of the marker, at the times it was seen"
    tre = float(markers.tre[j])
    return Residual(name, "all", estimate - moved[seen], markers.sd, tre, "m", words)


def _checks(
    experiment: Tracking,
    road: _Road,
    parameters: Any,
    mine: Followed,
    residuals: Mapping[str, Residual],
) -> tuple[Check, ...]:
    finer, inputs, refinement = _uncertain(experiment, road, parameters, residuals)
    own = _own_doubt(mine, residuals)
    found = []
    for accept in experiment.accept:
        key = f"{accept.quantity}@all"
        if key not in residuals:
            found.append(_nothing(accept.quantity, accept.limit, mine.run))
            continue
        found.append(
            judge(
                residuals[key],
                accept.limit,
                finer.get(key),
                refinement,
                inputs.get(key, []) + own.get(key, []),
            )
        )
    return tuple(found)


def _own_doubt(mine: Followed, residuals: Mapping[str, Residual]) -> dict[str, list[Sensitivity]]:
    """What a filter itself claims of its error at every probe, as one more input of u_val."""
    if mine.run.sd is None or not mine.whole:
        return {}
    found = {}
    for probe in mine.scene.probes:
        key = f"{probe.name}@all"
        if key in residuals:
            rows = barycentric_rows(mine.scene.mesh, np.array([probe.point]))
            sd = np.array([rows.apply(s)[0] for s in mine.run.sd])
            claimed = replace(residuals[key], values=sd, sd=0.0)
            found[key] = [Sensitivity(OWN_COVARIANCE, claimed, 1.0)]
    return found


def _uncertain(
    experiment: Tracking, road: _Road, parameters: Any, residuals: Mapping[str, Residual]
) -> tuple[Mapping[str, Residual], dict[str, list[Sensitivity]], float]:
    """What the mesh and the inputs do to the residuals, by the surrogate.

    A twin of the same model on the same mesh has no discretisation error: u_num is zero there.
    """
    uncertainty = experiment.uncertainty
    if uncertainty is None:
        if not experiment.same_model:
            raise ComparisonError(f"{experiment.name}: no uncertainty is declared; u_val unknown")
        return residuals, {}, 1.0
    shipped = experiment.load(parameters, folder_of(experiment))[0]
    recording, _, _ = road.made_by(shipped, parameters)

    def moved(changed: Any) -> dict[str, Residual]:
        scene, seen, run = road.run(uncertainty.surrogate, recording, changed)
        return held_out(Followed(uncertainty.surrogate, "", "", scene, seen, run, Truth({})))

    base, fine = moved(parameters), moved(uncertainty.finer(parameters))
    finer = {
        k: replace(r, values=r.values + fine[k].values - base[k].values)
        for k, r in residuals.items()
        if k in fine and k in base
    }
    found: dict[str, list[Sensitivity]] = {}
    for source in uncertainty.inputs:
        other = moved(source.change(parameters))
        for key in base.keys() & other.keys():
            step = replace(base[key], values=other[key].values - base[key].values, sd=0.0)
            found.setdefault(key, []).append(
                Sensitivity(source.name, step, source.scale(parameters))
            )
    return finer, found, uncertainty.refinement(parameters)


def _nothing(quantity: str, limit: float, run: Run) -> Check:
    ending = "" if run.finished else f"{run.outcome.state}: {run.outcome.why}"
    why = f"compared nothing: {ending or 'no such marker in the recording'}"
    return Check(quantity, 0.0, limit, 0.0, 0.0, 0.0, 0.0, "m", 0, "cannot decide", why)
