"""Kalman filters whose state is the displacement vector (paper 001), nodal or modal.

The state equation is Newmark's step, u' = J^-1 A u + J^-1 (L v + M a + f) (paper 001, eqs 11-14):
velocity and acceleration are inputs, recursed beside the filter and not part of its state, so P
knows nothing of them. Its transition J^-1 A alone decides P, hence the gains need no data.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.estimate.gating import Care, gate_numbers, gate_units
from validate.estimate.kalman.coordinates import (
    Batch,
    Coordinates,
    InModes,
    Nodal,
    batch_of,
    excitation_in,
    in_amplitudes,
    in_modes,
    stacked_gains,
)
from validate.estimate.kalman.covariance import (
    Claim,
    Claims,
    Covariance,
    Dense,
    GainSequence,
    shared_gains,
    walked,
)
from validate.estimate.kalman.formulas import (
    Gain,
    Innovation,
    Seen,
    innovation,
    innovation_units,
    nothing,
)
from validate.estimate.measurements import Measurements, Timetable
from validate.estimate.smoother import Look, Note, look_of, smoothed
from validate.fem.system import System
from validate.solve.dynamic.linear import Excitation, InertialStepper, Inputs
from validate.solve.types import State

Recursion = Literal["prior", "posterior"]
Structure = Literal["white", "load"]


@dataclass(frozen=True)
class Sensed:
    """Measurements and their time steps; rows H (m, n) of the coordinates, `driven` (m, k) of
    drives."""

    offered: Measurements
    table: Timetable
    H: Floats
    driven: Floats

    @property
    def names(self) -> tuple[str, ...]:
        return self.offered.names


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

    @property
    def offered(self) -> Measurements:
        return self.sensor.offered

    def unheard(self, numbers: Sequence[Mapping[str, float]]) -> str:
        """Why no measurement reached the estimate; empty where one did."""
        return self.sensor.table.unheard(len(numbers), numbers)

    def rest(self) -> State:
        zeros = np.zeros(len(self.covariance.P0))
        claim = None if self.gains else self.covariance.start()
        return State(0, Estimate(zeros, zeros, zeros, self.excitation.rest(), claim))

    def step(self, state: State, inputs: Floats) -> State:
        """Return the posterior at the end of a step; `inputs` are those there, loads included."""
        last: Estimate = state.inner
        k, of = state.k + 1, self.coordinates
        f, moved, a = self.excitation.step(k, inputs, last.inputs, last.a)
        prior = of.predict(last.x, last.v, a, f)
        corrected = self._heeded if self.care else self._corrected
        x, claim, gain, seen = corrected(prior, k, last, moved)
        towards = prior if self.recursion == "prior" else x
        v, a = of.rates(towards, last.x, last.v, a)
        look = None
        if self.smooth and gain is not None:
            turned = self.gains.before if self.gains else None
            look = look_of(turned.gains[k] if turned else gain, seen)
        inner = Estimate(x, v, a, moved, claim, look)
        if not np.isfinite(a.sum() + x.sum()):
            return State(k, inner, ("diverged", f"the estimate is not finite at step {k}"))
        numbers = {**seen.numbers(self.sensor.names), **gate_numbers(self.care, seen)}
        return State(k, inner, numbers={**numbers, **self._forces(inner)})

    def batch(self, inputs: Floats, z: Floats, rows: Floats) -> Batch | None:
        """Filter z (seeds, nt, m) m, NaN = missing, one row for each step of inputs (nt, k); `rows`
        (p, N) read the estimates.

        Estimates equal those of single runs, to rounding and the filter's own `settled`. None where
        gains depend on the data, damping couples the modes, the filter smooths, or the recordings
        were not measured at the same instants.
        """
        when, nt = dict(self.when), len(inputs)
        planned = np.array([when.get(k + 1, (False,) * z.shape[2]) for k in range(nt)])
        if (np.isfinite(z) != planned).any() or (shared := self._sharing()) is None:
            return None
        modes, gains, excited = shared.coordinates, shared.gains, shared.excitation
        assert isinstance(modes, InModes)
        assert gains is not None
        forces, q, begin = excited.walk(inputs)
        stacked = stacked_gains(gains, nt, z.shape[2], len(modes.shapes.T))
        read = rows[:, self.system.free] @ modes.shapes
        moved = q @ (rows @ self.system.moves).T
        rule, offset = modes.rule, q @ self.sensor.driven.T
        weights = np.array([rule.h, rule.b0, rule.b1, rule.g0, rule.g1])
        walks = [
            walked(np.array(modes.factors), weights, forces, begin, self.recursion == "prior",
                   stacked.which, stacked.G, shared.sensor.H, own - offset, read)
            for own in z
        ]  # fmt: skip
        values, y = (np.array(column) for column in zip(*walks, strict=True))
        return batch_of(gains, values + moved, y, stacked, planned.sum(axis=1).astype(float))

    def _sharing(self) -> "DisplacementStepper | None":
        """The same filter in modes with gains computed beforehand; None where there is none."""
        if self.care is not None or self.smooth:
            return None
        modes, covariance = self.claimed, self.covariance
        if not isinstance(modes, InModes):
            try:
                modes = in_modes(self.system, self.excitation.rule)
            except SceneError:  # damping couples the modes
                return None
        if isinstance(covariance, Dense):
            covariance = in_amplitudes(covariance, modes)
        gains, nodal = self.gains, isinstance(self.coordinates, Nodal)
        if gains is None:
            gains = shared_gains(self.system, covariance, self.sensor.table, self.settled)
        elif nodal:
            known = gains.before if self.claimed is modes else None
            gains = known or gains.mapped(modes.amplitudes)
        return replace(
            self,
            excitation=excitation_in(modes, self.excitation) if nodal else self.excitation,
            coordinates=modes,
            claimed=modes,
            covariance=covariance,
            gains=gains,
            sensor=replace(self.sensor, H=covariance.H),
        )

    def _forces(self, e: Estimate) -> Mapping[str, float]:
        if not self.reactions.names:
            return {}
        of = self.coordinates
        return self.forces(of.free(e.x), of.free(e.v), of.free(e.a), e.inputs)

    def _corrected(
        self, prior: Floats, step: int, last: Estimate, inputs: Inputs
    ) -> tuple[Floats, Claim | None, Gain | None, Innovation]:
        claim: Claim | None = None
        if self.gains is not None:
            gain = self.gains.at(step)
        else:
            assert last.claim is not None
            gain, claim = None, self.covariance.predict(last.claim)
            if (seen := self.when.get(step)) is not None:
                gain, claim = self.covariance.update(claim, seen)
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
        raise SceneError("a load-shaped Q needs a load in the scene; use the white Q")
    shapes = system.factor().solve(np.ascontiguousarray(system.loads[system.free]))
    most = np.abs(H @ shapes).max(axis=0)
    if most.min() <= 1e-9 * np.abs(shapes).max():
        raise SceneError(
            "a load moves no measured component, so its shape cannot be "
            "estimated; measure where it moves the body"
        )
    return np.asarray(shapes / most)
