"""The road of `async_block`: a square or a cube touched in the middle of a face.

The recording is the whole solve's on the same mesh, as in the paper: a point contact's force
depends on the mesh, so no finer body can judge it. It can only repeat itself; what regions cost is
told.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Exhibit
from validate.papers.async_regions.block_figures import ring_nodes
from validate.papers.async_regions.bodies import PROBE, block, chirp
from validate.papers.async_regions.line import HapticProbe, LoadCell, probed
from validate.papers.async_regions.methods import BLOCK
from validate.papers.async_regions.runs import pushed
from validate.papers.async_regions.sizes import size_rows, size_table
from validate.papers.async_regions.sliding import sliding_exhibit
from validate.papers.async_regions.tables import ENERGY, energy_table, force_table
from validate.parameters import quantity
from validate.recording.types import Recording
from validate.register.registered import Registered
from validate.register.signals import driving, validating
from validate.replay.experiment import Progress, Told
from validate.replay.followed import Cases
from validate.scene.scene import Scene
from validate.solve.regions import AsyncRegions

SIZES = ((2, 18), (2, 26), (3, 6), (3, 8), (3, 12))  # 343, 729 and 2197 nodes in 3-D
_TICKS, _HZ, _DEEP = 400, 2.5, 5e-3
_VECTORS = 4
_TICK_WORDS = (
    "Ticks are those of the runs above, in wall time. A mean hides slow ticks: with regions, "
    "the tick in which the far region is solved, once in its period.",
)
_PUSH = HapticProbe(depth=5e-3, lowest=0.5, highest=1.5, seconds=4.0)
_CELL = LoadCell(every=20)


@dataclass(frozen=True)
class BlockBody:
    dimension: int = quantity(3, "1", "2 or 3")
    cells: int = quantity(6, "1", "cells a side")
    E: float = quantity(5e3, "Pa", "Young's modulus")
    nu: float = quantity(0.45, "1", "Poisson ratio")


@dataclass(frozen=True)
class TouchedBlock:
    """Parameters; `recording` is a path."""

    body: BlockBody = BlockBody()
    probe: HapticProbe = _PUSH
    twin: LoadCell = _CELL
    dt: float = quantity(1e-3, "s", "tick of the probe")
    recording: str = quantity("", "1", "the recording")


def build(recording: Recording | None, p: TouchedBlock, model: None) -> Scene:
    return block(p.body.E, p.body.cells, p.body.dimension, p.body.nu)


def record(p: TouchedBlock, progress: Progress) -> Recording:
    """Signals "probe" (m, every direction) at every tick and "force" (N, on the hand)."""
    progress("simulate")
    t: Floats = p.dt * np.arange(round(p.probe.seconds / p.dt) + 1, dtype=np.float64)
    depth = chirp(t, p.probe.depth, p.probe.lowest, p.probe.highest)
    whole = AsyncRegions(p.dt, (), (), spring=p.probe.spring)
    force = pushed(build(None, p, None), whole, depth[1:]).force
    still = np.zeros((len(t), p.body.dimension - 1))
    path = np.hstack([-depth[:, None], still])
    law = "linear, the full body at every tick, the mesh of the models"
    return probed("async_block", t, path, np.append(0.0, force), p.twin, same=True, law=law)


def place(recording: Recording, p: TouchedBlock, scene: Scene) -> Registered:
    drive = driving(recording, PROBE, "m", after_rest=True)
    seen = validating(recording, "force", "N", quantity="force", trace=f"{PROBE}.force.x")
    return Registered((drive, seen))


def sets(p: TouchedBlock, seen: Registered) -> Mapping[str, Any]:
    return {"dt": p.dt, "spring": p.probe.spring}


def tell(parameters: Any, cases: Cases, progress: Progress) -> Told:
    """Force, phase and ticks of every method, and at which size regions pay."""
    p, main = cast(TouchedBlock, parameters), cases[""]
    forces, numbers = force_table(
        "force", "Largest force of the whole run, against the whole solve.", main,
        p.probe.seconds / 2, p.probe.seconds / 2,
    )  # fmt: skip
    t: Floats = p.dt * np.arange(1, _TICKS + 1, dtype=np.float64)
    depth = _DEEP * np.sin(2 * np.pi * _HZ * t)
    near = AsyncRegions(p.dt, (4,), (50.0,), overlap=2, spring=p.probe.spring)
    sizes = size_table(size_rows(SIZES, near, p.body.E, depth, _VECTORS, progress))
    words = (
        "A Krylov model is valid for a linear body with a fixed contact, the full prefactored "
        "solve for any linear body. Regions are useful where matrices change at every tick, "
        "or where another machine solves the far region.",
    )
    progress("energy of borders, sliding contact")
    given = sets(p, main["whole"].registered[0])
    rivals = {main[name].label: BLOCK[name].given(given) for name in main}
    scene = build(None, p, None)
    swing = p.probe.depth * np.sin(2 * np.pi * p.probe.highest * t)
    energies = energy_table(f"Energy at {p.probe.highest:g} Hz.", scene, rivals, swing)
    return Told(
        (
            Exhibit("ticks", "Time and error of regions", _TICK_WORDS, (forces,)),
            Exhibit("energy", "Energy of borders", (ENERGY,), (energies,)),
            sliding_exhibit(scene, rivals, main["whole"].label),
            Exhibit("sizes", "Body size from which regions are faster", words, (sizes,)),
        ),
        numbers | ring_nodes(),
    )
