"""Paper 000's haptic loop, one pressure iteration a tick, in every form and size, one thread.

python benchmarks/fluid_loop.py [TICKS]    TICKS per form at 82 nodes (default 4000)

The paper's own system: its 80 cavity nodes and two of a tool on the outside, u = A y by the dense
inverse, the volume, one pressure update, again (section 5.3, about 3000 Hz in 2004). Beside it the
same by the columns in use, and with the exact root of the volume's polynomial. The floor is the
least time in which this run read the dense matrix twice; ticks are medians. What each form keeps in
memory stands below.
"""

import os
import sys

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy loads its BLAS
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from validate.arrays import Floats, Ints
from validate.fem.cavity import CavitySurface, volume_form
from validate.fem.kernels.jit_cache import compiled
from validate.fem.linear_solvers.condense import Condensed
from validate.fem.system import build
from validate.scene.geometries.inclusion import Block, Capsule
from validate.scene.material import Material
from validate.scene.scene import Cavity, Pin, Scene, Support

PAPER_HZ = 3000.0
SIZES = (82, 200, 400, 800, 1500, 3000)  # nodes


@dataclass(frozen=True)
class Loop:
    """A condensed system: A (W, W) m/N, facets (f, 3) of the cavity, rest positions x (W,) m, the
    pressure's load and column (W,), columns (6, W) of the tool's two nodes, the gain Pa."""

    A: Floats
    facets: Ints
    x: Floats
    load: Floats
    swell: Floats
    tool: Floats
    gain: float

    @property
    def bytes(self) -> int:
        return self.A.nbytes


def phantom() -> Loop:
    """The phantom's condensed system, two nodes of its upper side beside the cavity's."""
    block = Block(0.060, 0.045, 0.070)
    mesh = block.around((9, 10, 15), Capsule((0.03, 0.0225, 0.035), 0.0085, 0.028))
    held = (Support("x0", (0,)), Support("y0", (1,)), Support("x1", (0,)))
    pins, cavities = (Pin((0.0, 0.0, 0.035), (2,)),), (Cavity("inclusion", "cavity"),)
    fixed = Scene(mesh, Material(15.2e3, 0.485), held, pins, cavities=cavities)
    system = build(fixed)
    top = [mesh.nearest_node(np.array([0.03, 0.045, z])) for z in (0.030, 0.040)]
    small = Condensed.of(system, np.array(top))
    A = np.ascontiguousarray(small.compliance)
    at = [3 * int(np.searchsorted(small.nodes, n)) + c for n in top for c in range(3)]
    load = np.linalg.lstsq(A, small.fields[0], rcond=None)[0]
    form = volume_form(
        small.surfaces[0], np.stack([small.positions, small.fields[0].reshape(-1, 3)])
    )
    gain = float(form[0, 0, 0] / (3 * form[0, 0, 1]))
    return Loop(A, small.surfaces[0].facets, np.ascontiguousarray(small.positions.ravel()), load,
                small.fields[0].copy(), np.ascontiguousarray(A[at]), gain)  # fmt: skip


def grown(nodes: int, like: Loop) -> Loop:
    """As many nodes with numbers of no meaning: only the time is looked at. Facets grow with them,
    two for each node."""
    random = np.random.default_rng(0)
    W = 3 * nodes
    A = random.normal(size=(W, W)) * 1e-5
    facets = random.integers(0, nodes, (2 * nodes, 3))
    x, load = random.normal(size=W) * 1e-2, random.normal(size=W) * 1e-6
    return Loop(A, facets, x, load, random.normal(size=W) * 1e-8, A[:6].copy(), like.gain * 1e-12)


@compiled(fastmath=True)
def volume(facets: Ints, x: Floats, u: Floats) -> float:
    """m^3 of the closed surface with nodes at x + u (W,)."""
    total = 0.0
    for i in range(len(facets)):
        a, b, c = 3 * facets[i, 0], 3 * facets[i, 1], 3 * facets[i, 2]
        ax, ay, az = x[a] + u[a], x[a + 1] + u[a + 1], x[a + 2] + u[a + 2]
        bx, by, bz = x[b] + u[b], x[b + 1] + u[b + 1], x[b + 2] + u[b + 2]
        cx, cy, cz = x[c] + u[c], x[c + 1] + u[c + 1], x[c + 2] + u[c + 2]
        total -= ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    return total / 6


@compiled(fastmath=True)
def dense_tick(A: Floats, y: Floats, load: Floats, facets: Ints, x: Floats, V0: float,
               gain: float, P: float) -> tuple[float, float]:  # fmt: skip
    """The paper's loop with one pressure iteration: P Pa and the volume m^3 that it leaves; y (W,)
    forces of the tool and of P."""
    u = A @ y
    step = gain * (1 - volume(facets, x, u) / V0)
    y += step * load
    u = A @ y
    return P + step, volume(facets, x, u)


@compiled(fastmath=True)
def column_tick(tool: Floats, forces: Floats, swell: Floats, facets: Ints, x: Floats, V0: float,
                gain: float, P: float) -> tuple[float, float]:  # fmt: skip
    """The same by columns: u = sum f_j u_j + P u_p, and only P changes in the update."""
    u = forces @ tool + P * swell
    step = gain * (1 - volume(facets, x, u) / V0)
    u += step * swell
    return P + step, volume(facets, x, u)


@compiled(fastmath=True)
def exact_tick(form: Floats, tool: Floats, forces: Floats, swell: Floats, u: Floats, V0: float,
               P: float) -> float:  # fmt: skip
    """The root of the volume's polynomial in (1, forces, P), then the displacements u (W,)."""
    m = len(form)
    z = np.empty(m)
    z[0], z[m - 1] = 1.0, 0.0
    z[1 : m - 1] = forces
    b = c = d = 0.0
    for i in range(m - 1):
        row = 0.0
        for j in range(m - 1):
            inner = 0.0
            for k in range(m - 1):
                inner += form[i, j, k] * z[k]
            row += inner * z[j]
            c += form[i, j, m - 1] * z[i] * z[j]
        d += row * z[i]
        b += form[i, m - 1, m - 1] * z[i]
    a, b, c = form[m - 1, m - 1, m - 1], 3 * b, 3 * c
    for _ in range(30):
        step = (((a * P + b) * P + c) * P + d - V0) / ((3 * a * P + 2 * b) * P + c)
        P -= step
        if abs(step) <= 1e-14 * abs(P):
            break
    u[:] = forces @ tool + P * swell
    return P


def numpy_tick(loop: Loop, y: Floats, V0: float, P: float) -> tuple[float, float]:
    """The dense loop by numpy alone."""

    def size(u: Floats) -> float:
        a, b, c = np.moveaxis((loop.x + u).reshape(-1, 3)[loop.facets], 1, 0)
        return float(-np.einsum("fi,fi->", a, np.cross(b, c)) / 6)

    u = loop.A @ y
    step = loop.gain * (1 - size(u) / V0)
    y += step * loop.load
    u = loop.A @ y
    return P + step, size(u)


def seconds(tick: Callable[[], object], ticks: int) -> float:
    """The median of a tick, after a few that settle caches."""
    found = []
    for _ in range(ticks + 10):
        start = perf_counter()
        tick()
        found.append(perf_counter() - start)
    return float(np.median(found[10:]))


@compiled(fastmath=True)
def read(numbers: Floats) -> float:
    """Their sum: nothing but reading."""
    total = 0.0
    for i in range(len(numbers)):
        total += numbers[i]
    return total


def floor_seconds(loop: Loop, ticks: int) -> float:
    """The least time that reading as many bytes as the dense matrix has takes, twice."""
    flat, found = loop.A.ravel(), np.inf
    for _ in range(ticks + 10):
        start = perf_counter()
        read(flat)
        found = min(found, perf_counter() - start)
    return 2 * found


def forms(loop: Loop, ticks: int) -> dict[str, float]:
    """Seconds per tick of every form."""
    forces = np.array([0.0, -0.2, 0.0, 0.0, -0.1, 0.0])
    y, still = np.zeros(len(loop.A)), np.zeros(len(loop.A))
    V0 = float(volume(loop.facets, loop.x, 0 * loop.x))
    columns = np.concatenate([loop.x[None], loop.tool, loop.swell[None]])
    form = _form(loop, columns)
    u = np.empty(len(loop.A))
    args = (loop.facets, loop.x, V0, loop.gain, 0.0)
    return {
        "dense, numpy": seconds(lambda: numpy_tick(loop, y.copy(), V0, 0.0), ticks),
        "dense, compiled": seconds(
            lambda: dense_tick(loop.A, y, still, loop.facets, loop.x, V0, loop.gain, 0.0),
            ticks,
        ),
        "columns, compiled": seconds(
            lambda: column_tick(loop.tool, forces, loop.swell, *args), ticks
        ),
        "exact, compiled": seconds(
            lambda: exact_tick(form, loop.tool, forces, loop.swell, u, V0, 0.0), ticks
        ),
        "floor of the dense form": floor_seconds(loop, ticks),
    }


def _form(loop: Loop, columns: Floats) -> Floats:
    surface = CavitySurface("inclusion", loop.facets, np.unique(loop.facets))
    return volume_form(surface, columns.reshape(len(columns), -1, 3))


def main() -> None:
    ticks = int(sys.argv[1]) if len(sys.argv) > 1 else 4000
    own = phantom()
    print(f"paper 000, 2004: {PAPER_HZ:g} Hz; here, one thread, kHz by nodes")
    table: dict[str, list[float]] = {}
    for nodes in SIZES:
        loop = own if nodes == SIZES[0] else grown(nodes, own)
        few = max(20, int(ticks * (SIZES[0] / nodes) ** 2))
        for name, s in forms(loop, few).items():
            table.setdefault(name, []).append(1e-3 / s)
    print(f"{'':26}" + "".join(f"{n:>9}" for n in SIZES))
    for name, rates in table.items():
        print(f"{name:26}" + "".join(f"{r:9.3g}" for r in rates))
    for name, rows in (("dense / MB", 3), ("columns of a tool / MB", 0)):
        sizes = (8e-6 * (rows * n or 7) * 3 * n for n in SIZES)  # two nodes and the pressure: 7
        print(f"{name:26}" + "".join(f"{size:9.3g}" for size in sizes))


if __name__ == "__main__":
    main()
