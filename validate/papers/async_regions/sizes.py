"""At which size do regions pay? Ticks of the whole prefactored solve, of regions and of a reduced
model of one block, by its number of nodes, in one run.

The reduced model is a Krylov one: displacements are sums of K^-1 f, K^-1 M K^-1 f, ... of a unit
push at the contact. It holds for a linear body whose contact stays where it is.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import thread_time

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Entry, NumberTable
from validate.fem.factor import factorise
from validate.papers.async_regions.bodies import block
from validate.papers.async_regions.runs import off, pushed, stepper_of
from validate.scene.scene import Scene
from validate.solve.regions import AsyncRegions

UNTIMED = 20  # ticks: regions are made and caches settle
HEADS = ("dimensions", "nodes", "solver", "median tick / ms", "mean tick / ms",
         "worst tick / ms", "rms force error / %", "peak force error / %")  # fmt: skip


@dataclass(frozen=True)
class Reduced:
    """Eq 3 in r coordinates: q+ = `now` q + `before` q- + `push` (r, d) times forces (d,) N; the
    contact is displaced by `shape` (d, r) q m, the probe moves along `axis` (d,)."""

    now: Floats
    before: Floats
    push: Floats
    shape: Floats
    axis: Floats

    def walk(self, depth: Floats, spring: float) -> tuple[Floats, Floats]:
        """Force (nt,) N on the hand against its push by `depth` (nt,) m, and CPU time (nt,) s."""
        q = last = np.zeros(len(self.push))
        force, seconds = np.empty(len(depth)), np.empty(len(depth))
        for i, x in enumerate(depth):
            start = thread_time()
            f = spring * (x * self.axis - self.shape @ q)
            q, last = self.now @ q + self.before @ last + self.push @ f, q
            force[i] = spring * (x - self.axis @ (self.shape @ q))
            seconds[i] = thread_time() - start
        return force, seconds


def reduced(scene: Scene, settings: AsyncRegions, r: int) -> Reduced:
    """The Krylov model with r vectors for each direction of what the probe touches at rest."""
    stepper = stepper_of(scene, settings)
    held, body, h = stepper.rest().inner.held, stepper.body.body, settings.dt
    tip, d = np.array(stepper.tool.tip), scene.mesh.dimension
    still = stepper.body.still
    units = [stepper.probe.nodal(held, tip + e, still) / settings.spring for e in np.eye(d)]
    unit = np.stack(units, axis=1)
    factor = factorise(body.K, body.node, body.places)
    columns = [factor.solve(unit)]
    for _ in range(r - 1):
        columns.append(factor.solve(body.m[:, None] * np.linalg.qr(columns[-1])[0]))
    V = np.linalg.qr(np.hstack(columns))[0]
    K, M, C = V.T @ (body.K @ V), V.T @ (body.m[:, None] * V), V.T @ (body.c[:, None] * V)
    solve = np.linalg.inv(M / h**2 + C / (2 * h) + K)
    b = V.T @ unit
    axis = np.array(stepper.tool.axis)
    return Reduced(solve @ (2 * M / h**2), solve @ (C / (2 * h) - M / h**2), solve @ b, b.T, axis)


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
        force, seconds = reduced(scene, near, r).walk(depth, near.spring)
        for name, f, s in (
            ("whole, prefactored", whole.force, whole.tick_s),
            ("regions", parts.force, parts.tick_s),
            (f"{r * dimension} Krylov vectors", force, seconds),
        ):
            s = 1e3 * s[UNTIMED:]
            peak = 100 * (float(np.abs(f).max() / np.abs(whole.force).max()) - 1)
            rows.append((dimension, nodes, name, float(np.median(s)), float(s.mean()),
                         float(s.max()), 100 * off(f, whole.force), peak))  # fmt: skip
    return tuple(rows)


def size_table(rows: tuple[tuple[Entry, ...], ...]) -> NumberTable:
    return NumberTable(
        "sizes",
        "Ticks by size, CPU time, one run of this machine. The worst tick of regions is one in "
        "which all of them are due: it meets no deadline that the whole solve misses, unless the "
        "far region is solved elsewhere.",
        HEADS,
        rows,
    )
