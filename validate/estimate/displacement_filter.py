"""Kalman filters whose state is the displacement vector: paper 001's, in two sets of coordinates.

The state equation is Newmark's step, u' = J^-1 A u + J^-1 (L v + M a + f) (paper 001, eqs 11-14):
velocity and acceleration are inputs, recursed beside the filter and not part of its state, so P
knows nothing of them. Its transition J^-1 A alone decides P, hence the gains need no data.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, Protocol

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.estimate.care import Care, gate_numbers, gate_units
from validate.estimate.covariance import Claim, Covariance
from validate.estimate.gains import Claims, GainSequence
from validate.estimate.kalman import (
    Gain,
    Innovation,
    Seen,
    innovation,
    innovation_units,
    nothing,
)
from validate.estimate.measurements import Timetable
from validate.estimate.smoother import Look, Note, look_of, smoothed
from validate.fem.system import System
from validate.solve.dynamic import InertialStepper
from validate.solve.excitation import Excitation, Inputs
from validate.solve.newmark_rule import Propagation, Rule
from validate.solve.types import State

Recursion = Literal["prior", "posterior"]
Structure = Literal["white", "load"]


class Coordinates(Protocol):
    """In what the state (n,) is kept: nodal displacements or modal amplitudes."""

    def predict(self, x: Floats, v: Floats, a: Floats, f: Floats) -> Floats:
        """x' under forces f (n,) in these coordinates."""
        ...

    def forces(self, f: Floats) -> Floats:
        """Forces (m, k) N on the free unknowns, in these coordinates (n, k)."""
        ...

    def rates(self, new: Floats, x: Floats, v: Floats, a: Floats) -> tuple[Floats, Floats]: ...

    def free(self, x: Floats) -> Floats:
        """Values (m,) of the free unknowns."""
        ...

    def amplitudes(self, u: Floats) -> Floats:
        """The coordinates of u (m,) or (m, k)."""
        ...

    def variances(self, P: Floats) -> Floats:
        """Diagonal (m,) of the free unknowns' covariance."""
        ...


@dataclass(frozen=True)
class Nodal:
    """The free unknowns themselves."""

    propagation: Propagation

    def predict(self, x: Floats, v: Floats, a: Floats, f: Floats) -> Floats:
        return self.propagation.predict(x, v, a, f)

    def forces(self, f: Floats) -> Floats:
        return f

    def rates(self, new: Floats, x: Floats, v: Floats, a: Floats) -> tuple[Floats, Floats]:
        return self.propagation.rates(new, x, v, a)

    def free(self, x: Floats) -> Floats:
        return x

    def amplitudes(self, u: Floats) -> Floats:
        return u

    def variances(self, P: Floats) -> Floats:
        return np.diag(P)


@dataclass(frozen=True)
class InModes:
    """Amplitudes of all modes: `shapes` (m, r), M-orthonormal, `dual` = M shapes.

    `factors` (r,) each of q, v, a and the modal force make the step.
    """

    shapes: Floats
    dual: Floats
    factors: tuple[Floats, Floats, Floats, Floats]
    rule: Rule

    @cached_property
    def white(self) -> Floats:
        """What equal variance of every unknown is in amplitudes (r, r)."""
        return np.asarray(self.dual.T @ self.dual)

    def predict(self, x: Floats, v: Floats, a: Floats, f: Floats) -> Floats:
        fq, fv, fa, ff = self.factors
        return fq * x + fv * v + fa * a + ff * f

    def forces(self, f: Floats) -> Floats:
        return np.ascontiguousarray(self.shapes.T @ f)

    def rates(self, new: Floats, x: Floats, v: Floats, a: Floats) -> tuple[Floats, Floats]:
        return self.rule.rates(new, x, v, a)

    def free(self, x: Floats) -> Floats:
        return self.shapes @ x

    def amplitudes(self, u: Floats) -> Floats:
        return self.dual.T @ u

    def variances(self, P: Floats) -> Floats:
        return np.asarray(np.einsum("ij,ij->i", self.shapes @ P, self.shapes))


@dataclass(frozen=True)
class Sensed:
    """Where measurements land, and rows: H (m, n) of the coordinates, `driven` (m, k) of drives."""

    names: tuple[str, ...]
    table: Timetable
    H: Floats
    driven: Floats


@dataclass(frozen=True)
class Estimate:
    """State (n,) with its rates, the inputs, and what is claimed (None: precomputed).

    To be smoothed: `look`, its gain in the coordinates of the claim; smoothed: `sd` (m,) m of the
    free unknowns at output frames.
    """

    x: Floats
    v: Floats
    a: Floats
    inputs: Inputs
    claim: Claim | None
    look: Look | None = None
    sd: Floats | None = None


class Spread:
    """Standard deviations (m,) of the free unknowns; those of the last claim are kept, since a
    settled claim is asked for at every output frame."""

    def __init__(self, coordinates: Coordinates, covariance: Covariance) -> None:
        self._coordinates, self._covariance = coordinates, covariance
        self._last: tuple[Claim, Floats] | None = None

    def at(self, claim: Claim) -> Floats:
        if self._last is None or self._last[0] is not claim:
            variances = self._coordinates.variances(self._covariance.matrix(claim))
            self._last = claim, np.sqrt(np.maximum(variances, 0.0))
        return self._last[1]


@dataclass(frozen=True)
class DisplacementStepper(InertialStepper):
    """One filter step: predict, correct where something was measured, recurse v and a.

    With `gains` they were computed before; without, the covariance is recursed at every step. It
    is recursed in the coordinates `claimed`; `excitation` is in `coordinates`. With `care` gains
    depend on what is measured, so there are none beforehand.
    """

    coordinates: Coordinates
    excitation: Excitation
    covariance: Covariance
    sensor: Sensed
    when: Mapping[int, Seen]
    gains: GainSequence | None
    recursion: Recursion
    claimed: Coordinates
    settled: float
    care: Care | None
    smooth: bool
    _claims: Claims = field(init=False)
    _spread: "Spread" = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_claims", Claims(self.covariance, self.when, self.settled))
        object.__setattr__(self, "_spread", Spread(self.claimed, self.covariance))

    @property
    def units(self) -> Mapping[str, str]:
        """NIS with its degrees, innovations with their sd, and the drives' forces."""
        gate = gate_units(self.care)
        return {**innovation_units(self.sensor.names), **gate, **super().units}

    def unheard(self, numbers: Sequence[Mapping[str, float]]) -> str:
        """Why no measurement reached the estimate; empty where one did."""
        return self.sensor.table.unheard(len(numbers), numbers)

    def rest(self) -> State:
        zeros = np.zeros(len(self.covariance.P0))
        claim = None if self.gains else self.covariance.start()
        return State(0, Estimate(zeros, zeros, zeros, self.excitation.rest(), claim))

    def step(self, state: State, inputs: Floats) -> State:
        """The posterior at the end of a step; `inputs` are those there, loads included."""
        last: Estimate = state.inner
        k, of = state.k + 1, self.coordinates
        f, moved, a = self.excitation.step(k, inputs, last.inputs, last.a)
        prior = of.predict(last.x, last.v, a, f)
        corrected = self._heeded if self.care else self._corrected
        x, claim, gain, seen = corrected(prior, k, last, moved)
        towards = prior if self.recursion == "prior" else x
        v, a = of.rates(towards, last.x, last.v, a)
        inner = Estimate(x, v, a, moved, claim, self._look(k, gain, seen))
        if not np.isfinite(a.sum() + x.sum()):
            return State(k, inner, ("diverged", f"the estimate is not finite at step {k}"))
        numbers = {**seen.numbers(self.sensor.names), **gate_numbers(self.care, seen)}
        return State(k, inner, numbers={**numbers, **self._forces(inner)})

    def _forces(self, e: Estimate) -> Mapping[str, float]:
        if not self.reactions.names:
            return {}
        of = self.coordinates
        return self.forces(of.free(e.x), of.free(e.v), of.free(e.a), e.inputs)

    def _gain(self, step: int, claim: Claim | None) -> tuple[Gain | None, Claim | None]:
        if self.gains is not None:
            return self.gains.at(step), None
        assert claim is not None
        prior, seen = self.covariance.predict(claim), self.when.get(step)
        return (None, prior) if seen is None else self.covariance.update(prior, seen)

    def _corrected(
        self, prior: Floats, step: int, last: Estimate, inputs: Inputs
    ) -> tuple[Floats, Claim | None, Gain | None, Innovation]:
        gain, claim = self._gain(step, last.claim)
        z = self.sensor.table.at(step)
        if z is None or gain is None:
            return prior, claim, None, nothing(len(self.sensor.names))
        found = innovation(z, self._shown(prior, inputs), gain)
        return prior + gain.G @ found.y[np.array(gain.seen)], claim, gain, found

    def _heeded(
        self, prior: Floats, step: int, last: Estimate, inputs: Inputs
    ) -> tuple[Floats, Claim | None, Gain | None, Innovation]:
        """With a gain of this very look."""
        assert self.care is not None
        assert last.claim is not None
        z, claim = self.sensor.table.at(step), self.covariance.predict(last.claim)
        if z is None:
            return prior, claim, None, nothing(len(self.sensor.names))
        shown = self._shown(prior, inputs)
        moved = shown - self._shown(last.x, last.inputs)
        gain, claim, found, _ = self.care.update(self.covariance, claim, z, shown, moved)
        if gain is None:
            return prior, claim, None, found
        return prior + self._turned(gain.G @ found.y[np.array(gain.seen)]), claim, gain, found

    def _turned(self, dx: Floats) -> Floats:
        """From the coordinates of what is claimed to those of the state."""
        return self.claimed.free(dx) if isinstance(self.coordinates, Nodal) else dx

    def _shown(self, x: Floats, inputs: Inputs) -> Floats:
        """Measured components (m,) m of a state and its drives."""
        return self.sensor.H @ x + self.sensor.driven @ inputs.q

    def field(self, state: State) -> Floats:
        """Displacements (n, d) m of all nodes."""
        inner: Estimate = state.inner
        return self.nodal(self.coordinates.free(inner.x), inner.inputs.q)

    def sd(self, state: State) -> Floats:
        """Claimed standard deviations (n, d) m; prescribed unknowns have none."""
        sd = state.inner.sd
        sd = self._spread.at(self._claim(state)) if sd is None else sd
        return self.nodal(sd, np.zeros(0))

    def _claim(self, state: State) -> Claim:
        claim = state.inner.claim
        return self._claims.at(state.k) if claim is None else claim

    # --- smoothing --------------------------------------------------------------------------------

    def _look(self, step: int, gain: Gain | None, found: Innovation) -> Look | None:
        if not self.smooth or gain is None:
            return None
        turned = self.gains.before if self.gains else None
        return look_of(turned.gains[step] if turned else gain, found)

    def note(self, state: State, framed: bool) -> Note:
        return Note(state.inner.look, framed)

    def smoother(self, notes: Sequence[Note]) -> Callable[[State], State]:
        """Displacements with their claims, and forces of the drives at the filter's own rates."""
        found = smoothed(self.covariance, notes)

        def shown(state: State) -> State:
            e: Estimate = state.inner
            x = e.x + self._turned(found.after(state.k))
            W = found.roots.get(state.k)
            inner = replace(e, x=x, sd=None if W is None else self._narrowed(state, W))
            return replace(state, inner=inner, numbers={**state.numbers, **self._forces(inner)})

        return shown

    def _narrowed(self, state: State, W: Floats) -> Floats:
        """Standard deviations (m,) m of the free unknowns from P - (P W)(P W)^T."""
        claim = self._claim(state)
        known = self.claimed.free(self.covariance.matrix(claim) @ W)
        variances = self._spread.at(claim) ** 2 - (known**2).sum(axis=1)
        return np.asarray(np.sqrt(np.maximum(variances, 0.0)))


def load_shapes(system: System, H: Floats) -> Floats:
    """Static displacements (m, l) of every load, each 1 where it moves a measured component most.

    Raises `SceneError` for a scene without loads, or one whose loads move nothing that is measured.
    """
    if not system.scene.loads:
        raise SceneError("a load-shaped Q needs a load in the scene; use the white one")
    shapes = system.factor().solve(np.ascontiguousarray(system.loads[system.free]))
    most = np.abs(H @ shapes).max(axis=0)
    if most.min() <= 1e-9 * np.abs(shapes).max():
        raise SceneError("a load moves no measured component: its shape cannot be estimated there")
    return np.asarray(shapes / most)
