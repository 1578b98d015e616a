"""What the bar and the blocks of paper 004 share: the probe that touches them, and its path."""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.parameters import quantity
from validate.scene.scene import Scene

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
class LoadCell:
    """What the recording's force has of noise; the models do not know it."""

    seed: int = quantity(4, "1", "seed of the noise")
    noise: float = quantity(5e-3, "N", "standard deviation of the force")
    every: int = quantity(10, "1", "ticks between two samples of the force")


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
