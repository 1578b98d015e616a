"""Many seeds of one experiment in one walk: they share the gains, which no measurement changes."""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats, checked
from validate.errors import ComparisonError
from validate.estimate.displacement_filter import DisplacementStepper, InModes
from validate.estimate.gains import GainSequence


@dataclass(frozen=True)
class Batch:
    """values (seeds, nt, p) m read from the estimates; nis (seeds, nt) with its degrees (nt,)."""

    values: Floats
    nis: Floats
    dof: Floats


def shared_gain_run(stepper: DisplacementStepper, inputs: Floats, z: Floats, rows: Floats) -> Batch:
    """Filters z (seeds, nt, m) m, NaN = missing, one row for each step of inputs (nt, k).

    `stepper` is a `ModalKf(gains="shared")` prepared with measurements of the same schedule;
    rows (p, N) read what is wanted. Raises `ComparisonError` for other steppers and schedules.
    """
    modes, gains = stepper.coordinates, stepper.gains
    if not isinstance(modes, InModes) or gains is None:
        raise ComparisonError('seeds share a walk of ModalKf(gains="shared"); prepare that')
    m, nt = len(stepper.sensor.names), len(inputs)
    z = checked(z, "z [m]", (None, nt, m), nan=True, error=ComparisonError)
    _require_schedule(stepper, z)
    walk = _Seeds(stepper, modes, gains, len(z))
    free = stepper.system.free
    read, driven = rows[:, free] @ modes.shapes, rows @ stepper.system.moves
    values, nis = np.empty((len(z), nt, len(rows))), np.zeros((len(z), nt))
    for k in range(nt):
        nis[:, k] = walk.step(inputs[k], z[:, k])
        values[:, k] = (read @ walk.x + (driven @ inputs[k][: driven.shape[1]])[:, None]).T
    dof = np.array([float(sum(stepper.when.get(k + 1, ()))) for k in range(nt)])
    return Batch(values, nis, dof)


def _require_schedule(stepper: DisplacementStepper, z: Floats) -> None:
    """The gains are those of one schedule: every seed must have been measured by it."""
    planned = np.zeros(z.shape[1:], dtype=bool)
    for step, seen in stepper.when.items():
        if step <= len(planned):
            planned[step - 1] = seen
    other = (np.isfinite(z) != planned).any(axis=(1, 2))
    if other.any():
        raise ComparisonError(
            f"{int(other.sum())} of {len(z)} seeds miss other samples than the gains were made "
            "for; run those one by one"
        )


class _Seeds:
    """Amplitudes (n, seeds) with their rates; they change in place."""

    def __init__(
        self, stepper: DisplacementStepper, modes: InModes, gains: GainSequence, seeds: int
    ) -> None:
        n = len(modes.factors[0])
        self.stepper, self.modes, self.gains = stepper, modes, gains
        self.x, self.v, self.a = (np.zeros((n, seeds)) for _ in range(3))
        self.inputs, self.k = stepper.excitation.rest(), 0
        self.fq, self.fv, self.fa, self.ff = (f[:, None] for f in modes.factors)

    def step(self, inputs: Floats, z: Floats) -> Floats:
        """NIS (seeds,) of the step, whose estimates are then in `x`."""
        self.k += 1
        f, self.inputs, a = self.stepper.excitation.step(self.k, inputs, self.inputs, self.a)
        self.a = a if a.ndim == 2 else np.repeat(a[:, None], len(z), axis=1)
        prior = self.fq * self.x
        prior += self.fv * self.v
        prior += self.fa * self.a
        prior += self.ff * f[:, None]
        x, nis = self._corrected(prior, z)
        towards = prior if self.stepper.recursion == "prior" else x
        self.v, self.a = self.modes.rates(towards, self.x, self.v, self.a)
        self.x = x
        return nis

    def _corrected(self, prior: Floats, z: Floats) -> tuple[Floats, Floats]:
        gain, s = self.gains.at(self.k), self.stepper.sensor
        if gain is None:
            return prior, np.zeros(len(z))
        i = np.array(gain.seen)
        y = z.T[i] - s.H[i] @ prior - (s.driven[i] @ self.inputs.q)[:, None]
        return prior + gain.G @ y, gain.nis(y)
