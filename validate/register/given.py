"""Inputs of a scene that are declared with their value, as a gravity is, and not recorded."""

import numpy as np

from validate.arrays import Floats
from validate.errors import RegistrationError
from validate.register.signals import SignalObservation
from validate.scene.scene import Load, Pressure, Scene, Weight

_UNITS = {Weight: "m/s^2", Load: "N", Pressure: "Pa"}


def given_inputs(scene: Scene, t: Floats) -> tuple[SignalObservation, ...]:
    """One constant signal an input of the scene, at times t (nt,) s.

    Raises `RegistrationError` for an input without a value.
    """
    parts = (*scene.drives, *scene.loads)
    if missing := [part.name for part in parts if part.value is None]:
        raise RegistrationError(
            f"{missing[0]} has no value and no recording gives it; set {missing[0]}.value"
        )
    return tuple(
        SignalObservation(
            part.name,
            "drives",
            t,
            np.full((len(t), 1), part.value),
            _UNITS.get(type(part), "m"),
            0.0,
        )
        for part in parts
    )
