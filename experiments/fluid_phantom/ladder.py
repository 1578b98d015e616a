"""The ladder of paper 000's phantom: meshes near its 1328 nodes, loads to 9 mm."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.pipeline.experiment.tree import Built, Tree
from validate.pipeline.ladder.ladder import Ladder, LawPair, Trial, marker_noise
from validate.recording.types import Recording
from validate.scene.material import LawName
from validate.scene.mesh import Mesh
from validate.scene.scene import Scene
from validate.solve.fluid.cavities import ExactPressure
from validate.solve.schemes import SCHEMES
from validate.solve.static.newton import StaticNewton
from validate.solve.study_entries import StillBody

GRIDS = {7: (6, 7, 10), 9: (8, 9, 14), 11: (10, 12, 18)}  # cells along x, y, z by level
_DEEPEST = 0.009  # m, the last load of the experiment
_TABLE = 0.0015  # m between the loads that large strain is solved at
_ELEMENTS: Mapping[str, dict[str, Any]] = {
    "P1": {"body.element": "linear"}, "P2": {"body.element": "quadratic"},
    "MD": {"body.element": "linear", "dilatation": "nodal_mean"},
}  # fmt: skip


def trial(recording: Recording, tree: Tree, quick: bool) -> Trial:
    """A level is the number of nodes along x."""

    def scene(element: str, level: int, law: LawName) -> Scene:
        changes = {"body.cells": GRIDS[level], "material.law": law, **_ELEMENTS[element]}
        return Built()(recording, tree, changes)

    rise = _DEEPEST / _fastest(recording)
    fine = (7, 9) if quick else (7, 9, 11)
    return Trial(
        build=scene,
        size=lambda level: replace(tree.scene.body, cells=GRIDS[level]).cell_size,
        meshes={"P1": fine, "MD": fine, "P2": (7,) if quick else (7, 9)},
        steps=(rise / 6, rise / 240),
        inputs=lambda t: _DEEPEST / rise * t[:, None],
        frames=rise * np.array([1 / 3, 2 / 3, 1.0]),
        points=_points(scene("P1", 7, "linear").mesh),
        reference=("P2", 9 if quick else 11),
        best=lambda dt: ExactPressure(),
        solvers=SCHEMES.candidates(StillBody(True, rise / 6, _TABLE, medium=9, coarse=7)),
        pair=LawPair(
            "P2", 7, rise / 6, lambda dt: ExactPressure(), lambda dt: StaticNewton(), "neo_hooke"
        ),
        dynamic=False,
        rise_s=rise,
        noise=marker_noise(recording),
        notes=(
            "Steps are static: a step is a load increment. No density is declared, so no "
            "scheme with inertia runs here.",
        ),
    )


def _points(mesh: Mesh) -> Floats:
    """A ring in the solid a little outside the cavity, and a grid on the top face."""
    wall = mesh.nodes[mesh.facet_nodes("cavity")]
    centre = (wall.max(axis=0) + wall.min(axis=0)) / 2
    radius = 1.1 * float(np.ptp(wall[:, 0])) / 2
    angle = 2 * np.pi * np.arange(16) / 16
    ring = np.stack([np.cos(angle), np.zeros(16), np.sin(angle)], axis=1)
    top = mesh.nodes.max(axis=0)
    shares = [(a, b) for a in (0.15, 0.4, 0.6, 0.85) for b in (0.15, 0.4, 0.6, 0.85)]
    face = np.array([(a * top[0], top[1], b * top[2]) for a, b in shares])
    return np.vstack([centre + radius * ring, face])


def _fastest(recording: Recording) -> float:
    """Speed m/s of the stage over its quickest second."""
    stage = recording.signal("stage", "m")
    y = np.interp(np.arange(stage.t[0], stage.t[-1], 1.0), stage.t, stage.y[:, 0])
    return float(np.abs(np.diff(y)).max())


LADDER = Ladder(trial)
