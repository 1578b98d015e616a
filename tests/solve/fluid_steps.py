"""Single steps of a scheme and what they mean for the volume, for the tests of this folder."""

import numpy as np

from validate.fem.system import Responses
from validate.solve.types import Scheme, State

NINE = np.array([0.009])


def stepped(scheme: Scheme, r: Responses, drives: np.ndarray | float) -> State:
    """One step from rest."""
    stepper = scheme.on(r)
    return stepper.step(stepper.rest(), np.atleast_1d(np.asarray(drives, dtype=float)))


def pressures(state: State) -> np.ndarray:
    """Pa of the cavities, with one drive."""
    return np.asarray(state.inner.z[1:])


def volume_ratios(r: Responses, state: State) -> np.ndarray:
    z = np.concatenate([[1.0], state.inner.z])
    return np.asarray(r.volumes @ z @ z @ z) / r.rest_volumes


def slope_at(r: Responses, state: State) -> float:
    """V0/(dV/dP) Pa."""
    z = np.concatenate([[1.0], state.inner.z])
    return float(r.rest_volumes[0] / (3 * (r.volumes[0] @ z @ z)[-1]))
