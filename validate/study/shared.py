"""A linear filter turned so that all seeds can share one walk: modal coordinates, gains beforehand.

The estimates stay what they are, to rounding and to the filter's own `settled`; only the order of
the work changes.
"""

from dataclasses import replace

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.estimate.covariance import Decoupled, Dense
from validate.estimate.displacement_filter import DisplacementStepper, InModes, Nodal
from validate.estimate.kf_fem import excitation_in, in_modes, shared_gains


def sharing(stepper: DisplacementStepper) -> DisplacementStepper | None:
    """The same filter in modes with `gains`; None where damping couples the modes, and where gains
    depend on what each seed measures; smoothing walks twice."""
    if stepper.care is not None or stepper.smooth:
        return None
    modes, covariance = stepper.claimed, stepper.covariance
    if not isinstance(modes, InModes):
        try:
            modes = in_modes(stepper.system, stepper.excitation.rule)
        except SceneError:
            return None
    if isinstance(covariance, Dense):
        covariance = _turned(covariance, modes)
    gains, nodal = stepper.gains, isinstance(stepper.coordinates, Nodal)
    if gains is None:
        gains = shared_gains(stepper.system, covariance, stepper.sensor.table, stepper.settled)
    elif nodal:
        known = gains.before if stepper.claimed is modes else None
        gains = known or gains.mapped(modes.amplitudes)
    return replace(
        stepper,
        excitation=excitation_in(modes, stepper.excitation) if nodal else stepper.excitation,
        coordinates=modes,
        claimed=modes,
        covariance=covariance,
        gains=gains,
        sensor=replace(stepper.sensor, H=covariance.H),
    )


def _turned(nodal: Dense, modes: InModes) -> Decoupled:
    """The recursion of nodal displacements in amplitudes, its transition diagonal."""
    Q = _white(nodal.Q, modes)
    if Q is None:
        Q = modes.amplitudes(modes.amplitudes(nodal.Q).T)
    P0 = _scaled(nodal.P0, nodal.Q, Q)
    if P0 is None:
        P0 = modes.amplitudes(modes.amplitudes(nodal.P0).T)
    H = np.ascontiguousarray(nodal.H @ modes.shapes)
    return Decoupled(modes.factors[0], Q, H, nodal.R, P0)


def _scaled(one: Floats, other: Floats, turned: Floats) -> Floats | None:
    """`one` turned, where it is a multiple of `other`; spares two products of whole matrices."""
    largest = float(np.abs(other).max())
    factor = float(np.abs(one).max()) / largest if largest else 0.0
    return factor * turned if np.array_equal(one, factor * other) else None


def _white(Q: Floats, modes: InModes) -> Floats | None:
    """`Q` turned, where every unknown has the same variance and no other a share in it."""
    q = float(Q[0, 0])
    return q * modes.white if np.array_equal(Q, q * np.eye(len(Q))) else None
