"""The road of experiments at holds: recording -> scene -> registration -> run -> comparison."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from validate.compare.effects import Effect, effect
from validate.compare.residual import Residual, rest_residuals
from validate.compare.result import MethodResult, Result
from validate.compare.score import Score, rms, run_scores, scores_of
from validate.compare.verdict import SAFETY, Accept, Check, Sensitivity, judge
from validate.parameters import describe
from validate.recording.types import Recording
from validate.replay.experiment import EffectSpec, Experiment, Identified, Variant
from validate.replay.options import Options, Report, configure, folder_of
from validate.replay.sentence import verdict_sentence
from validate.replay.solved import Solved, solve
from validate.scene.scene import Scene
from validate.solve.types import Run


def compare_at_holds(
    experiment: Experiment, options: Options, report: Report | None = None
) -> Result:
    """Runs the road and judges it. Raises children of `ValidateError` for bad input."""
    parameters, methods = configure(experiment, options)
    recordings = experiment.load(parameters, folder_of(experiment))
    identified = experiment.identify(recordings, parameters) if experiment.identify else None
    used = identified.parameters if identified else parameters
    road = _Road(experiment, methods, recordings, used, report)
    road.plan(_variants(experiment, methods, options.quick))
    results = tuple(_method(road, name, options.quick) for name in methods)
    first = road.solved(Variant(next(iter(methods))))
    values = {m.name: {s.name: s.value for s in m.scores} for m in results}
    values["identified"] = {s.name: s.value for s in (identified.scores if identified else ())}
    printed = experiment.published(values) if experiment.published and not options.quick else ()
    effects = _effects(road, results, _shown(experiment, methods, options.quick))
    return Result(
        name=experiment.name,
        title=experiment.title,
        source=experiment.source,
        sentence=_opening(identified) + verdict_sentence(results, quick=options.quick),
        parameters=describe(used) + describe(methods, "methods."),
        methods=results,
        recordings=recordings,
        rest=rest_residuals(first.registered[0], first.runs[0]),
        effects=effects,
        published=printed,
        identified=identified.scores if identified else (),
        notes=(*(identified.notes if identified else ()), *_findings(first)),
        quick=options.quick,
        same_model=experiment.same_model,
        seed=experiment.seed,
        twin_notice=experiment.twin_notice,
        inputs=tuple(f"{i.name}: {i.doc}" for i in experiment.uncertainty.inputs),
    )


def _opening(identified: Identified | None) -> str:
    return f"{identified.headline}; " if identified and identified.headline else ""


def _findings(solved: Solved) -> tuple[str, ...]:
    """What registration noticed and did not refuse."""
    found = [f for r in solved.registered for f in r.findings]
    seen = [r.markers for r in solved.registered if r.markers is not None]
    return tuple(dict.fromkeys(found + [f for m in seen for f in m.registration.findings]))


class _Road:
    """Solves each variant once and counts them for the progress bar."""

    def __init__(
        self,
        experiment: Experiment,
        methods: Mapping[str, Any],
        recordings: tuple[Recording, ...],
        parameters: Any,
        report: Report | None,
    ) -> None:
        self.experiment, self.recordings, self.parameters = experiment, recordings, parameters
        self.settings = {**experiment.methods, **methods}
        self._report, self._total = report, 0
        self._done: dict[tuple[Any, Any], Solved] = {}

    def plan(self, variants: list[Variant]) -> None:
        self._total = len({self._key(v) for v in variants})

    def solved(self, variant: Variant) -> Solved:
        key = self._key(variant)
        if key not in self._done:
            if self._report:
                self._report(len(self._done), self._total, variant.method)
            self._done[key] = solve(self.experiment, self.recordings, variant.method, *key)
        return self._done[key]

    def _key(self, variant: Variant) -> tuple[Any, Any]:
        return self.settings[variant.method], variant.change(self.parameters)


def _variants(experiment: Experiment, methods: Mapping[str, Any], quick: bool) -> list[Variant]:
    wanted = [Variant(name) for name in methods]
    accepted = [name for name in experiment.accepted if name in methods]
    uncertainty = experiment.uncertainty
    for name in accepted:
        own = uncertainty.stand_in.get(name, name)
        wanted += [Variant(own), Variant(own, uncertainty.finer)]
    if accepted:
        wanted += [Variant(uncertainty.surrogate)]
        wanted += [Variant(uncertainty.surrogate, i.change) for i in uncertainty.inputs]
    return wanted + [v for e in _shown(experiment, methods, quick) for v in (e.one, e.other)]


def _shown(
    experiment: Experiment, methods: Mapping[str, Any], quick: bool
) -> tuple[EffectSpec, ...]:
    """The effects whose methods the user runs anyway; none in a quick run.

    None either without an accepted method: its u_num and u_input are part of what hides an effect.
    """
    if quick or not set(experiment.accepted) & set(methods):
        return ()
    return tuple(e for e in experiment.effects if {e.one.method, e.other.method} <= set(methods))


def _method(road: _Road, name: str, quick: bool) -> MethodResult:
    solved = road.solved(Variant(name))
    accepted = name in road.experiment.accepted
    return MethodResult(
        name=name,
        label=_label(road.settings[name], solved.scene),
        accepted=accepted,
        scene=solved.scene,
        registered=solved.registered,
        runs=solved.runs,
        residuals=solved.residuals,
        scores=(
            *(s for r in solved.residuals.values() for s in scores_of(r, "measured recording")),
            *run_scores(solved.runs[0]),
            *_outside(solved),
        ),
        checks=_checks(road, name, solved) if accepted else (),
        band=road.experiment.band(road.parameters) if road.experiment.band else 0.0,
    )


def _label(settings: Any, scene: Scene) -> str:
    """The method's label, and what it was run as where parameters changed that."""
    order = getattr(settings, "order", scene.mesh.order)
    label = str(settings.label)
    return label if order == scene.mesh.order else f"{label} [order {scene.mesh.order}]"


def _outside(solved: Solved) -> tuple[Score, ...]:
    """How many samples lie beyond the law's validity and were not compared."""
    outside = sum(r.outside for r in solved.registered)
    if outside == 0:
        return ()
    words = "samples beyond the law's validity, not compared"
    count = outside + sum(len(r.stage.t) for r in solved.registered)
    return (Score("samples.outside_law", float(outside), "1", count, "none", words),)


def _checks(road: _Road, name: str, solved: Solved) -> tuple[Check, ...]:
    uncertainty = road.experiment.uncertainty
    refined = _refined(road, name, solved.residuals)
    inputs = _sensitivities(road)
    found = []
    for accept in road.experiment.accept:
        keys = [k for k, r in solved.residuals.items() if _accepts(accept, r)]
        found += [
            judge(
                solved.residuals[key],
                accept.limit,
                refined.get(key),
                uncertainty.refinement(road.parameters),
                inputs.get(key, []),
            )
            for key in keys
        ] or [_nothing(accept.quantity, accept.limit, solved.runs)]
    return tuple(found)


def _accepts(accept: Accept, residual: Residual) -> bool:
    return residual.quantity == accept.quantity and (
        not accept.loads or residual.load in accept.loads
    )


def _refined(road: _Road, name: str, residuals: Mapping[str, Residual]) -> dict[str, Residual]:
    """A method's residuals as they would be on the finer mesh, by itself or its stand-in."""
    uncertainty = road.experiment.uncertainty
    own = uncertainty.stand_in.get(name, name)
    coarse = road.solved(Variant(own)).residuals
    finer = road.solved(Variant(own, uncertainty.finer)).residuals
    return {
        key: replace(r, values=r.values + finer[key].values - coarse[key].values)
        for key, r in residuals.items()
        if key in finer and key in coarse
    }


def _nothing(key: str, limit: float, runs: tuple[Run, ...]) -> Check:
    ends = "; ".join(f"{r.outcome.state}: {r.outcome.why}" for r in runs if not r.finished)
    why = f"compared nothing: {ends or 'no such quantity in the recording'}"
    return Check(key, 0.0, limit, 0.0, 0.0, 0.0, 0.0, "1", 0, "cannot decide", why)


def _sensitivities(road: _Road) -> dict[str, list[Sensitivity]]:
    """Per residual name: what one standard uncertainty of each input does, by the surrogate."""
    uncertainty = road.experiment.uncertainty
    base = road.solved(Variant(uncertainty.surrogate)).residuals
    found: dict[str, list[Sensitivity]] = {}
    for source in uncertainty.inputs:
        moved = road.solved(Variant(uncertainty.surrogate, source.change)).residuals
        for key in base.keys() & moved.keys():
            step = Residual(
                base[key].quantity, base[key].load, moved[key].values - base[key].values,
                0.0, 0.0, base[key].unit, source.doc,
            )  # fmt: skip
            found.setdefault(key, []).append(
                Sensitivity(source.name, step, source.scale(road.parameters))
            )
    return found


def _effects(
    road: _Road, results: tuple[MethodResult, ...], shown: tuple[EffectSpec, ...]
) -> tuple[Effect, ...]:
    accepted = [m for m in results if m.accepted]
    inputs = _sensitivities(road) if accepted and shown else {}
    meshes = [_mesh_errors(road, m) for m in accepted] if shown else []
    return tuple(
        effect(
            e.name,
            e.doc,
            road.solved(e.one).residuals,
            road.solved(e.other).residuals,
            _shared(inputs, meshes, e.itself),
            road.experiment.sensors,
        )
        for e in shown
    )


def _mesh_errors(road: _Road, method: MethodResult) -> dict[str, float]:
    """u_num of every residual of an accepted method, SI."""
    refined = _refined(road, method.name, method.residuals)
    scale = SAFETY / road.experiment.uncertainty.refinement(road.parameters)
    return {key: scale * rms(r.values - method.residuals[key].values) for key, r in refined.items()}


def _shared(
    inputs: Mapping[str, list[Sensitivity]], meshes: list[dict[str, float]], itself: str
) -> dict[str, float]:
    """u_num and u_input of every residual, SI: what no averaging over points removes."""
    squares: dict[str, float] = {}
    for key, parts in inputs.items():
        squares[key] = sum((p.scale * rms(p.change.values)) ** 2 for p in parts if p.name != itself)
    for errors in meshes:
        for key, u_num in errors.items():
            squares[key] = squares.get(key, 0.0) + u_num**2
    return {key: float(np.sqrt(square)) for key, square in squares.items()}
