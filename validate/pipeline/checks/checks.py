"""Verdicts of the accepted methods: u_num from meshes and steps, u_input from declared inputs."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from math import inf, isfinite
from typing import Any

import numpy as np

from validate.arrays import Floats, rms
from validate.compare.convergence import GridConvergence, Numerical, convergence
from validate.compare.effects import Effect, Joint, difference, effect, joint, joint_draws
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
from validate.errors import ComparisonError, SceneError
from validate.fem.assembly.locate import probe_rows
from validate.numbers import text, with_unit
from validate.parameters import nearest_names
from validate.pipeline.checks.consistency import claims_hold
from validate.pipeline.experiment.experiment import (
    EffectSpec,
    Experiment,
    Input,
    Uncertainty,
    Variant,
)
from validate.pipeline.experiment.method import Method
from validate.pipeline.run.method_run import MethodRun
from validate.pipeline.run.runs import ExperimentRuns, Varied
from validate.recording.types import Recording
from validate.register.outlines.outlines import OutlineObservation
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.meshless import AnyScene, RigidBody
from validate.scene.scene import Prescribed, Scene

# --- numerical uncertainty u_num of the accepted methods, from their declared meshes and steps ---

# Below, differences need no order, and the largest is u: of the largest number compared (rounding),
# or of the limit (solvers, and points that meshes interpolate apart).
_ROUNDING, _IMMATERIAL = 1e-9, 1e-3


def variants(uncertainty: Uncertainty, name: str) -> dict[str, list[Variant]]:
    """By part of u_num: the method (or its stand-in) as it is, and on every level."""
    own = Variant(uncertainty.stand_in.get(name, name))
    found = {}
    if uncertainty.mesh:
        found["mesh"] = [own, *(replace(own, change=c) for c in uncertainty.mesh.levels)]
    if uncertainty.steps:
        own = Variant(name)
        found["time step"] = [own, *(replace(own, split=n) for n in uncertainty.steps.splits)]
    return found


class Refined:
    """Convergence of a method's residuals, by part of u_num; of the meshes and steps that ran."""

    def __init__(self, runs: ExperimentRuns, uncertainty: Uncertainty, name: str) -> None:
        self._uncertainty = uncertainty
        self._stands_in = uncertainty.stand_in.get(name, "")
        self._runs = {
            part: [_solved(runs, v) for v in levels]
            for part, levels in variants(uncertainty, name).items()
        }
        self._sizes = {part: self._size_of(part, runs, name) for part in self._runs}

    def of(self, residual: Residual, limit: float) -> dict[str, GridConvergence | None]:
        """By part; None where fewer than two meshes or steps compare the same points."""
        immaterial = _IMMATERIAL * limit if isfinite(limit) else 0.0
        ends = (residual.simulated or 0.0, residual.measured or 0.0)
        rounding = max(_ROUNDING * float(max(rms(residual.values), *np.abs(ends))), immaterial)
        return {part: self._converged(part, residual, rounding) for part in self._runs}

    def numerical(self, residual: Residual, limit: float = inf) -> Numerical:
        """Return the parts of u_num, how each was found, and what would decide within `limit`."""
        found = self.of(residual, limit)
        deciding = {part: self._deciding(part, c, limit) for part, c in found.items() if c}
        lost = [part for part, c in found.items() if c is None or not c.asymptotic]
        words = [f"{part}: {self._words(part, c)}" for part, c in found.items()]
        words += [f"{deciding[part]} would decide" for part in lost if part in deciding]
        parts = {part: c.u if c else inf for part, c in found.items()}
        return Numerical(parts, "; ".join(words), deciding)

    def _size_of(self, part: str, runs: ExperimentRuns, name: str) -> list[float]:
        """m or s of every level, as it is first."""
        mesh = self._uncertainty.mesh
        if part == "mesh" and mesh:
            changed = [v.change(runs.parameters) for v in variants(self._uncertainty, name)[part]]
            sizes = [mesh.size(p) for p in changed]
        else:
            own = self._nominal(part)
            sizes = [
                own.until / (own.steps * v.split)
                for v in variants(self._uncertainty, name)["time step"]
            ]
        if len(set(sizes)) < min(2, len(sizes)):
            raise ComparisonError(
                f"{name}, {part}: sizes {', '.join(f'{s:.3g}' for s in sizes)}; u_num needs two "
                "different sizes; declare more mesh or step sizes"
            )
        return sizes

    def _nominal(self, part: str) -> Varied:
        found = self._runs[part][0]
        assert found is not None
        return found

    def _converged(self, part: str, residual: Residual, rounding: float) -> GridConvergence | None:
        answers: dict[float, Floats] = {}
        meshes: set[int] = set()
        for size, run in zip(self._sizes[part], self._runs[part], strict=True):
            mine = run.residuals.get(residual.name) if run else None
            if run is None or mine is None or mine.values.shape != residual.values.shape:
                continue
            # A method whose own settings fix its mesh is no ladder, whatever the sizes say.
            nodes = run.nodes if part == "mesh" else len(meshes)
            if nodes not in meshes:
                answers.setdefault(size, mine.values)
            meshes.add(nodes)
        if len(answers) < 2 or self._sizes[part][0] not in answers:
            return None
        ladder = self._uncertainty.mesh if part == "mesh" else self._uncertainty.steps
        assert ladder is not None
        return convergence(list(answers), list(answers.values()), 0, ladder.order, rounding)

    def _words(self, part: str, found: GridConvergence | None) -> str:
        if found is None:
            if len(self._runs[part]) == 1:
                return "no second mesh fits into the time of a first answer; add --refine"
            return "fewer than two different sizes compare the same points"
        by = f" by {self._stands_in} in its place" if part == "mesh" and self._stands_in else ""
        # A mesh file that is too large to be halved is filled anew with larger cells.
        only = found.conduct == "two sizes" and found.finest == 1 and part == "mesh"
        return found.words + by + (", one of them coarser" if only else "")

    def _deciding(self, part: str, found: GridConvergence, limit: float) -> str:
        share = found.deciding(limit)
        size = share * self._sizes[part][0]
        if part != "mesh":
            return f"a step of {1e3 * size:.2g} ms"
        own = self._nominal(part)
        unknowns = float(f"{own.nodes * own.dimension / share**own.dimension:.1g}")
        return f"cells of {1e3 * size:.2g} mm (about {text(unknowns)} unknowns)"


def _solved(runs: ExperimentRuns, variant: Variant) -> Varied | None:
    """None for a mesh too coarse to hold the body's shape."""
    try:
        return runs.varied(variant)
    except SceneError:
        if variant == Variant(variant.method):
            raise
        return None


def mesh_errors(refined: Refined | None, residuals: Mapping[str, Residual]) -> dict[str, float]:
    """u_num of every residual, its unit; zero where nothing is discretised anew."""
    return {k: refined.numerical(r).u if refined else 0.0 for k, r in residuals.items()}


# --- verdicts of the accepted methods ------------------------------------------------------------

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
    known = {r.quantity for r in mine.residuals.values()}
    there_are = f"; {nearest_names(accept.quantity, known)}" if known else ""
    why = ends or f"the recording does not have this quantity{there_are}"
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


# --- standard deviations of drives as uncertain inputs of a verdict ------------------------------


def with_uncertain_drives(
    experiment: Experiment,
    methods: Mapping[str, Method],
    recordings: tuple[Recording, ...],
    parameters: Any,
) -> Experiment:
    """Return the experiment with an input for every drive whose standard deviation is known.

    Unchanged where it declares no uncertainty (a twin of the same model), or accepts no method.
    """
    declared = experiment.uncertainty
    names = [name for name in experiment.accepted if name in methods]
    if declared is None or not names:
        return experiment
    by = declared.surrogate or names[0]
    scene = experiment.build(recordings[0], parameters, experiment.methods[by].scene)
    if isinstance(scene, RigidBody):  # poses have no standard deviation of their own
        return experiment
    inputs = drive_inputs(scene, experiment.place(recordings[0], parameters, scene))
    if not inputs:
        return experiment
    more = replace(declared, inputs=(*declared.inputs, *inputs), surrogate=by)
    return replace(experiment, uncertainty=more)


def drive_inputs(scene: AnyScene, seen: Registered) -> tuple[Input, ...]:
    """Return the inputs of all drives that have a standard deviation, in order."""
    count = sum(drive.y.shape[1] for drive in seen.drives)
    found: list[Input] = []
    first = 0
    for drive in seen.drives:
        wide = drive.y.shape[1]
        rows = list(_deviations(scene, drive, first))
        for k, row in enumerate(rows, 1):
            off = np.zeros(count)
            off[first : first + wide] = row
            which = f", {k} of {len(rows)}" if len(rows) > 1 else ""
            words = (
                f"{drive.name} shifted by its standard deviation, {with_unit(drive.sd, drive.unit)}"
            )
            name = f"sd of {drive.name}{which}"
            found.append(Input(name, _as_it_is, words, "recorded", off=tuple(off.tolist())))
        first += wide
    return tuple(found)


def _deviations(scene: AnyScene, drive: SignalObservation, first: int) -> Iterator[Floats]:
    """Errors (columns of the drive,) of one standard deviation each, independent of each other."""
    wide = drive.y.shape[1]
    # The set of nodes whose tracked points are these inputs
    follower: Prescribed | None = None
    if isinstance(scene, Scene):
        own = scene.inputs[first : first + wide]
        follower = next((p for p in scene.tracked if p.inputs == own), None)
    if follower is not None:
        yield from follower.deviations(drive.sd)
    elif drive.sd > 0:
        yield from drive.sd * np.eye(wide)


def _as_it_is(parameters: Any, z: float) -> Any:
    return parameters
