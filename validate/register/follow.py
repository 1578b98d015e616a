"""A recording that is followed over time: one driving signal, and its markers as recorded."""

from validate.recording.types import Recording
from validate.register.fitting import MarkerFit
from validate.register.markers import placed_markers
from validate.register.registered import Registered
from validate.register.signals import driving
from validate.scene.mesh import Mesh


def follow_signal(
    recording: Recording, mesh: Mesh, signal: str, unit: str, how: MarkerFit = MarkerFit()
) -> Registered:
    """Steps through `signal` after t = 0, where everything is at rest, with the tracked markers
    placed by the recording's own records."""
    drive = driving(recording, signal, unit, after_rest=True)
    return Registered((drive, placed_markers(recording, mesh, how=how)))
