"""What the hanging bar's drop converges to on our own meshes, and what others printed beside it."""

from dataclasses import replace

import numpy as np

from validate.compare.convergence import richardson
from validate.compare.exhibit import Exhibit, NumberTable
from validate.compare.published import Figure
from validate.fem.system import build as build_system
from validate.pipeline.experiment.experiment import Progress, ReportAdditions
from validate.pipeline.experiment.tree import Built, Tree
from validate.pipeline.run.method_run import MAIN, Cases
from validate.scene.geometries.specification import Box
from validate.scene.scene import Scene
from validate.solve.march import march
from validate.solve.static.newton import StaticNewton

from .reference_solutions import SOURCE, sunk

BUILT = Built()
_MESHES, _GRADINGS = (6, 4, 3), (3.0, 2.0)
_HEXAHEDRA = (6, 12)  # of dolfinx's meshes, beside those that are methods
_ORDER = 3.0  # of quadratic cells
_MM = 1e3


def tell(tree: Tree, cases: Cases, progress: Progress) -> ReportAdditions:
    """The converged drop with its interval on meshes graded in two ways, dolfinx's own meshes."""
    main = cases[MAIN]
    progress("the converged value")
    found = {g: _converged(tree, g) for g in _GRADINGS}
    limits = [limit for _, limit, _ in found.values()]
    value = sum(limits) / len(limits)
    half = max(index for _, _, index in found.values())
    numbers = {"drop.converged": value, "drop.converged.half_interval": half}
    numbers |= {f"drop.hexahedra.{n}": _drop(hexahedra(tree, n)) for n in _HEXAHEDRA}
    own = (("tetrahedra", "drop.tetrahedra"), ("hexahedra", "drop.hexahedra.9"))
    numbers |= {name: sunk(main[m].run) for m, name in own if main[m].run.finished}
    rows = [(g, str(n), _MM * d) for g, (drops, _, _) in found.items() for n, d in drops.items()]
    rows += [(g, "infinitely many", _MM * x) for g, x in zip(found, limits, strict=True)]
    words = (
        f"The drop converges to {_MM * value:.4f} mm, within {_MM * half:.4f} mm: the mean of what "
        "meshes graded in two ways tend to (Richardson), and the larger of their grid convergence "
        "indices."
    )
    head = ("grading / 1", "cells across a quarter", "drop / mm")
    table = NumberTable("converged", "Quadratic hexahedra, finer and finer", head, tuple(rows))
    return ReportAdditions(
        (Exhibit("converged", "The converged drop", (words,), tables=(table,)),), numbers
    )


def _converged(tree: Tree, grading: float) -> tuple[dict[int, float], float, float]:
    """Drops m by cells across, the drop m they tend to, and its grid convergence index m."""
    body = replace(tree.scene.body, grading=grading)
    graded = {n: replace(body, cells=(n, n, 3 * n)) for n in _MESHES}
    drops = {n: _drop(BUILT(None, tree.with_scene(body=one))) for n, one in graded.items()}
    answers = [np.array([[d]]) for d in drops.values()]
    found = richardson([1 / n for n in drops], answers, _ORDER)
    return drops, float(found.extrapolated[0, 0]), found.index


def hexahedra(tree: Tree, across: int) -> Scene:
    """The whole bar in linear hexahedra, 8/3 as many along."""
    cells = (across, across, round(8 * across / 3))
    return BUILT(None, tree.with_scene(body=Box(tree.scene.body.size, cells, "hex8")))


def _drop(scene: Scene) -> float:
    stepper = StaticNewton("none").prepare(build_system(scene))
    pull = np.array([[scene.loads[0].value]])
    return sunk(march("bar", stepper, np.ones(1), pull, np.array([0]), 0.0))


def _ours(name: str, of: str, theirs: float, expected: float) -> Figure:
    near = 1e-4 * theirs
    return Figure(name, f"told:{of}", theirs, near, "m", "reproduced", "within .01 %", SOURCE,
                  expected, 1e-8)  # fmt: skip


def _other(name: str, theirs: float, reason: str) -> Figure:
    return Figure(name, "told:drop.converged", theirs, 1e-3 * theirs, "m", "not reproduced", reason,
                  SOURCE)  # fmt: skip


_ENGINE = "NVIDIA Newton's solver: no mesh of the same law agrees with it"
PUBLISHED = (
    _ours("dolfinx, linear tetrahedra", "drop.tetrahedra", 43.2013e-3, 43.20130e-3),
    _ours("dolfinx, 6 x 6 x 16 hexahedra", "drop.hexahedra.6", 43.3963e-3, 43.39635e-3),
    _ours("dolfinx, 9 x 9 x 24 hexahedra", "drop.hexahedra.9", 43.676e-3, 43.67569e-3),
    _ours("dolfinx, 12 x 12 x 32 hexahedra", "drop.hexahedra.12", 43.82e-3, 43.82059e-3),
    _other("one-dimensional theory", 44.303e-3, "its held top is free to contract"),
    _other("NVIDIA Newton, XPBD", 158.856e-3, _ENGINE),
    _other("NVIDIA Newton, VBD", 139.529e-3, _ENGINE),
    _other("NVIDIA Newton, semi-implicit", 84.988e-3, _ENGINE),
)
