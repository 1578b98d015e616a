"""Which times a guest is asked for, and what its answers say of all the others.

An elastic body in equilibrium knows its inputs and no history, so that statics need not be asked
again where the inputs are the same, nor everywhere where one input alone changes.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from validate.arrays import Floats, Ints
from validate.scene.prony import Prony
from validate.scene.scene import Scene
from validate.solve.types import Run, Trace


@dataclass(frozen=True)
class Asked:
    """Times t (k,) s with inputs (k, l), and what makes their run one of all times."""

    t: Floats
    inputs: Floats
    answered: Callable[[Run], Run]


def plain_questions(t: Floats, inputs: Floats) -> Asked:
    """Every time."""
    return Asked(t, inputs, lambda run: run)


def changes(t: Floats, inputs: Floats) -> Asked:
    """The times at t (nt,) s whose inputs (nt, l) are others than before."""
    new = np.concatenate([[True], np.any(np.diff(inputs, axis=0) != 0, axis=1)])[: len(t)]
    kept = np.flatnonzero(new)
    return Asked(t[kept], inputs[kept], lambda run: _repeated(run, kept, t))


def _repeated(run: Run, kept: Ints, t: Floats) -> Run:
    """Each time with the last answer before it; one that gave up ends before the next."""
    upto = len(t) if len(run.t) == len(kept) else int(kept[len(run.t)])
    of = np.searchsorted(kept, np.arange(upto), side="right") - 1
    traces = {name: replace(trace, y=trace.y[of]) for name, trace in run.traces.items()}
    return _at_all(run, t[:upto], run.u[of], traces)


def at_levels(t: Floats, inputs: Floats, levels: int) -> Asked:
    """Even levels from 0 to the input (nt, 1) of the largest size, and splines through them."""
    y = inputs[:, 0]
    peak, other = float(y[np.argmax(np.abs(y))]), float(np.min(y * np.sign(np.sum(y))))
    if peak == 0 or other < -abs(peak) / levels:  # to both sides: no one path to the largest
        return changes(t, inputs)
    grid = peak * np.arange(1, levels + 1) / levels
    return Asked(np.arange(1.0, levels + 1), grid[:, None], lambda run: _between(run, grid, t, y))


def _between(run: Run, grid: Floats, t: Floats, y: Floats) -> Run:
    """Splines of fields and traces through the levels, through nothing at 0; up to the first time
    beyond what was reached."""
    reached = grid[: len(run.t)]
    if not len(reached):
        return run
    sign = np.sign(reached[-1])
    beyond = np.abs(y) > np.abs(reached[-1]) * (1 + 1e-9)
    upto = int(np.argmax(beyond)) if beyond.any() else len(t)
    at, knots = sign * y[:upto], np.concatenate([[0.0], np.abs(reached)])

    def spline(values: Floats) -> Floats:
        through = np.concatenate([np.zeros((1, *values.shape[1:])), values])
        return np.asarray(CubicSpline(knots, through)(at))

    traces = {n: replace(trace, y=spline(trace.y)) for n, trace in run.traces.items()}
    words = f"solved at {len(grid)} levels of its input, with splines between them"
    run = replace(run, said=(*run.said, words))
    return _at_all(run, t[:upto], spline(run.u), traces)


def _at_all(run: Run, t: Floats, u: Floats, traces: Mapping[str, Trace]) -> Run:
    outcome = replace(run.outcome, step=len(t))
    return replace(
        run, t=t, at=np.arange(len(t)), u=u, traces=traces, outcome=outcome, seconds=None
    )


def at_rest(scene: Scene) -> Scene:
    """The scene whose stress has relaxed, where its statics stand for that."""
    material = getattr(scene, "material", None)
    if material is None or material.prony.statics != "relaxed":
        return scene
    return replace(scene, material=replace(material, prony=Prony()))
