"""Stepper of filters with several model members, each with its own parameters.

Between measurements every member is a run of the model; at one, an `Analysis` corrects states and
parameters together. What is estimated is the members' mean, with their spread.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, Literal, Protocol, cast

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import UsageError
from validate.estimate.ensemble.members import (
    Coordinates,
    Doubts,
    Members,
    doubts,
    explicit_members,
    implicit_members,
    in_nodes,
)
from validate.estimate.extended import kernels as kernel
from validate.estimate.extended.explicit_filter import FAR, MARGIN, explicit_step
from validate.estimate.gating import (
    Care,
    care_of,
    clock_setting,
    gate_numbers,
    gate_setting,
    gate_units,
    gated_out,
)
from validate.estimate.kalman.coordinates import OneAtATime
from validate.estimate.kalman.formulas import Corrected, Innovation, innovation_units, nothing
from validate.estimate.measurements import Measurements, Timetable
from validate.fem.critical import CriticalStep
from validate.fem.system import System
from validate.parameters import quantity
from validate.scene.scene import Scene
from validate.solve.dynamic.linear import StartName
from validate.solve.dynamic.newmark_rule import Rule
from validate.solve.handles import LARGE, Handles
from validate.solve.types import Ending, State

_AWAY = 6 * np.log(10)  # of a scale's logarithm: six orders of magnitude
NORMAL_95 = 1.959963984540054  # sd either side that hold 95 % of a normal law
HANDLES = Handles(("linear", *LARGE), inertia=True, cavities=False, drives=False)


@dataclass(frozen=True)
class MemberModel:
    """Model of the members: their uncertain parameters (`doubtful`) and their step.

    A linear scene steps implicitly by Newmark's rule, in few shapes or in all nodes; one at large
    strain explicitly, in all nodes, with a step that the stiffest member must bear.
    """

    dt: float = quantity(0.002, "s", "time step of the run")
    substeps: int = quantity(1, "1", "steps of the members in each; loads are interpolated")
    parameters: tuple[str, ...] = quantity(
        ("stiffness",), "1", "stiffness[.region|.body], support.<facets>, load.<load>, bias.<load>"
    )
    sd: tuple[float, ...] = quantity(
        (0.25,), "1", "of every scale's logarithm at the start; one for all, or one for each"
    )
    bias_sd: float = quantity(0.1, "N", "of every bias at the start")
    R: float | None = quantity(None, "m2", "variance of a measurement; none: declared")
    rule: Literal["average", "backward_euler"] = quantity("average", "1", "of a linear scene")
    a0: StartName = quantity("equilibrium", "1", "of a linear scene: M^-1 f, or zero")
    coordinates: Coordinates = quantity("shapes", "1", "of a linear scene: few shapes, or nodes")
    shapes: int = quantity(6, "1", "of every load, with each tested stiffness")
    gate: float | None = gate_setting()
    clock: float | None = clock_setting()
    inflation: float = quantity(
        1.0, "1", "factor on the members' distance from their mean at each update"
    )
    beyond_limit: Literal["refuse", "run"] = quantity(
        "refuse", "1", "an explicit step above the critical step of the stiffest member"
    )

    def __post_init__(self) -> None:
        if not (self.dt > 0 and self.substeps >= 1 and self.parameters):
            raise UsageError(
                f"dt {self.dt:g} s in {self.substeps} substeps of {len(self.parameters)} parameters"
                ": all must be above 0"
            )
        if self.R is not None and not self.R > 0:
            raise UsageError(f"R = {self.R:g} m2: a variance above 0")
        if not self.inflation >= 1:
            raise UsageError(f"inflation {self.inflation:g}: 1 or more")

    @property
    def h(self) -> float:
        """A member's step s."""
        return self.dt / self.substeps

    def doubts(self, scene: Scene) -> Doubts:
        return doubts(scene, self.parameters, self.sd, self.bias_sd)

    def members(self, system: System) -> Members:
        """Raise `SceneError` for what no member can step, `UsageError` for parameters that the
        scene does not have."""
        of = self.doubts(system.scene)
        if system.scene.material.law != "linear":
            return explicit_members(explicit_step(system, self.dt, self.substeps), of)
        rule, at_once = Rule.of(self.rule, self.h), self.a0 == "equilibrium"
        return implicit_members(system, of, rule, self.coordinates, self.shapes, at_once)

    def limit(self, system: System) -> float:
        """Return the largest step s of a member as stiff as the model; infinite where none is."""
        if system.scene.material.law == "linear" or self.beyond_limit == "run":
            return np.inf
        return (1 - MARGIN) * CriticalStep.of(system).lanczos


class Analysis(Protocol):
    """What happens to members; `x` (s, p) are their parameters' coordinates."""

    def start(self) -> Floats: ...

    def walked(self, x: Floats, number: int) -> Floats:
        """After a step; the same object where nothing walks."""
        ...

    def claimed(self, seen: Floats) -> Floats:
        """Covariance (m, m) m^2 of what members would show (s, m)."""
        ...

    def corrected(self, Z: Floats, seen: Floats, z: Floats, R: Floats, number: int) -> Corrected:
        """Of states and coordinates Z (s, n + p) by z (m,) m, NaN = missing, of noise R (m, m)."""
        ...

    @property
    def degrees(self) -> int:
        """What the members' squared distances from their mean are divided by."""
        ...


@dataclass(frozen=True)
class Sight:
    """What is measured of a member: `rows` (m, c) of the columns `at` (c,) of its state; its noise
    R (m, m) m^2, and the care it is taken with."""

    offered: Measurements
    times: Timetable
    rows: Floats
    at: Ints
    R: Floats
    care: Care | None

    def of(self, X: Floats) -> Floats:
        """(s, m) m."""
        return np.asarray(X[:, self.at] @ self.rows.T)


def sight(model: MemberModel, members: Members, measurements: Measurements) -> Sight:
    """Raise `ComparisonError` for times off the members' steps, `UsageError` as `care_of`."""
    H, shapes = measurements.H, members.displaced
    at = np.unique(H.indices) if shapes is None else np.arange(len(shapes))
    rows = H[:, at].toarray() if shapes is None else H @ shapes.T
    times, R = measurements.timetable(model.h), np.diag(measurements.variances(model.R))
    care = care_of(measurements, model.gate, model.clock, model.h)
    return Sight(measurements, times, np.asarray(rows), at.astype(np.int64), R, care)


@dataclass(frozen=True)
class MemberStates:
    """States X (s, n), coordinates x (s, p), what members step with, and the last inputs (l,)."""

    X: Floats
    x: Floats
    ready: Any
    inputs: Floats


@dataclass(frozen=True)
class MemberStepper(OneAtATime):
    """`limit` s is the step that a member as stiff as the model bears."""

    model: MemberModel
    members: Members
    analysis: Analysis
    sight: Sight
    limit: float

    @property
    def offered(self) -> Measurements:
        return self.sight.offered

    @property
    def scene(self) -> Scene:
        return self.members.system.scene

    @property
    def units(self) -> Mapping[str, str]:
        """NIS with its degrees, innovations with their sd, and the estimates: value, 95 % interval,
        share of the start's sd that is left, correlations."""
        units = {**innovation_units(self.offered.names), **gate_units(self.sight.care)}
        for p in self.members.doubts.parameters:
            name = f"estimate.{p.name}"
            units |= {name: p.unit, f"{name}.low": p.unit, f"{name}.high": p.unit}
            units |= {f"{name}.left": "1"}
        return units | dict.fromkeys(self._pairs.values(), "1")

    @property
    def _pairs(self) -> dict[tuple[int, int], str]:
        names = self.members.doubts.names
        pairs = combinations(range(len(names)), 2)
        return {(i, j): f"correlation.{names[i]}~{names[j]}" for i, j in pairs}

    def rest(self) -> State:
        x = self.analysis.start()
        X = np.zeros((len(x), self.members.size))
        return State(0, MemberStates(X, x, self.members.ready(x), np.zeros(len(self.scene.inputs))))

    def step(self, state: State, inputs: Floats) -> State:
        """Return the posterior at the end of a step of `substeps` parts; `inputs` are the loads
        there."""
        if state.k == 0 and (failure := self._refused(state.inner.x)):
            return replace(state, failure=failure)
        last, found = cast(MemberStates, state.inner), nothing(len(self.offered.names))
        now, parts = last, self.model.substeps
        for part in range(parts):
            begin, end = (
                last.inputs + s / parts * (inputs - last.inputs) for s in (part, part + 1)
            )
            number = state.k * parts + part + 1
            before, now = now, self._moved(replace(now, inputs=end), begin, number)
            if failure := self._lost(now.X):
                return replace(state, failure=failure)
            z = self.sight.times.at(number)
            if z is None:
                continue
            try:
                now, new = self._corrected(now, before, z, number)
            except np.linalg.LinAlgError as singular:
                return replace(state, failure=("diverged", f"step {state.k + 1}: {singular}"))
            found = new.after(found)
            if failure := self._away(now.x) or self._refused(now.x):
                return replace(state, failure=failure)
            now = replace(now, ready=self._ready(before, now.x))
        numbers = {
            **found.numbers(self.offered.names),
            **gate_numbers(self.sight.care, found),
        }
        return State(state.k + 1, now, numbers=numbers | dict(self._estimates(now.x)))

    def unheard(self, numbers: Sequence[Mapping[str, float]]) -> str:
        """Why no measurement reached the estimate; empty where one did."""
        return self.sight.times.unheard(len(numbers) * self.model.substeps, numbers)

    def _moved(self, now: MemberStates, begin: Floats, number: int) -> MemberStates:
        x = self.analysis.walked(now.x, number)
        ready = self._ready(now, x)
        X = self.members.step(ready, now.X, x, begin, now.inputs, number)
        return MemberStates(X, x, ready, now.inputs)

    def _ready(self, now: MemberStates, x: Floats) -> Any:
        """What members step with, anew only where a stiffness is another."""
        if x is now.x or not self.members.doubts.columns("stiffness", "support"):
            return now.ready
        return self.members.ready(x)

    def _corrected(
        self, now: MemberStates, before: MemberStates, z: Floats, number: int
    ) -> tuple[MemberStates, Innovation]:
        n, Z = now.X.shape[1], np.hstack([now.X, now.x])
        if self.model.inflation != 1:
            Z = Z.mean(axis=0) + self.model.inflation * (Z - Z.mean(axis=0))
        seen, R, gated, care = self.sight.of(Z), self.sight.R, None, self.sight.care
        offered = z
        shown = seen.mean(axis=0)
        if care is not None:
            R = R + care.together(shown - self.sight.of(before.X).mean(axis=0))
            z, gated = care.passed(z, shown, self.analysis.claimed(seen) + R)
        if not np.isfinite(z).any():
            return now, gated_out(nothing(len(z)), offered, shown, gated)
        after = self.analysis.corrected(Z, seen, z, R, number)
        X, x = np.ascontiguousarray(after.members[:, :n]), after.members[:, n:]
        found = gated_out(after.innovation, offered, shown, gated)
        return MemberStates(X, x, now.ready, now.inputs), found

    def _refused(self, x: Floats) -> tuple[Ending, str] | None:
        """Of a step that the stiffest member does not bear."""
        stiffest, h = self.members.doubts.stiffest(x), self.model.h
        if h * np.sqrt(stiffest) <= self.limit:
            return None
        substeps = int(np.ceil(self.model.dt * np.sqrt(stiffest) / self.limit))
        return "refused", (
            f"the stiffest of {len(x)} members is {stiffest:.3g} times as stiff as the model: "
            f"steps of {h:g} s are beyond its {self.limit / np.sqrt(stiffest):.3g} s (critical, "
            f"less {100 * MARGIN:g} %); take substeps = {substeps} or a smaller sd"
        )

    def _away(self, x: Floats) -> tuple[Ending, str] | None:
        """Of a scale that no body has: what was measured is none of the model's displacements."""
        doubts = self.members.doubts
        scales = list(doubts.columns("stiffness", "support", "load"))
        largest = np.abs(x[:, scales]).max(axis=0, initial=0.0)
        if not (largest > _AWAY).any():
            return None
        name = doubts.names[scales[int(largest.argmax())]]
        return "diverged", (
            f"a member of {len(x)} has {name} more than 1e{_AWAY / np.log(10):.0f} times away "
            "from the model's: set a gate against outliers, or a larger R for what the model "
            "cannot follow"
        )

    def _lost(self, X: Floats) -> tuple[Ending, str] | None:
        far = FAR * float(np.ptp(self.scene.mesh.nodes, axis=0).max())
        shapes = self.members.displaced
        if shapes is None:
            u = X
        else:
            own = self.members.nodes is not None
            u = X[:, : len(shapes)] if own else in_nodes(self.members, X)
        largest = kernel.farthest(np.ravel(u))
        if largest < far:
            return None
        found = f"moved by {largest:.3g} m" if np.isfinite(largest) else "is not finite"
        return "diverged", f"a member of {len(X)} {found} in a body of {far / FAR:.3g} m"

    def _estimates(self, x: Floats) -> Mapping[str, float]:
        numbers: dict[str, float] = {}
        mean, off = x.mean(axis=0), x - x.mean(axis=0)
        P = off.T @ off / self.analysis.degrees
        sd = np.sqrt(np.diag(P))
        for j, p in enumerate(self.members.doubts.parameters):
            low, value, high = (p.value(mean[j] + s * NORMAL_95 * sd[j]) for s in (-1, 0, 1))
            name = f"estimate.{p.name}"
            numbers |= {name: value, f"{name}.low": low, f"{name}.high": high}
            numbers |= {f"{name}.left": float(sd[j] / p.sd)}
        for (i, j), name in self._pairs.items():
            both = sd[i] * sd[j]
            numbers[name] = float(P[i, j] / both) if both > 0 else 0.0
        return numbers

    def field(self, state: State) -> Floats:
        """Mean displacements (n, d) m of the members."""
        u = in_nodes(self.members, state.inner.X.mean(axis=0)[None, :])
        return np.asarray(u[0].reshape(self.scene.mesh.nodes.shape))

    def sd(self, state: State) -> Floats:
        """Standard deviations (n, d) m of the members."""
        u = in_nodes(self.members, state.inner.X)
        squares = ((u - u.mean(axis=0)) ** 2).sum(axis=0) / self.analysis.degrees
        return np.asarray(np.sqrt(squares).reshape(self.scene.mesh.nodes.shape))
