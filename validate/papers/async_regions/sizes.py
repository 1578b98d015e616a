"""At which size do regions pay? Ticks of the whole prefactored solve, of regions and of a reduced
model (`solve.touched_krylov`) of one block, by its number of nodes, in one run.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Entry, NumberTable
from validate.papers.async_regions.bodies import block
from validate.papers.async_regions.runs import off, pushed
from validate.solve.regions import AsyncRegions
from validate.solve.touched_krylov import TouchedKrylov

UNTIMED = 20  # ticks: regions are made and caches settle
HEADS = ("dimensions", "nodes", "solver", "median tick / ms", "mean tick / ms",
         "worst tick / ms", "rms force error / %", "peak force error / %")  # fmt: skip


def size_rows(
    sizes: tuple[tuple[int, int], ...],
    near: AsyncRegions,
    E: float,
    depth: Floats,
    r: int,
    tell: Callable[[str], None],
) -> tuple[tuple[Entry, ...], ...]:
    """Rows under `HEADS` for blocks of (dimension, cells a side): the whole solve, the regions of
    `near`, r Krylov vectors a direction."""
    rows: list[tuple[Entry, ...]] = []
    for dimension, cells in sizes:
        scene = block(E, cells, dimension)
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
