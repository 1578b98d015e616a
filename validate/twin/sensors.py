"""Simulated sensors of a twin: load cell and scalar signals, each with its noise.

A twin is made by another and finer model than those it is used to judge, then passes the same
pipeline as a real recording. Each sensor draws from its own random stream, so that changing one
leaves the others' noise as it was.
"""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.parameters import quantity
from validate.recording.types import Signal


@dataclass(frozen=True)
class LoadCell:
    """Noise and sampling of a recorded force."""

    seed: int = quantity(4, "1", "seed of the noise")
    noise: float = quantity(5e-3, "N", "standard deviation of the force")
    every: int = quantity(10, "1", "ticks between two samples of the force")


def signal(
    t: Floats, y: Floats, unit: str, sd: float, frame: str, rng: np.random.Generator
) -> Signal:
    """Return a scalar y (nt,) read with white noise of sd in `unit`."""
    return Signal(t, (y + sd * rng.standard_normal(len(y)))[:, None], unit, sd, frame)


def streams(seed: int, names: tuple[str, ...]) -> dict[str, np.random.Generator]:
    """One generator per sensor from one seed."""
    children = np.random.SeedSequence(seed).spawn(len(names))
    return {n: np.random.default_rng(c) for n, c in zip(names, children, strict=True)}
