"""The twin of the bar, and what its methods are set to.

The recording is that of the continuous bar, solved in the frequency domain: another model than the
one judged, and an exact one. It knows no elements, no time steps and no regions.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.papers.async_regions.bodies import HapticTest, chirp, pad_of
from validate.papers.async_regions.touched import probed
from validate.parameters import with_given
from validate.recording.types import Recording
from validate.register.registered import Registered
from validate.replay.experiment import Progress
from validate.replay.tree import Built, Tree
from validate.scene.scene import Scene
from validate.solve.regions import AsyncRegions

from .continuous import exact_force


def bar(tree: Tree, given: Mapping[str, Any] | None = None) -> Scene:
    """The bar with the probe, with other values by path where given."""
    return Built()(None, with_given(tree, given or {}))


def with_cells(tree: Tree, cells: int) -> Scene:
    """The bar in so many square cells, of the same length and area."""
    length, height = tree.scene.body.size
    side = length / cells
    area = tree.scene.thickness * height
    return bar(
        tree, {"body.cells": (cells, 1), "body.size": (length, side), "thickness": area / side}
    )


def record(tree: Tree, progress: Progress) -> Recording:
    """Signals "probe" (m, along x and y) at every tick and "force" (N, on the hand)."""
    progress("simulate")
    own: HapticTest = tree.settings
    t: Floats = own.dt * np.arange(round(own.probe.seconds / own.dt) + 1, dtype=np.float64)
    depth = chirp(t, own.probe.depth, own.probe.lowest, own.probe.highest)
    force = exact_force(bar(tree), own.probe.spring, t, depth)
    path = np.stack([-depth, np.zeros(len(t))], axis=1)
    law = "continuous linear bar, frequency domain"
    return probed("async_line", t, path, force, own.twin, same=False, law=law)


def sets(tree: Tree, seen: Registered) -> Mapping[str, Any]:
    own: HapticTest = tree.settings
    return {"dt": own.dt, "spring": own.probe.spring, "pad": pad_of(bar(tree))}


def whole_of(tree: Tree) -> AsyncRegions:
    """The whole solve at every tick, as the experiment sets it."""
    own: HapticTest = tree.settings
    return AsyncRegions(own.dt, (), (), spring=own.probe.spring, pad=pad_of(bar(tree)))
