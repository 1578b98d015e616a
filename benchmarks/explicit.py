"""Speed of the explicit step at large strain, as a share of what the machine gives in this run.

OMP_NUM_THREADS=1 python benchmarks/explicit.py

228 flop and 104 B a tet (St. Venant-Kirchhoff), 333 flop with the diagonal and 381 with the nodes'
blocks: 1.46 and 1.67 times the step's. Times are the least of many, taken in turns with a
matrix product (dgemm) and a copy, so that a busy machine slows all of them alike. Not so for two
threads: they gain only where a second core is idle, which the load average (1 min) tells. The
irregular mesh is Delaunay's of a shaken grid, its cells in that program's order. Single precision
is that of the element loops; its error is the force's, over the largest force.
"""

import os
import sys
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.spatial import Delaunay

from validate.arrays import Floats
from validate.fem.large_strain.explicit import ExplicitBody, Precision
from validate.fem.large_strain.hyperelastic import Body
from validate.fem.system import System, build
from validate.scene.geometries.box import box
from validate.scene.material import LawName, Material
from validate.scene.scene import Load, Scene, Support
from validate.solve.explicit.central import CentralDifference, CentralStepper

FLOP = 228  # of one tet of St. Venant-Kirchhoff
GRIDS = ((5, 5, 25), (12, 12, 10), (32, 32, 16))  # 3750, 8640, 98304 tets
SIDE = 384  # of the matrices
COPIED = 8_000_000  # numbers: beyond the caches
SUBSTEPS = 10
IN_A_ROW = 6  # the caches are filled anew after the copy
THREADS = 2


def system(cells: tuple[int, int, int], law: LawName) -> System:
    """A box of cubic cells, bonded below, pulled above."""
    size = (0.004 * cells[0], 0.004 * cells[1], 0.004 * cells[2])
    material = Material(30e3, 0.45, law, 1000.0)
    load = Load("pull", "z1", (0.0, 0.0, 1.0))
    return build(Scene(box(size, cells), material, (Support("z0", (0, 1, 2)),), loads=(load,)))


def irregular(law: LawName) -> Scene:
    """About as many cells as the second grid's, without slivers, held nowhere."""
    mesh = box((0.048, 0.048, 0.040), GRIDS[1])
    shaken = mesh.nodes + 0.0012 * np.random.default_rng(2).uniform(-1, 1, mesh.nodes.shape)
    cells = Delaunay(shaken).simplices
    volumes = np.linalg.det(shaken[cells[:, 1:]] - shaken[cells[:, :1]]) / 6
    cells[volumes < 0] = cells[volumes < 0][:, [0, 2, 1, 3]]
    cells = cells[np.abs(volumes) > 0.05 * np.abs(volumes).mean()]
    made = replace(mesh, nodes=shaken, cells=cells, facets={})
    return Scene(made, Material(30e3, 0.45, law, 1000.0))


def least(work: dict[str, Callable[[], object]], seconds: float) -> dict[str, float]:
    """Least time s of every piece, all in turns for some seconds."""
    best = dict.fromkeys(work, np.inf)
    for piece in work.values():
        piece()
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        for name, piece in work.items():
            for _ in range(IN_A_ROW):
                start = time.perf_counter()
                piece()
                best[name] = min(best[name], time.perf_counter() - start)
    return best


def steps(
    of: System, substeps: int, threads: int = 1, precision: Precision = "double"
) -> Callable[[], object]:
    """A march step of `substeps` steps, with all that a stepper does besides."""
    settings = CentralDifference(1e-5 * substeps, substeps, watch=10**9, precision=precision)
    stepper = settings.prepare(of)
    assert isinstance(stepper, CentralStepper)
    stepper.body.share(threads)  # whatever a pilot would say: `benchmarks/threads.py` asks one
    state, inputs = stepper.rest(), np.array([1e-6])
    state = stepper.step(state, inputs)
    return lambda: stepper.step(state, inputs)


def measured(cells: tuple[int, int, int], law: LawName, seconds: float) -> list[str]:
    of = system(cells, law)
    body, plain = ExplicitBody(of.scene), Body(of.scene)
    u: Floats = 1e-5 * np.random.default_rng(0).standard_normal(len(of.moves))
    A, x = np.random.default_rng(1).random((SIDE, SIDE)), np.ones(COPIED)
    y, tets = np.zeros_like(x), len(of.scene.mesh.cells)
    other = ExplicitBody(irregular(law))
    v: Floats = 1e-5 * np.random.default_rng(0).standard_normal(other.size)
    best = least(
        {
            "dgemm": lambda: A @ A,
            "copy": lambda: np.copyto(y, x),
            "force": lambda: body.force(u),
            "steps": steps(of, SUBSTEPS),
            "threads": steps(of, SUBSTEPS, THREADS),
            "step": steps(of, 1),
            "single": steps(of, 1, THREADS),
            "diagonal": lambda: body.force_and_diagonal(u),
            "blocks": lambda: body.force_and_blocks(u),
            "product": lambda: body.tangent_product(u, u),
            "look": lambda: body.look(u),
            "numpy": lambda: plain.force(u),
            "floats": steps(of, SUBSTEPS, precision="single"),
            "irregular": lambda: other.force(v),
        },
        seconds,
    )
    floats = ExplicitBody(of.scene, precision="single").force(u)
    error = np.abs(floats - body.force(u)).max() / np.abs(floats).max()
    dgemm, step = 2 * SIDE**3 / best["dgemm"], best["steps"] / SUBSTEPS
    return [
        str(tets),
        law,
        f"{dgemm / 1e9:.1f}",
        f"{16 * COPIED / best['copy'] / 1e9:.1f}",
        f"{1e9 * best['force'] / tets:.1f}",
        f"{1e9 * best['irregular'] / len(other.scene.mesh.cells):.1f}",
        f"{1e-3 / step:.2f}",
        f"{1e-3 / best['step']:.2f}",
        f"{FLOP * tets / step / dgemm:.3f}",
        f"{1e-3 * SUBSTEPS / best['threads']:.2f}",
        f"{best['steps'] / best['threads']:.2f}",
        f"{best['step'] / best['single']:.2f}",
        *(f"{best[k] / step:.2f}" for k in ("diagonal", "blocks", "product", "look", "numpy")),
        f"{best['steps'] / best['floats']:.2f}",
        f"{error:.0e}",
        f"{os.getloadavg()[0]:.1f}",
    ]


def main(seconds: float) -> None:
    head = (
        "tets", "law", "dgemm GFLOP/s", "copy GB/s", "force ns/tet",
        "force ns/tet (irregular)", "kHz (10 substeps)",
        "kHz (single)", "share of dgemm",
        "kHz (2 threads, 10 substeps)", "gain by 2 threads", "gain (single)",
        "force+diagonal / step", "force+blocks / step",
        "product / step", "look / step", "numpy force / step",
        "gain by single precision", "error of its force", "load average",
    )  # fmt: skip
    print("| " + " | ".join(head) + " |")
    print("| " + " | ".join(["---"] * len(head)) + " |")
    laws: tuple[LawName, ...] = ("svk", "neo_hooke")
    for cells in GRIDS:
        for law in laws:
            print("| " + " | ".join(measured(cells, law, seconds)) + " |", flush=True)


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 6.0)
