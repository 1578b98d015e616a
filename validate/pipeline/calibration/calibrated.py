"""Calibration before prediction: open parameters are identified on separate data.

What was identified goes on with its covariance as uncertain inputs, along its principal axes; what
calibrated is named, so that no figure serves twice.
"""

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from math import hypot
from typing import Any

import numpy as np
from scipy.special import ndtri

from validate.compare.result import MethodResult
from validate.compare.score import Score
from validate.compare.verdict import Accept
from validate.errors import ComparisonError, UsageError, ValidateError
from validate.identify.budget import NOISE, IdentifiedValue
from validate.identify.identification import Identification, InTurn, Profiled, best_of
from validate.identify.identification import identify as identify_in
from validate.identify.least_squares import STEP, fit
from validate.numbers import with_unit
from validate.parameters import describe, with_values
from validate.pipeline.calibration.calibration import Calibrates, Calibration, Free
from validate.pipeline.calibration.fitted_moduli import on_meshes
from validate.pipeline.calibration.problem import Calibrated, Part, Problem, with_free
from validate.pipeline.experiment.experiment import (
    Experiment,
    Identified,
    IdentifiedByRuns,
    Input,
    SolvesVariants,
    Uncertainty,
)
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.origins import opened
from validate.pipeline.experiment.variation import Change
from validate.pipeline.run.twin_record import made_by
from validate.recording.types import Recording

# --- Uncertainty budgets of calibrated parameters: noise from the profile, inputs and mesh
# besides.
#
# One parameter of a judged method is identified again with every declared input moved by one
# standard uncertainty and on every mesh, to first order: dv = -(J^T dr) / (J^T J), dr the change
# of the residuals. Of several parameters, and of methods that are not judged, only the term
# "noise" is known; the value says so.

_TWO_SIDED = float(ndtri(0.975))
_ONLY_NOISE = "only the noise of these data: the interval does not include inputs and mesh"
_APART = "inputs and mesh of the predictions are varied with this value fixed"


def budgets(
    fitted: Sequence[Calibrated], experiment: Experiment, used: Any
) -> tuple[IdentifiedValue, ...]:
    """Every identified parameter with its terms; `used` are the parameters of the predictions."""
    return tuple(v for one in fitted for v in _of(one, experiment, used))


def _of(one: Calibrated, experiment: Experiment, used: Any) -> list[IdentifiedValue]:
    method = one.problem.calibration.method
    judged = method in experiment.accepted or one.problem.calibration.shared
    alone = len(one.found.estimates) == 1
    more = _first_order(one, experiment, used) if judged and alone else {}
    found = []
    for i, e in enumerate(one.found.estimates):
        pairs = zip(one.found.space.names, one.found.correlations[i].tolist(), strict=True)
        others = [f"{name} {r:+.2f}" for name, r in pairs if name != e.name]
        words = [f"correlation with {', '.join(others)}"] if others else []
        rest = _TWO_SIDED * hypot(*more.values()) if more else 0.0
        ends = e.value - hypot(e.value - e.low, rest), e.value + hypot(e.high - e.value, rest)
        found.append(
            IdentifiedValue(
                e.name, e.value, unit_of(one, e.name), method, one.on,
                {NOISE: e.sd, **{name: u for name, u in more.items() if u > 0}},
                one.found.best.count,
                correlation="; ".join([*words, _APART if more else _ONLY_NOISE]), given=ends,
            )
        )  # fmt: skip
    return found


def _first_order(one: Calibrated, experiment: Experiment, used: Any) -> dict[str, float]:
    """By input and for the mesh, what one standard uncertainty makes of the one parameter."""
    problem, space = one.problem, one.found.space
    (e,), x = one.found.estimates, one.found.best.x
    declared = experiment.uncertainty
    if declared is None:
        return {}
    base = problem.residual(x)
    h = STEP if x[0] + STEP <= 1 else -STEP
    slope = (problem.residual(x + h) - base) / (space.value(0, float(x[0] + h)) - e.value)
    square = float(slope @ slope)

    def again(change: Callable[[Any], Any]) -> float:
        """The parameter with other parameters of the model."""
        parts = tuple(
            replace(part, parameters=change(with_free(part.parameters, one.values)))
            for part in problem.parts
        )
        moved = replace(problem, parts=parts).residual(x)
        if len(moved) != len(base):
            return float("nan")
        return e.value - float(slope @ (moved - base)) / square

    found: dict[str, float] = {}
    for source in (i for i in declared.inputs if not i.identified):
        own = _moves_itself(one, used, source.by(1.0))
        try:
            value = own if own is not None else again(source.by(1.0))
        except ValidateError:
            continue
        if np.isfinite(value):
            found[source.name] = hypot(found.get(source.name, 0.0), value - e.value)
    if declared.mesh is not None and len(problem.parts) == 1 and e.value > 0:
        here = with_free(problem.parts[0].parameters, one.values)
        try:
            meshes = on_meshes(here, declared.mesh, e.value, lambda p: again(lambda _: p))
        except ValidateError:  # a ladder of fewer than three sizes
            return found
        found["mesh"] = meshes.u * e.value
    return {name: u for name, u in found.items() if np.isfinite(u)}


def _moves_itself(one: Calibrated, used: Any, change: Callable[[Any], Any]) -> float | None:
    """Where an input moves the identified parameter; None where it does not."""
    here = with_free(used, one.values)
    ((name, value),) = one.values.items()
    moved = {p.path: p.default for p in describe(change(here))}[name]
    return None if moved == value or moved is None else float(moved)


# -------------------------------------------------------------------------------------------------

#: From the number of a calibration among those of its experiment, and its problem.
Identify = Callable[[int, Problem], Identification]


def here(number: int, problem: Problem) -> Identification:
    """In this process, one evaluation after the other."""
    return identify_in(problem.space, InTurn(problem.residual))


def open_free(experiment: Experiment, parameters: Any) -> tuple[tuple[Free, ...], ...]:
    """Return the open parameters of every calibration; raises `UsageError` for a path that is
    none."""
    values = {p.path: p.default for p in describe(parameters)}
    for free in (f for c in experiment.calibrations for f in c.free):
        with_values(parameters, {free.path: repr(free.low)})
    return tuple(
        tuple(f for f in c.free if values[f.path] is None) for c in experiment.calibrations
    )


def apart(experiment: Experiment, parameters: Any) -> tuple[Any, ...]:
    """Return the parameters of every recording that only calibrates what stands open."""
    each = zip(experiment.calibrations, open_free(experiment, parameters), strict=True)
    ons = (on for c, free in each if free for on in c.on if not on.judged)
    return tuple(on.change(parameters) for on in ons)


def closed(experiment: Experiment, parameters: Any, shipped: tuple[Recording, ...]) -> Any:
    """Parameters with what stands open fitted from one start, for what asks of a body alone.

    Raises `ComparisonError` where that does not converge.
    """
    for number, free in enumerate(open_free(experiment, parameters)):
        if free:
            methods = experiment.methods
            problem = problem_of(experiment, number, free, parameters, methods, shipped)
            best = best_of([fit(problem.residual, problem.space.starts(1)[0])], problem.space)
            values = zip(problem.space.names, problem.space.values(best.x), strict=True)
            parameters = with_free(parameters, dict(values))
    return parameters


def middle(experiment: Experiment, parameters: Any) -> Any:
    """Parameters with what stands open in the middle of its bounds: for what only asks of sizes."""
    for free in open_free(experiment, parameters):
        parameters = with_free(parameters, {f.path: (f.low + f.high) / 2 for f in free})
    return parameters


def problem_of(
    experiment: Experiment,
    number: int,
    free: tuple[Free, ...],
    parameters: Any,
    methods: Mapping[str, Method],
    shipped: tuple[Recording, ...],
) -> Problem:
    """Return the recordings that calibrate are loaded; raises what that raises."""
    calibration = experiment.calibrations[number]
    if calibration.method not in methods:
        raise UsageError(
            f"calibration by '{calibration.method}': unknown method; expected one of "
            f"{', '.join(methods)}"
        )
    own = {r.source.sha256 for r in shipped} - {""}
    parts = []
    for on in calibration.on:
        if on.judged:
            served = _observing(experiment, calibration, on, shipped, parameters, methods)
            made = _made(experiment, served, parameters, on.change)
            parts.append(Part(on, made, parameters, True))
            continue
        found = opened(experiment, on.change(parameters))
        same = any(r.source.sha256 in own for r in found.recordings)
        made = _made(experiment, found.recordings, found.parameters, on.change)
        parts.append(Part(on, made, found.parameters, same))
    return Problem(experiment, calibration, free, methods[calibration.method], tuple(parts))


def _observing(
    experiment: Experiment,
    calibration: Calibration,
    on: Calibrates,
    shipped: tuple[Recording, ...],
    parameters: Any,
    methods: Mapping[str, Method],
) -> tuple[Recording, ...]:
    """The recordings with an observation of what calibrates: what is predicted in the others must
    not decide what can be identified. All of them where none says so."""
    if len(shipped) == 1:
        return shipped
    asked, model = middle(experiment, parameters), methods[calibration.method].scene
    names = {q.partition("@")[0] for q in on.quantities}
    seen = (experiment.place(r, asked, experiment.build(r, asked, model)) for r in shipped)
    units = [{q for o in one.compared for q in o.units} for one in seen]
    return tuple(r for r, own in zip(shipped, units, strict=True) if own & names) or shipped


def _made(
    experiment: Experiment, recordings: tuple[Recording, ...], parameters: Any, change: Change
) -> tuple[Recording, ...]:
    """The recordings, made anew where the user changed their twin."""
    twin = experiment.twin
    if twin is None or len(recordings) != 1:
        return recordings
    declared = change(experiment.parameters)
    made, _, _ = made_by(
        recordings[0], parameters, declared, twin.remake, lambda p: twin.made(p, lambda _: None)
    )
    return (made,)


def identified(
    experiment: Experiment,
    parameters: Any,
    methods: Mapping[str, Method],
    shipped: tuple[Recording, ...],
    identify: Identify,
    asked: Sequence[tuple[Free, ...]],
) -> tuple[tuple[Calibrated, ...], Mapping[str, str]]:
    """Every calibration of which something is `asked`, in order, whether it can be identified or
    not; each sees what those before found. Nothing is predicted, so no figure serves twice.

    And why others failed, by method, where each is calibrated by itself and one is left.
    """
    done: list[Calibrated] = []
    failed: dict[str, str] = {}
    for number, free in enumerate(asked):
        if not free:
            continue
        problem = problem_of(experiment, number, free, parameters, methods, shipped)
        try:
            done.append(Calibrated(problem, identify(number, problem)))
        except ComparisonError as error:
            name = problem.calibration.method
            failed[name] = str(error)
            alone = name in _each_by_itself(experiment)
            if not alone or len(failed) == sum(map(bool, asked)):
                raise
            continue
        parameters = with_free(parameters, done[-1].values)
    return tuple(done), failed


def calibrated(
    experiment: Experiment,
    parameters: Any,
    methods: Mapping[str, Method],
    shipped: tuple[Recording, ...],
    identify: Identify = here,
    *,
    wanted: Collection[str] = (),
    anyway: bool = False,
) -> tuple[tuple[Calibrated, ...], Mapping[str, str]]:
    """Every calibration of which something stands open, in order; each sees what those before
    found. And methods that are refused, with the reason.

    Where several methods are calibrated, each by itself, those that are not `wanted` (none: all)
    are left out, and one that cannot be identified is refused while others go on. Raises
    `ComparisonError` for a figure that would serve twice, and, unless `anyway`, for what is not
    identifiable where no method is left.
    """
    done: list[Calibrated] = []
    refused: dict[str, str] = {}
    alone = _each_by_itself(experiment)
    for number, free in enumerate(open_free(experiment, parameters)):
        name = experiment.calibrations[number].method
        if not free or (name in alone and wanted and name not in wanted):
            continue
        problem = problem_of(experiment, number, free, parameters, methods, shipped)
        require_apart(experiment.accept, problem)
        try:
            one = Calibrated(problem, identify(number, problem))
            if not anyway:
                require_identified(experiment, one)
        except ComparisonError as error:
            refused[name] = str(error)
            if name not in alone or set(refused) >= (set(wanted) or alone):
                raise
            continue
        done.append(one)
        parameters = with_free(parameters, one.values)
    return tuple(done), refused


def _each_by_itself(experiment: Experiment) -> set[str]:
    """The methods that are calibrated where there are several; none where one serves all, as
    those do whose findings are `shared`."""
    methods = {c.method for c in experiment.calibrations if not c.shared}
    return methods if len(methods) > 1 else set()


def require_apart(accept: Sequence[Accept], problem: Problem) -> None:
    """Raise `ComparisonError` where what is judged calibrates, under whatever name."""
    for part in (p for p in problem.parts if p.judged):
        # What calibrates is all that a limit judges of a quantity, or a load that it names.
        names = ((n, *n.partition("@")[::2], a) for n in part.on.quantities for a in accept)
        twice = next((n for n, quantity, load, a in names
                      if quantity == a.quantity and (not load or load in a.loads)), "")  # fmt: skip
        if not twice:
            continue
        mark = part.recordings[0].source.sha256[:8]
        same = "" if part.on.judged else f", and the checks use the same recording ({mark})"
        raise ComparisonError(
            f"'{twice}' of {part.name} calibrates '{problem.calibration.method}'{same}: each "
            f"value can be used only once; check other loads, quantities or recordings, or set "
            f"{', '.join(problem.space.names)}"
        )


def require_identified(experiment: Experiment, one: Calibrated) -> None:
    """Raise `ComparisonError` for a parameter that its recordings do not identify."""
    for estimate, free in zip(one.found.estimates, one.problem.free, strict=True):
        if not estimate.identified:
            raise ComparisonError(
                f"{not_identified(one, estimate, free)}; --anyway predicts with it nevertheless; "
                f"`validate identify {experiment.name}` shows its profile"
            )


def served(fitted: Iterable[Calibrated]) -> tuple[str, ...]:
    """Residuals of the recording that is judged that calibrated: fitted, and no evidence."""
    parts = (part for one in fitted for part in one.problem.parts)
    return tuple(q for part in parts if part.judged for q in part.on.quantities)


# --- what was identified is uncertain -------------------------------------------------------------


def with_inputs(experiment: Experiment, fitted: Sequence[Calibrated]) -> Experiment:
    """Return the experiment with the covariance of what was identified among its uncertain inputs,
    in place of declared ranges of the same parameters."""
    inputs = tuple(i for one in fitted for i in inputs_of(one))
    if not inputs:
        return experiment
    declared = experiment.uncertainty or Uncertainty(surrogate=fitted[0].problem.calibration.method)
    surrogate = declared.surrogate or fitted[0].problem.calibration.method
    # Declared ranges but those that move nothing but what was identified
    values = {path: value for one in fitted for path, value in one.values.items()}
    here = with_free(fitted[0].problem.parts[0].parameters, values)
    before, kept = {p.path: p.default for p in describe(here)}, []
    for source in declared.inputs:
        after = {p.path: p.default for p in describe(source.move(here, 1.0))}
        moved = {path for path, value in after.items() if value != before[path]}
        if not moved or not moved <= set(values):
            kept.append(source)
    more = replace(declared, inputs=(*kept, *inputs), surrogate=surrogate)
    return replace(experiment, uncertainty=more)


def inputs_of(one: Calibrated) -> tuple[Input, ...]:
    """One input a principal axis of the covariance, named after the parameter that it moves most;
    they are independent."""
    variances, axes = np.linalg.eigh(one.found.covariance)
    found = []
    for k in np.argsort(-variances):
        step = np.sqrt(max(float(variances[k]), 0.0)) * axes[:, k]
        name = one.found.space.names[int(np.argmax(np.abs(axes[:, k])))]
        found.append(_input(one, f"identified {name}", step, int(np.argmax(np.abs(axes[:, k])))))
    return tuple(found)


def _input(one: Calibrated, name: str, step: Any, most: int) -> Input:
    space = one.found.space

    def move(parameters: Any, z: float) -> Any:
        """From where they are: another axis may have moved them."""
        now = {p.path: p.default for p in describe(parameters)}
        values = space.values(space.coordinates([now[n] for n in space.names]) + z * step)
        return with_free(parameters, dict(zip(space.names, values, strict=True)))

    e = one.found.estimates[most]
    value, sd = (with_unit(v, unit_of(one, e.name)) for v in (e.value, e.sd))
    words = f"{e.name} within its covariance, {value} ± {sd} (one sd), and correlated parameters"
    return Input(name, move, words, f"identified on {one.on}", identified=True)


def identified_by(
    experiment: Experiment,
    shipped: tuple[Recording, ...],
    parameters: Any,
    methods: Mapping[str, Method],
    fitted: Sequence[Calibrated],
    solves: Callable[[Any], SolvesVariants],
) -> Identified | None:
    """What calibrations found, and what the experiment's own `identify` makes of that; `solves`
    gives what solves variants of parameters."""
    for one in fitted:
        parameters = with_free(parameters, one.values)
    find, own = experiment.identify, None
    if isinstance(find, IdentifiedByRuns):
        own = find.find(shipped, parameters, methods, solves(parameters))
    elif find:
        own = find(shipped, parameters, methods)
    if not fitted:
        return own
    own = own or Identified(parameters, (), ())
    values = (*budgets(fitted, experiment, own.parameters), *own.values)
    told = (*(line for one in fitted for line in lines(one)), *own.notes)
    opening = "; ".join([headlines(fitted), *([own.headline] if own.headline else [])])
    return Identified(
        own.parameters, (*scores(fitted), *own.scores), told, opening,
        (*served(fitted), *own.calibrated), own.doubts, values, own.inputs, own.mesh,
    )  # fmt: skip


# --- sentences on an identification: values, uncertainty, what is not identifiable ---------------

_AGAINST = "what calibrates"
_DIGITS = 4
_SHOWN = 4  # predictions in a sentence


def headlines(fitted: Sequence[Calibrated]) -> str:
    """Fitted on what; of several methods without their values, which stand below."""
    apart = [one for one in fitted if not one.problem.calibration.shared]
    methods = [one.problem.calibration.method for one in apart]
    if len(set(methods)) <= 1:
        return "; ".join(map(headline, fitted))
    on = " and ".join(dict.fromkeys(one.on for one in apart))
    shared = [headline(one) for one in fitted if one not in apart]
    return "; ".join([*shared, f"Fitted: {', '.join(methods)}, each by itself on {on}"])


def headline(one: Calibrated) -> str:
    """Fitted on what."""
    each = []
    for e in one.found.estimates:
        unit = unit_of(one, e.name)
        value, low, high = (with_unit(v, unit, _DIGITS) for v in (e.value, e.low, e.high))
        each.append(f"{e.name} = {value} (95 %: {low} to {high})")
    return f"Fitted: {', '.join(each)} with '{one.problem.calibration.method}' on {one.on}"


def unit_of(one: Calibrated, path: str) -> str:
    """Return the unit of what was identified."""
    return {p.path: p.unit for p in describe(one.problem.parts[0].parameters)}[path]


def fitted_sentence(opening: str, results: Sequence[MethodResult]) -> str:
    """Return what was fitted, and what is therefore predicted."""
    said = "; ".join(filter(None, (opening, predicted(results))))
    return f" {said[0].upper()}{said[1:]}."


def predicted(results: Sequence[MethodResult]) -> str:
    """Predicted what, within what: the accepted methods' checks that are evidence."""
    several = sum(bool(m.checks) for m in results) > 1
    found = [
        (c, f" by {m.name}" if several else "")
        for m in results for c in m.checks
        if c.count and (c.evidence or c.verdict == "undecided")
    ]  # fmt: skip
    if not found:
        return f"predicted: nothing, because {_no_evidence(results)}"
    each = []
    for c, by in found[:_SHOWN]:
        off, doubt = with_unit(abs(c.value), c.unit), with_unit(2 * c.u_val, c.unit)
        each.append(f"{c.name}{by} has an error of {off} (2 u_val {doubt})")
    more = f" and {len(found) - _SHOWN} others" if len(found) > _SHOWN else ""
    return f"predicted: {', '.join(each)}{more}"


def _no_evidence(results: Sequence[MethodResult]) -> str:
    """Why none of the checks is evidence: what they are, most of them first."""
    kinds = Counter(c.verdict if c.count else "no match" for m in results for c in m.checks)
    words = {"fitted": "were used for the fit", "same model": "only repeat the model"}
    each = (f"{n} of {kinds.total()} checks {words.get(kind, 'compared nothing')}"
            for kind, n in kinds.most_common())  # fmt: skip
    return ", ".join(each) or "nothing is checked"


def lines(one: Calibrated) -> tuple[str, ...]:
    """What is to be said of an identification: how sure it is, and what it is not."""
    found, p = one.found, len(one.found.space.ranges)
    misfit = (
        f"; the model leaves {found.misfit:.3g} times the variance of the noise; all intervals "
        f"are wider by a factor {found.misfit**0.5:.3g}"
        if found.misfit > 1
        else ""
    )
    how = (
        f"the residual is linear in it (checked at {found.best.evaluations} values), so the best "
        f"fit has a closed form"
        if found.linear
        else f"{found.found_again} of {len(found.fits)} starts ended at the best fit"
    )
    said = [
        f"{', '.join(found.space.names)}: {how} (chi-square {found.best.chi_square:.4g} over "
        f"{found.best.count} residuals less {p}){misfit}."
    ]
    pairs = zip(found.estimates, one.problem.free, strict=True)
    said += [f"{not_identified(one, e, free)}." for e, free in pairs if not e.identified]
    return tuple(said)


def not_identified(one: Calibrated, e: Profiled, free: Free) -> str:
    """Why, with its numbers, and the measurement that would help."""
    value, low, high = (
        with_unit(v, unit_of(one, e.name), _DIGITS) for v in (e.value, e.low, e.high)
    )
    return (
        f"{e.name} is not identifiable from {one.on}: {'; '.join(e.findings)} ({value}, 95 % {low} "
        f"to {high}); {helping(free)} would identify it"
    )


def helping(free: Free) -> str:
    """Return the measurement that would help."""
    return free.helps or "a measurement that depends on it and not on the others"


def scores(fitted: Iterable[Calibrated]) -> tuple[Score, ...]:
    """Every value with its interval, in SI."""
    found = []
    for one in fitted:
        for e in one.found.estimates:
            words = f"identified on {one.on}; 95 % profile interval {e.low:.6g} to {e.high:.6g}"
            found.append(
                Score(e.name, e.value, unit_of(one, e.name), one.found.best.count, _AGAINST, words)
            )
    return tuple(found)
