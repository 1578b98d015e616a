"""Uncertainty budgets of calibrated parameters: noise from the profile, inputs and mesh besides.

One parameter of a judged method is identified again with every declared input moved by one standard
uncertainty and on every mesh, to first order: dv = -(J^T dr) / (J^T J), dr the change of the
residuals. Of several parameters, and of methods that are not judged, only the term "noise" is
known; the value says so.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import hypot
from typing import Any

import numpy as np
from scipy.stats import norm

from validate.errors import ValidateError
from validate.identify.budget import NOISE, IdentifiedValue
from validate.identify.least_squares import STEP
from validate.parameters import describe
from validate.replay.calibrated_words import unit_of
from validate.replay.experiment import Experiment
from validate.replay.fitted_moduli import on_meshes
from validate.replay.problem import Calibrated, Problem, with_free

_TWO_SIDED = float(norm.ppf(0.975))
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
        moved = _changed(problem, one, change).residual(x)
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
            meshes = on_meshes(here, declared.mesh, e.value, _on_mesh(again))
        except ValidateError:  # a ladder of fewer than three sizes
            return found
        found["mesh"] = meshes.u * e.value
    return {name: u for name, u in found.items() if np.isfinite(u)}


def _on_mesh(again: Callable[[Callable[[Any], Any]], float]) -> Callable[[Any], float]:
    """The parameter on the mesh that parameters have."""

    def modulus(changed: Any) -> float:
        return again(lambda _: changed)

    return modulus


def _changed(problem: Problem, one: Calibrated, change: Callable[[Any], Any]) -> Problem:
    parts = tuple(
        replace(part, parameters=change(with_free(part.parameters, one.values)))
        for part in problem.parts
    )
    return replace(problem, parts=parts)


def _moves_itself(one: Calibrated, used: Any, change: Callable[[Any], Any]) -> float | None:
    """Where an input moves the identified parameter; None where it does not."""
    here = with_free(used, one.values)
    ((name, value),) = one.values.items()
    moved = {p.path: p.default for p in describe(change(here))}[name]
    return None if moved == value or moved is None else float(moved)
