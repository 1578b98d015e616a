"""The probe that touches a bar or a block: its settings, path, recording and registration."""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.parameters import quantity
from validate.pipeline.experiment.tree import Tree
from validate.recording.types import Recording, Signal, Source
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.scene import Scene
from validate.twin.sensors import LoadCell, signal, streams
from validate.twin.tracker import Origin

PROBE = "probe"


@dataclass(frozen=True)
class HapticProbe:
    """A sine of rising frequency, and the spring to the contact."""

    spring: float = quantity(1000.0, "N/m", "between probe and contact")
    depth: float = quantity(0.01, "m", "amplitude")
    lowest: float = quantity(0.1, "Hz", "frequency at the begin")
    highest: float = quantity(1.0, "Hz", "frequency at the end")
    seconds: float = quantity(40.0, "s", "duration; a whole number of swings ends at rest")


@dataclass(frozen=True)
class HapticTest:
    """What the scene of a touched body does not hold."""

    probe: HapticProbe = HapticProbe()
    twin: LoadCell = LoadCell()
    dt: float = quantity(1e-3, "s", "tick of the probe")


def pad_of(bar: Scene) -> float:
    """Distance m within which the bar's end is one contact: its two nodes."""
    return 1.01 * float(bar.mesh.nodes[:, 1].max())


def chirp(t: Floats, amplitude: float, lowest: float, highest: float) -> Floats:
    """A sine of rising frequency, lowest to highest Hz over t (nt,) s."""
    rise = (highest - lowest) / (2 * t[-1])
    return np.asarray(amplitude * np.sin(2 * np.pi * (lowest * t + rise * t**2)))


def growing(t: Floats, amplitude: float, hz: float) -> Floats:
    """A sine of rising amplitude over t (nt,) s."""
    return np.asarray(amplitude * t / t[-1] * np.sin(2 * np.pi * hz * t))


def probed(
    name: str, t: Floats, path: Floats, force: Floats, cell: LoadCell, *, same: bool, law: str
) -> Recording:
    """A recording of a probe's path (nt, d) m at t (nt,) s and the force (nt,) N on the hand."""
    rng = streams(cell.seed, ("force",))["force"]
    some = slice(None, None, cell.every)
    return Recording(
        name,
        Source(name, "", 0, "made in memory"),
        Origin.start_ns,
        signals={
            PROBE: Signal(t, path.round(9), "m", 0.0, "scene"),  # a nanometre: short files
            "force": signal(t[some], force[some], "N", cell.noise, "scene", rng),
        },
        metadata={
            "provenance": {
                "kind": "twin",
                "same_model": str(same).lower(),
                "seed": str(cell.seed),
                "law": law,
            }
        },
    )


def place(recording: Recording, tree: Tree, scene: Scene) -> Registered:
    drive = SignalObservation.driving(recording, PROBE, "m", after_rest=True)
    seen = SignalObservation.validating(
        recording, "force", "N", quantity="force", trace=f"{PROBE}.force.x"
    )
    return Registered((drive, seen))
