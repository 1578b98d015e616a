"""How the hanging bar enters `validate study tradeoff`: cells that a guest is given, too."""

from dataclasses import replace

import numpy as np

from validate.arrays import Floats
from validate.papers.hanging_bar.bar import HangingBar, hung
from validate.recording.types import Recording
from validate.replay.ladder import Rival, Trial
from validate.replay.ladder_solvers import ORDERS, still_best, still_pair
from validate.scene.box import box, grid
from validate.scene.material import LawName
from validate.scene.mesh import quadratic
from validate.scene.scene import Scene
from validate.solve.newton import StaticNewton
from validate.solve.quasi_static import QuasiStatic

_WHOLE = 1.0  # s: in one step from rest to the whole weight
_REFERENCE = "H27"


def trial(recording: Recording, p: HangingBar, quick: bool) -> Trial:
    """Levels are cells across the whole bar, twice as many along."""
    levels, finest = ((2, 4), 4) if quick else ((2, 4, 6, 8), 6)
    two, fewer = levels[:2], levels[: len(levels) // 2]

    def build(element: str, level: int, law: LawName) -> Scene:
        """Evenly meshed, of one law or the other."""
        make = grid if element.startswith("H") else box
        mesh = make((p.width, p.width, p.length), (level, level, 2 * level))
        scene = hung(p, mesh if element in ("H8", "P1") else quadratic(mesh))
        return replace(scene, material=p.material.linear) if law == "linear" else scene

    def weight(t: Floats) -> Floats:
        return np.full((len(t), 1), p.gravity)

    return Trial(
        build=build,
        size=lambda level: p.width / level,
        meshes={"P1": levels, "P2": two, "H8": levels, _REFERENCE: fewer},
        orders={**ORDERS, _REFERENCE: 2.0},
        steps=(_WHOLE,),
        inputs=weight,
        frames=np.array([_WHOLE]),
        points=_points(p),
        reference=(_REFERENCE, finest),
        best=still_best(cavities=False),
        solvers=(
            Rival("superposition", "static superposition", lambda dt: QuasiStatic(), stepped=False),
            Rival("large strain, Newton every step", "large strain",
                  lambda dt: StaticNewton("none"), law="neo_hooke"),
        ),
        pair=still_pair(_REFERENCE, finest, _WHOLE, cavities=False),
        dynamic=False,
        rise_s=_WHOLE,
    )  # fmt: skip


def _points(p: HangingBar) -> Floats:
    """Along the axis and half way to an edge, where no mesh of the ladder ends."""
    along = p.length * np.array([0.07, 0.31, 0.57, 0.83])
    beside = p.width * np.array([[0.5, 0.5], [0.27, 0.27]])
    return np.array([[*xy, z] for xy in beside for z in along])
