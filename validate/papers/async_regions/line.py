"""The road of `async_line`: parameters, the twin's recording, scene and registration.

The recording is that of the continuous bar, solved in the frequency domain: another model than the
one judged, and an exact one. It knows no elements, no time steps and no regions.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.papers.async_regions.bodies import DAMPING, PROBE, bar, chirp, exact_force, pad_of
from validate.parameters import quantity
from validate.recording.types import Recording, Signal, Source
from validate.register.registered import Registered
from validate.register.signals import driving, validating
from validate.replay.experiment import Progress
from validate.scene.scene import Scene
from validate.twin.sensors import signal, streams
from validate.twin.tracked import START_NS


@dataclass(frozen=True)
class Bar:
    E: float = quantity(5e3, "Pa", "Young's modulus")
    cells: int = quantity(40, "1", "free nodes along the bar")
    damping: float = quantity(DAMPING, "1/s", "C = damping M; the paper's 6.5 has no unit")


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
class TouchedLine:
    """Parameters; `recording` is a path."""

    body: Bar = Bar()
    probe: HapticProbe = HapticProbe()
    twin: LoadCell = LoadCell()
    dt: float = quantity(1e-3, "s", "tick of the probe")
    recording: str = quantity("", "1", "the recording")


def record(p: TouchedLine, progress: Progress) -> Recording:
    """Signals "probe" (m, along x and y) at every tick and "force" (N, on the hand)."""
    progress("simulate")
    t: Floats = p.dt * np.arange(round(p.probe.seconds / p.dt) + 1, dtype=np.float64)
    depth = chirp(t, p.probe.depth, p.probe.lowest, p.probe.highest)
    force = exact_force(p.body.E, p.probe.spring, t, depth, p.body.damping)
    path = np.stack([-depth, np.zeros(len(t))], axis=1)
    law = "continuous linear bar, frequency domain"
    return probed("async_line", t, path, force, p.twin, same=False, law=law)


def probed(
    name: str, t: Floats, path: Floats, force: Floats, cell: LoadCell, *, same: bool, law: str
) -> Recording:
    """A recording of a probe's path (nt, d) m at t (nt,) s and the force (nt,) N on the hand."""
    rng = streams(cell.seed, ("force",))["force"]
    some = slice(None, None, cell.every)
    return Recording(
        name,
        Source(name, "", 0, "made in memory"),
        START_NS,
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


def build(recording: Recording, p: TouchedLine, model: None) -> Scene:
    return bar(p.body.E, p.body.cells, p.body.damping)


def place(recording: Recording, p: TouchedLine, scene: Scene) -> Registered:
    drive = driving(recording, PROBE, "m", after_rest=True)
    seen = validating(recording, "force", "N", quantity="force", trace=f"{PROBE}.force.x")
    return Registered((drive, seen))


def sets(p: TouchedLine, seen: Registered) -> Mapping[str, Any]:
    return {"dt": p.dt, "spring": p.probe.spring, "pad": pad_of(p.body.cells)}
