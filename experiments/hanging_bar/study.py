"""Hanging bar in `validate study tradeoff`, with cells that a job of an external simulator has."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from validate.arrays import Floats
from validate.pipeline.experiment.tree import Built, Tree
from validate.pipeline.ladder.ladder import LawPair, Rival, Trial
from validate.recording.types import Recording
from validate.scene.geometries.specification import Box
from validate.scene.material import LawName
from validate.scene.mesh import Kind
from validate.scene.scene import Scene
from validate.solve.static.newton import StaticNewton
from validate.solve.static.quasi_static import QuasiStatic

_WHOLE = 1.0  # s: in one step from rest to the whole weight
_REFERENCE = "H27"
_KINDS: Mapping[str, Kind] = {"P1": "tet4", "P2": "tet10", "H8": "hex8", _REFERENCE: "hex27"}


def trial(recording: Recording, tree: Tree, quick: bool) -> Trial:
    """Levels are cells across the whole bar, twice as many along."""
    levels, finest = ((2, 4), 4) if quick else ((2, 4, 6, 8), 6)
    size = tree.scene.body.size
    two, fewer = levels[:2], levels[: len(levels) // 2]

    def build(element: str, level: int, law: LawName) -> Scene:
        """Evenly meshed, of one law or the other."""
        even = Box(size, (level, level, 2 * level), _KINDS[element])
        scene = Built()(None, tree.with_scene(body=even))
        return replace(scene, material=scene.material.of_law(law))

    def weight(t: Floats) -> Floats:
        return np.full((len(t), 1), tree.scene.loads[0].value)

    return Trial(
        build=build,
        size=lambda level: size[0] / level,
        meshes={"P1": levels, "P2": two, "H8": levels, _REFERENCE: fewer},
        orders={"P1": 2.0, "P2": 3.0, "H8": 2.0, _REFERENCE: 2.0},
        steps=(_WHOLE,),
        inputs=weight,
        frames=np.array([_WHOLE]),
        points=_points(size),
        reference=(_REFERENCE, finest),
        best=lambda dt: QuasiStatic(),
        solvers=(
            Rival("superposition", "static superposition", lambda dt: QuasiStatic(), stepped=False),
            Rival("large strain, Newton every step", "large strain",
                  lambda dt: StaticNewton("none"), law="neo_hooke"),
        ),
        pair=LawPair(
            _REFERENCE, finest, _WHOLE, lambda dt: QuasiStatic(), lambda dt: StaticNewton()
        ),
        dynamic=False,
        rise_s=_WHOLE,
    )  # fmt: skip


def _points(size: tuple[float, ...]) -> Floats:
    """Along the axis and half way to an edge, where no mesh of the ladder ends."""
    along = size[2] * np.array([0.07, 0.31, 0.57, 0.83])
    beside = size[0] * np.array([[0.5, 0.5], [0.27, 0.27]])
    return np.array([[*xy, z] for xy in beside for z in along])
