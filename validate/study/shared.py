"""A linear filter turned so that all seeds can share one walk: modal coordinates, gains beforehand.

The estimates stay what they are to rounding; only the order of the work changes.
"""

from dataclasses import replace

import numpy as np

from validate.errors import SceneError
from validate.estimate.covariance import Dense, Modal
from validate.estimate.displacement_filter import DisplacementStepper, InModes, Nodal
from validate.estimate.kf_fem import in_modes, shared_gains


def sharing(stepper: DisplacementStepper) -> DisplacementStepper | None:
    """The same filter in modes with `gains`; None where damping couples the modes."""
    modes, covariance = stepper.claimed, stepper.covariance
    if not isinstance(modes, InModes):
        try:
            modes = in_modes(stepper.system, stepper.excitation.rule)
        except SceneError:
            return None
    if isinstance(covariance, Dense):
        covariance = _turned(covariance, modes)
    gains, starts, nodal = stepper.gains, stepper.starts, isinstance(stepper.coordinates, Nodal)
    if gains is None:
        gains = shared_gains(covariance, stepper.sensor.table)
    elif nodal:
        gains = gains.mapped(modes.amplitudes)
    return replace(
        stepper,
        coordinates=modes,
        claimed=modes,
        covariance=covariance,
        gains=gains,
        starts=modes.amplitudes(starts) if nodal and starts is not None else starts,
        sensor=replace(stepper.sensor, H=covariance.H),
    )


def _turned(nodal: Dense, modes: InModes) -> Modal:
    """The recursion of nodal displacements in amplitudes, its transition diagonal."""
    Q, P0 = (modes.amplitudes(modes.amplitudes(X).T) for X in (nodal.Q, nodal.P0))
    H = np.ascontiguousarray(nodal.H @ modes.shapes)
    return Modal(modes.factors[0], Q, H, nodal.R, P0)
