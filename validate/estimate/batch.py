"""Many seeds of one experiment in one walk: they share the gains, which no measurement changes."""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats, Ints, checked
from validate.errors import ComparisonError
from validate.estimate.displacement_filter import DisplacementStepper, InModes
from validate.estimate.gains import GainSequence
from validate.estimate.kalman import Gain
from validate.estimate.modal_kernel import walked


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
    if not isinstance(modes, InModes) or gains is None or stepper.smooth:
        raise ComparisonError('seeds share a walk of ModalKf(gains="shared"); prepare that')
    m, nt = len(stepper.sensor.names), len(inputs)
    z = checked(z, "z [m]", (None, nt, m), nan=True, error=ComparisonError)
    _require_schedule(stepper, z)
    forces, q, begin = stepper.excitation.walk(inputs)
    which, stack, S_yy = _stacked(gains, nt, m, len(modes.shapes.T))
    free, rule = stepper.system.free, modes.rule
    read, moved = rows[:, free] @ modes.shapes, q @ (rows @ stepper.system.moves).T
    offset = q @ stepper.sensor.driven.T
    factors = np.array(modes.factors)
    weights = np.array([rule.h, rule.b0, rule.b1, rule.g0, rule.g1])
    towards_prior = stepper.recursion == "prior"
    walks = [
        walked(factors, weights, forces, begin, towards_prior, which, stack, stepper.sensor.H,
               own - offset, read)
        for own in z
    ]  # fmt: skip
    values = np.array([found + moved for found, _ in walks])
    nis = _nis(np.array([y for _, y in walks]), which, S_yy)
    dof = np.array([float(sum(stepper.when.get(k + 1, ()))) for k in range(nt)])
    return Batch(values, nis, dof)


def _stacked(gains: GainSequence, nt: int, m: int, n: int) -> tuple[Ints, Floats, Floats]:
    """Which gain (nt,) every step takes, -1 for none; all gains (k, m, n), zero for what they do
    not see, and their S_yy (k, m, m) m^2, there the unit."""
    places: dict[int, int] = {}
    which = np.full(nt, -1)
    distinct: list[Gain] = []
    for step, gain in gains.gains.items():
        if step <= nt:
            which[step - 1] = places.setdefault(id(gain), len(distinct))
            if which[step - 1] == len(distinct):
                distinct.append(gain)
    stack, S_yy = np.zeros((len(distinct), n, m)), np.zeros((len(distinct), m, m))
    for G, S, gain in zip(stack, S_yy, distinct, strict=True):
        if all(gain.seen):
            G[:], S[:] = gain.G, gain.S_yy
        else:
            seen = np.array(gain.seen)
            G[:, seen], S[:] = gain.G, np.where(np.outer(seen, seen), gain.S_yy, np.eye(m))
    return which, np.ascontiguousarray(stack.swapaxes(1, 2)), S_yy


def _nis(y: Floats, which: Ints, S_yy: Floats) -> Floats:
    """y^T S_yy^-1 y (seeds, nt) of innovations (seeds, nt, m), zero where nothing was measured."""
    nis, seen = np.zeros(y.shape[:2]), which >= 0
    if seen.any():
        scaled = np.linalg.solve(S_yy[which[seen]], np.moveaxis(y[:, seen], 0, 2))
        nis[:, seen] = np.einsum("stm,tms->st", y[:, seen], scaled)
    return nis


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
