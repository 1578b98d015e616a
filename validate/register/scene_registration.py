"""Registration by names: streams drive the declared inputs of a scene or are compared.

A signal with the name of an input (a drive, a load, a rigid body that moves) drives it; an input
with a value is constant. `<drive>.force` in N is predicted by the force of that drive or rigid
body. Markers are placed by the recording's own records.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.errors import RegistrationError
from validate.recording.types import Recording
from validate.register.markers.fitting import MarkerFit
from validate.register.markers.markers import MarkerObservation
from validate.register.observation import Observation
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.contact import RigidContact
from validate.scene.mesh import Mesh
from validate.scene.scene import Drive, Load, Pressure, Scene, Weight

# --- A recording that is followed over time: one driving signal, and its markers as recorded.


def follow_signal(
    recording: Recording, mesh: Mesh, signal: str, unit: str, how: MarkerFit = MarkerFit()
) -> Registered:
    """Step through `signal` after t = 0, where everything is at rest, with the tracked markers
    placed by the recording's own records."""
    drive = SignalObservation.driving(recording, signal, unit, after_rest=True)
    return Registered((drive, MarkerObservation.placed(recording, mesh, how=how)))


# -------------------------------------------------------------------------------------------------

_UNITS: Mapping[type, str] = {
    Drive: "m", Load: "N", Weight: "m/s^2", Pressure: "Pa", RigidContact: "m"
}  # fmt: skip


def as_declared(recording: Recording, scene: Scene, how: MarkerFit = MarkerFit()) -> Registered:
    """Raise `RegistrationError` for an input that has no value and no signal, and where nothing of
    the recording is predicted."""
    parts: tuple[Any, ...] = (*scene.drives, *scene.loads, *scene.movers)
    recorded = {
        part.name: SignalObservation.driving(recording, _known(part.name, recording),
        _UNITS[type(part)],
                           after_rest=True)
        for part in parts if isinstance(part, RigidContact) or part.value is None
    }  # fmt: skip
    t = next(iter(recorded.values())).t if recorded else np.ones(1)
    inputs = tuple(recorded.get(part.name) or _constant(part, t) for part in parts)
    moved: tuple[Any, ...] = (*scene.drives, *scene.movers)
    forces = [name for d in moved if (name := f"{d.name}.force") in recording.signals]
    seen: list[Observation] = [
        SignalObservation.validating(recording, name, "N", quantity=name, trace=name)
        for name in forces
    ]
    seen += [
        MarkerObservation.placed(recording, scene.mesh, topic=k, how=how) for k in recording.markers
    ]
    if not seen:
        raise RegistrationError(
            "the recording has nothing that this scene predicts: neither markers, nor a signal "
            "DRIVE.force in N; give `place`, a function that registers it"
        )
    return Registered((*inputs, *seen))


def given_inputs(scene: Scene, t: Floats) -> tuple[SignalObservation, ...]:
    """One constant signal an input of the scene, at times t (nt,) s.

    Raises `RegistrationError` for an input without a value.
    """
    parts = (*scene.drives, *scene.loads)
    if missing := [part.name for part in parts if part.value is None]:
        raise RegistrationError(
            f"input '{missing[0]}' has no value and no recording gives it; set "
            f"loads.{missing[0]}.value"
        )
    return tuple(_constant(part, t) for part in parts)


def _constant(part: Any, t: Floats) -> SignalObservation:
    y = np.full((len(t), 1), part.value)
    return SignalObservation(part.name, "drives", t, y, _UNITS[type(part)], 0.0)


def _known(name: str, recording: Recording) -> str:
    if name not in recording.signals:
        raise RegistrationError(
            f"input '{name}' has no value, and the recording no signal of this name; it has "
            f"{', '.join(recording.signals) or 'none'}: rename the input, or set its value"
        )
    return name
