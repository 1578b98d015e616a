"""Pipeline of `async_block`: a square or a cube touched in the middle of a face.

The recording is the whole solve's on the same mesh, as in the paper: a point contact's force
depends on the mesh, so no finer body can judge it. It can only repeat itself; what regions cost is
told.
"""

from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Exhibit
from validate.pipeline.experiment.experiment import Progress, ReportAdditions
from validate.pipeline.experiment.tree import Built, Tree
from validate.pipeline.run.method_run import Cases
from validate.recording.types import Recording
from validate.register.registration import Registered
from validate.solve.regions.scheme import AsyncRegions
from validate.twin.sensors import LoadCell

from ..async_line.probe import HapticProbe, HapticTest, chirp, probed
from ..async_line.runs import pushed
from ..async_line.tables import ENERGY, energy_table, force_table
from .methods import BLOCK
from .published import ring_nodes
from .sizes import size_rows, size_table
from .sliding import sliding_exhibit

SIZES = ((2, 18), (2, 26), (3, 6), (3, 8), (3, 12))  # 343, 729 and 2197 nodes in 3-D
_TICKS, _HZ, _DEEP = 400, 2.5, 5e-3
_VECTORS = 4
_TICK_WORDS = (
    "Ticks are those of the runs above, in wall time. A mean hides slow ticks: with regions, "
    "the tick in which the far region is solved, once in its period.",
)
_BUILT = Built()
PUSHED = HapticTest(
    HapticProbe(depth=5e-3, lowest=0.5, highest=1.5, seconds=4.0), LoadCell(every=20)
)


def record(tree: Tree, progress: Progress) -> Recording:
    """Signals "probe" (m, every direction) at every tick and "force" (N, on the hand)."""
    progress("simulate")
    p: HapticTest = tree.settings
    scene = _BUILT(None, tree)
    t: Floats = p.dt * np.arange(round(p.probe.seconds / p.dt) + 1, dtype=np.float64)
    depth = chirp(t, p.probe.depth, p.probe.lowest, p.probe.highest)
    whole = AsyncRegions(p.dt, (), (), spring=p.probe.spring)
    force = pushed(scene, whole, depth[1:]).force
    still = np.zeros((len(t), scene.mesh.dimension - 1))
    path = np.hstack([-depth[:, None], still])
    law = "linear, the full body at every tick, the mesh of the models"
    return probed("async_block", t, path, np.append(0.0, force), p.twin, same=True, law=law)


def sets(tree: Tree, seen: Registered) -> Mapping[str, Any]:
    own: HapticTest = tree.settings
    return {"dt": own.dt, "spring": own.probe.spring}


def tell(parameters: Any, cases: Cases, progress: Progress) -> ReportAdditions:
    """Force, phase and ticks of every method, and at which size regions pay."""
    tree, main = cast(Tree, parameters), cases[""]
    p: HapticTest = tree.settings
    forces, numbers = force_table(
        "force", "Largest force of the whole run, against the whole solve.", main,
        p.probe.seconds / 2, p.probe.seconds / 2,
    )  # fmt: skip
    t: Floats = p.dt * np.arange(1, _TICKS + 1, dtype=np.float64)
    depth = _DEEP * np.sin(2 * np.pi * _HZ * t)
    near = AsyncRegions(p.dt, (4,), (50.0,), overlap=2, spring=p.probe.spring)
    sizes = size_table(size_rows(tree, SIZES, near, depth, _VECTORS, progress))
    words = (
        "A Krylov model is valid for a linear body with a fixed contact, the full prefactored "
        "solve for any linear body. Regions are useful where matrices change at every tick, "
        "or where another machine solves the far region.",
    )
    progress("energy of borders, sliding contact")
    given = sets(tree, main["whole"].registered[0])
    rivals = {main[name].label: BLOCK[name].given(given) for name in main}
    scene = _BUILT(None, tree)
    swing = p.probe.depth * np.sin(2 * np.pi * p.probe.highest * t)
    energies = energy_table(f"Energy at {p.probe.highest:g} Hz.", scene, rivals, swing)
    return ReportAdditions(
        (
            Exhibit("ticks", "Time and error of regions", _TICK_WORDS, (forces,)),
            Exhibit("energy", "Energy of borders", (ENERGY,), (energies,)),
            sliding_exhibit(scene, rivals, main["whole"].label),
            Exhibit("sizes", "Body size from which regions are faster", words, (sizes,)),
        ),
        numbers | ring_nodes(),
    )
