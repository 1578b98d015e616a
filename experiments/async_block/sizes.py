"""At which size do regions pay? Ticks of the whole prefactored solve, of regions and of a reduced
model (`solve.regions.krylov`) of one block, by its number of nodes, in one run.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Entry, NumberTable
from validate.errors import SceneError
from validate.pipeline.experiment.tree import Built, Tree
from validate.scene.geometries.specification import Box
from validate.scene.scene import Support
from validate.solve.regions.krylov import TouchedKrylov
from validate.solve.regions.scheme import AsyncRegions

from ..async_line.runs import off, pushed

UNTIMED = 20  # ticks: regions are made and caches settle
HEADS = ("dimensions", "nodes", "solver", "median tick / ms", "mean tick / ms",
         "worst tick / ms", "rms force error / %", "peak force error / %")  # fmt: skip


def sized(tree: Tree, dimension: int, cells: int) -> Tree:
    """The touched block as a square or a cube of so many cells a side. Raises `SceneError` for
    fewer than two cells, or another dimension."""
    if dimension not in (2, 3) or cells < 2:
        raise SceneError(f"block of {cells} cells in {dimension} dimensions: at least 2, in 2 or 3")
    side = tree.scene.body.size[0]
    at = (side, *(side * (cells // 2) / cells,) * (dimension - 1))
    (needle,), (end,) = tree.scene.tools, tree.scene.probes
    return tree.with_scene(
        body=Box((side,) * dimension, (cells,) * dimension),
        supports=(Support("x0", tuple(range(dimension))),),
        thickness=side if dimension == 2 else 1.0,
        tools=(replace(needle, tip=at, axis=(-1.0, *(0.0,) * (dimension - 1))),),
        probes=(replace(end, point=at),),
    )


def size_rows(
    tree: Tree,
    sizes: tuple[tuple[int, int], ...],
    near: AsyncRegions,
    depth: Floats,
    r: int,
    tell: Callable[[str], None],
) -> tuple[tuple[Entry, ...], ...]:
    """Rows under `HEADS` for blocks of (dimension, cells a side): the whole solve, the regions of
    `near`, r Krylov vectors a direction."""
    rows: list[tuple[Entry, ...]] = []
    for dimension, cells in sizes:
        scene = Built()(None, sized(tree, dimension, cells))
        nodes = len(scene.mesh.nodes)
        tell(f"{nodes} nodes in {dimension}-D")
        whole = pushed(scene, replace(near, layers=(), rates=(), solvers=near.solvers[:1]), depth)
        parts = pushed(scene, near, depth)
        few = pushed(scene, TouchedKrylov(near.dt, r, near.spring), depth)
        for name, f, s in (
            ("whole, prefactored", whole.force, whole.tick_s),
            ("regions", parts.force, parts.tick_s),
            (f"{r * dimension} Krylov vectors", few.force, few.tick_s),
        ):
            s = 1e3 * s[UNTIMED:]
            peak = 100 * (float(np.abs(f).max() / np.abs(whole.force).max()) - 1)
            rows.append((dimension, nodes, name, float(np.median(s)), float(s.mean()),
                         float(s.max()), 100 * off(f, whole.force), peak))  # fmt: skip
    return tuple(rows)


def size_table(rows: tuple[tuple[Entry, ...], ...]) -> NumberTable:
    return NumberTable(
        "sizes",
        "Ticks by size, CPU time, one run of this machine. The worst tick of regions is one "
        "in which all of them are solved. It meets no deadline that the full solve misses, "
        "unless another machine solves the far region.",
        HEADS,
        rows,
    )
