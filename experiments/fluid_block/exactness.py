"""What condensation costs in digits: ten thousand swaps, and Poisson ratios up to .4999999999."""

import numpy as np
from scipy.sparse.linalg import spsolve

from validate.compare.exhibit import Entry, Exhibit, NumberTable
from validate.fem.linear_solvers.condense import Condensed
from validate.fem.system import System
from validate.fem.system import build as build_system
from validate.pipeline.experiment.experiment import Progress
from validate.pipeline.experiment.tree import Tree
from validate.scene.places import nodes_of

from .block import slab
from .boundary_swap import Swapped

_SWAPS = 10_000
_NU = 0.485  # the phantom's
_SHORT = (0.3, 3e-2, 1e-2, 1e-4, 1e-6, 1e-8, 2e-10)  # 1 - 2 nu


def exactness_exhibit(p: Tree, progress: Progress) -> tuple[Exhibit, dict[str, float]]:
    """Two tables, and the errors as numbers."""
    progress("swaps on the condensed system")
    swaps, error = _swaps(p)
    progress("condition")
    words = (
        "A boundary swap prescribes the displacement of an unknown instead of its force: a "
        "pivot of the dense inverse. The condensed solution is compared with the sparse "
        "solution of the full body.",
    )
    tables = (swaps, _conditions(p))
    return Exhibit("condensation", "Condensation", words, tables), {"swaps.error": error}


def _small(p: Tree, nu: float) -> tuple[System, Condensed]:
    scene = slab(p, None, {"material.nu": nu})
    system = build_system(scene)
    return system, Condensed.of(system, nodes_of(scene.mesh, "top"))


def _swaps(p: Tree) -> tuple[NumberTable, float]:
    system, small = _small(p, _NU)
    random = np.random.default_rng(0)
    free = small.free
    swapped = Swapped(small.compliance[np.ix_(free, free)])
    for i in random.integers(0, len(free), _SWAPS):
        swapped.swap(int(i))
    given = random.normal(size=len(free)) * np.where(swapped.driven, 1e-3, 1.0)
    u, f = swapped.solve(given)
    error = _beside_the_whole(system, small, swapped, u, f)
    rows: tuple[tuple[Entry, ...], ...] = (
        ("unknowns of the body", len(system.free)),
        ("kept, cavities and upper side", len(free)),
        ("random swaps", swapped.pivots),
        ("driven at the end", int(swapped.driven.sum())),
        ("largest drift of u - A f, relative", swapped.worst_drift),
        ("refactorisations", swapped.refactorisations),
        ("difference from the full body's solution, relative", error),
        ("dense form / kB", small.dense_bytes / 1e3),
        ("one column / kB", 8 * small.size / 1e3),
    )
    table = NumberTable("swaps", f"Random swaps at nu = {_NU:g}.", ("what", "value"), rows)
    return table, error


def _beside_the_whole(system, small, swapped, u, f) -> float:  # type: ignore[no-untyped-def]
    d = small.dimension
    place = (small.nodes[:, None] * d + np.arange(d)).ravel()[small.free]
    loads, whole = np.zeros(system.K.shape[0]), np.zeros(system.K.shape[0])
    loads[place[~swapped.driven]] = f[~swapped.driven]
    whole[place[swapped.driven]] = u[swapped.driven]
    open_ones = np.setdiff1d(system.free, place[swapped.driven])
    K = system.K
    whole[open_ones] = spsolve(K[open_ones][:, open_ones].tocsc(), (loads - K @ whole)[open_ones])
    return float(np.abs(whole[place] - u).max() / np.abs(whole).max())


def _conditions(p: Tree) -> NumberTable:
    rows: list[tuple[Entry, ...]] = []
    for short in _SHORT:
        _, small = _small(p, (1 - short) / 2)
        A = small.compliance[np.ix_(small.free, small.free)]
        worst = small.relative_error(int(small.free[len(small.free) // 2]))
        rows.append((f"{(1 - short) / 2:.10g}", float(np.linalg.cond(A)), worst))
    return NumberTable(
        "condition", "The condensed compliance towards incompressibility.",
        ("nu", "condition / 1", "relative error of a column, by refinement"), tuple(rows),
        "Linear triangles lock in this limit (their solutions are exact for the mesh, not for "
        "the body).",
    )  # fmt: skip
