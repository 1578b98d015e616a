"""Verdicts of the accepted methods: u_num from meshes and steps, u_input from declared inputs."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from math import inf
from typing import Any

import numpy as np

from validate.arrays import Floats, rms
from validate.compare.convergence import Numerical
from validate.compare.effects import Effect, effect
from validate.compare.inputs import Joint, difference, joint, joint_draws
from validate.compare.residual import Residual
from validate.compare.result import MethodResult
from validate.compare.verdict import (
    OWN_COVARIANCE,
    Accept,
    Check,
    Sensitivity,
    as_fitted,
    as_same_model,
    judge,
    nothing_compared,
)
from validate.errors import ComparisonError
from validate.fem.assembly.locate import probe_rows
from validate.pipeline.checks.consistency import claims_hold
from validate.pipeline.checks.numerical_uncertainty import Refined, mesh_errors, variants
from validate.pipeline.experiment.experiment import EffectSpec, Input, Uncertainty, Variant
from validate.pipeline.run.method_run import MethodRun
from validate.pipeline.run.runs import ExperimentRuns
from validate.register.outlines.outlines import OutlineObservation

_NO_UNIT = "-"  # of a quantity that no observation has


def variants_of(runs: ExperimentRuns) -> list[Variant]:
    """Every variant that the pipeline will solve on the experiment's own recordings."""
    wanted = [Variant(name) for name in runs.methods]
    accepted = [name for name in runs.experiment.accepted if name in runs.methods]
    uncertainty = runs.experiment.uncertainty
    if accepted and uncertainty:
        wanted += [
            v for n in accepted for levels in variants(uncertainty, n).values() for v in levels
        ]
        wanted += [Variant(uncertainty.surrogate)] if uncertainty.inputs else []
        wanted += [
            i.at(by, 1.0)
            for i in uncertainty.inputs
            for by in dict.fromkeys(_moved_by(runs, uncertainty, i, n) for n in accepted)
        ]
        wanted += _joint_variants(runs)
    return wanted + [v for e in shown_effects(runs) for v in (e.one, e.other)]


@dataclass(frozen=True)
class Terms:
    """Terms of a residual's check: the requirement, u_num, and the parts of u_input.

    `fitted` says why its data are no evidence; "" where they are.
    """

    accept: Accept
    numerical: Numerical
    inputs: tuple[Sensitivity, ...]
    fitted: str = ""

    def judge(self, residual: Residual) -> Check:
        check = judge(residual, self.accept, self.numerical, self.inputs)
        return as_fitted(check, self.fitted) if self.fitted else check


def checks_of(runs: ExperimentRuns, mine: MethodRun) -> tuple[Check, ...]:
    """Return the verdict on everything that the experiment accepts; what compared nothing has
    failed.

    Raises `ComparisonError` where no uncertainty is declared and the truth is another model.
    """
    found: list[Check] = []
    for accept, terms in terms_of(runs, mine):
        found += [_classed(runs, own.judge(mine.residuals[key])) for key, own in terms.items()]
        found += _nothing(accept, mine, terms)
    return tuple(found)


def terms_of(runs: ExperimentRuns, mine: MethodRun) -> list[tuple[Accept, dict[str, Terms]]]:
    """Return the terms of every accepted residual, by its name.

    Raises `ComparisonError` where no uncertainty is declared and the truth is another model.
    """
    refined = _refined(runs, mine.method)
    inputs, own = _sensitivities(runs, mine.method), _own_doubt(mine)

    def terms(key: str, accept: Accept) -> Terms:
        residual, limit = mine.residuals[key], accept.required or inf
        numerical = refined.numerical(residual, limit) if refined else Numerical()
        parts = (*inputs.get(key, []), *own.get(key, []))
        return Terms(accept, numerical, parts, _served(runs, mine, residual))

    return [
        (a, {k: terms(k, a) for k, r in mine.residuals.items() if _accepts(a, r)})
        for a in runs.experiment.accept
    ]


def _served(runs: ExperimentRuns, mine: MethodRun, residual: Residual) -> str:
    """What the data of a residual served for, so that they are no evidence; else ""."""
    if residual.role == "calibrates" or {residual.name, residual.quantity} & set(runs.calibrated):
        return "these data were used for identification"
    given = runs.settings[mine.method].markers
    if residual.quantity in given:
        return "this marker was given to the filter"
    outlines = [o for o in mine.seen.of(OutlineObservation) if o.name in given]
    if any(residual.quantity in o.units for o in outlines):
        return "this outline was given to the filter"
    return ""


def _classed(runs: ExperimentRuns, check: Check) -> Check:
    """The check as what it is: no evidence where the recording is the model's own."""
    if runs.remade:
        return as_same_model(check, "the recording was simulated again with this run's parameters")
    if runs.kind == "same model":
        return as_same_model(check, "recording and checked model are the same model")
    return check


def _accepts(accept: Accept, residual: Residual) -> bool:
    return residual.quantity == accept.quantity and (
        not accept.loads or residual.load in accept.loads
    )


def _refined(runs: ExperimentRuns, name: str) -> Refined | None:
    """None for a twin of the same model on the same mesh: it has no discretisation error."""
    uncertainty = _declared(runs)
    return Refined(runs, uncertainty, name) if uncertainty else None


def _declared(runs: ExperimentRuns) -> Uncertainty | None:
    experiment = runs.experiment
    if experiment.uncertainty is None and runs.kind != "same model":
        raise ComparisonError(f"{experiment.name}: no uncertainty is declared; u_val unknown")
    return experiment.uncertainty


def _sensitivities(runs: ExperimentRuns, judged: str = "") -> dict[str, list[Sensitivity]]:
    """Per residual name: what one standard uncertainty of each input does, by the surrogate.

    A `judged` method that was itself calibrated moves what was identified itself: its parameters
    may be none of the surrogate's.
    """
    uncertainty = _declared(runs)
    found: dict[str, list[Sensitivity]] = {}
    if uncertainty is None or not uncertainty.inputs:
        return found
    for source in uncertainty.inputs:
        by = _moved_by(runs, uncertainty, source, judged)
        base = runs.varied(Variant(by)).residuals
        moved = runs.varied(source.at(by, 1.0)).residuals
        for key in base.keys() & moved.keys():
            step = replace(base[key], values=difference(moved[key], base[key]), sd=0.0)
            found.setdefault(key, []).append(Sensitivity(source.name, step))
    return found


def _moved_by(runs: ExperimentRuns, uncertainty: Uncertainty, source: Input, judged: str) -> str:
    own = source.identified and judged in {c.method for c in runs.experiment.calibrations}
    return judged if own or (source.each and judged) else uncertainty.surrogate


def joint_inputs(runs: ExperimentRuns) -> tuple[Joint, ...]:
    """First-order u_input of all that is accepted beside draws of all inputs at once."""
    parts, variants = _sensitivities(runs), _joint_variants(runs)
    if not parts or not variants:
        return ()
    base = runs.varied(Variant(variants[0].method)).residuals
    drawn = [runs.varied(variant).residuals for variant in variants]
    accepted = (k for k, r in base.items() if any(_accepts(a, r) for a in runs.experiment.accept))
    return tuple(
        joint(base[key], parts[key], seen)
        for key in accepted
        if key in parts and (seen := [one[key] for one in drawn if key in one])
    )


def _joint_variants(runs: ExperimentRuns) -> list[Variant]:
    """The surrogate with all inputs drawn at once; none in a quick run."""
    uncertainty = runs.experiment.uncertainty
    if runs.quick or uncertainty is None or not (uncertainty.inputs and uncertainty.draws):
        return []
    table = joint_draws(uncertainty.draws, len(uncertainty.inputs))
    return [_drawn(uncertainty, row) for row in table]


def _drawn(uncertainty: Uncertainty, row: Floats) -> Variant:
    """The surrogate with every input off by its number (inputs,) of standard uncertainties."""
    off = [z * np.array(i.off) for i, z in zip(uncertainty.inputs, row, strict=True) if i.off]

    def change(parameters: Any) -> Any:
        for source, z in zip(uncertainty.inputs, row.tolist(), strict=True):
            parameters = source.move(parameters, z)
        return parameters

    return Variant(
        uncertainty.surrogate,
        change,
        off=tuple(np.sum(off, axis=0).tolist()) if off else (),
    )


def _own_doubt(mine: MethodRun) -> dict[str, list[Sensitivity]]:
    """What a filter itself claims of its error at every probe, as one more input of u_val; nothing
    where its NIS is outside the 95 % band: such a claim does not hold."""
    if mine.run.sd is None or not mine.whole or not claims_hold(mine):
        return {}
    found = {}
    for probe in mine.scene.probes:
        key = f"{probe.name}@all"
        if key in mine.residuals:
            rows = probe_rows(mine.body.mesh, (probe,))
            sd = np.array([rows.apply(s)[0] for s in mine.run.sd])
            claimed = replace(mine.residuals[key], values=sd, sd=0.0, t=None)
            found[key] = [Sensitivity(OWN_COVARIANCE, claimed)]
    return found


def _nothing(accept: Accept, mine: MethodRun, judged: Collection[str]) -> list[Check]:
    """Checks that compared nothing, in the unit of what they should have compared: of the quantity,
    or of every load that is named and not there."""
    there = [r.load for r in mine.residuals.values() if r.quantity == accept.quantity]
    ends = "; ".join(
        dict.fromkeys(f"{r.outcome.state}: {r.outcome.why}" for r in mine.runs if not r.finished)
    )
    if accept.loads and there:
        why = ends or f"unknown load of {accept.quantity}; there are {', '.join(there)}"
        absent = [f"{accept.quantity}@{load}" for load in accept.loads if load not in there]
        return [_empty(accept, name, why, mine) for name in absent]
    why = ends or "the recording does not have this quantity"
    return [] if judged else [_empty(accept, accept.quantity, why, mine)]


def _empty(accept: Accept, name: str, why: str, mine: MethodRun) -> Check:
    units = {q: unit for seen in mine.seen.compared for q, unit in seen.units.items()}
    return nothing_compared(accept, name, units.get(accept.quantity, _NO_UNIT), why)


# --- effects --------------------------------------------------------------------------------------


def shown_effects(runs: ExperimentRuns) -> tuple[EffectSpec, ...]:
    """Return the effects whose methods the user runs anyway; none in a quick run.

    None either without an accepted method: its u_num and u_input are part of what hides an effect.
    """
    if runs.quick or not set(runs.experiment.accepted) & set(runs.methods):
        return ()
    return tuple(
        e for e in runs.experiment.effects if {e.one.method, e.other.method} <= set(runs.methods)
    )


def effects_of(runs: ExperimentRuns, results: tuple[MethodResult, ...]) -> tuple[Effect, ...]:
    """Each declared effect against the noise of every sensor."""
    shown = shown_effects(runs)
    if not shown:
        return ()
    inputs = _sensitivities(runs)
    accepted = [m for m in results if m.accepted]
    meshes = [mesh_errors(_refined(runs, m.name), m.residuals) for m in accepted]
    return tuple(
        effect(
            e.name,
            e.doc,
            runs.varied(e.one).residuals,
            runs.varied(e.other).residuals,
            _shared(inputs, meshes, e.itself),
            runs.experiment.sensors,
        )
        for e in shown
    )


def _shared(
    inputs: Mapping[str, list[Sensitivity]], meshes: list[dict[str, float]], itself: str
) -> dict[str, float]:
    """u_num and u_input of every residual, SI: what no averaging over points removes."""
    squares: dict[str, float] = {}
    for key, parts in inputs.items():
        squares[key] = sum(rms(p.change.values) ** 2 for p in parts if p.name != itself)
    for errors in meshes:
        for key, u_num in errors.items():
            squares[key] = squares.get(key, 0.0) + u_num**2
    return {key: float(np.sqrt(square)) for key, square in squares.items()}
