"""Bodies that touch rigid ones: pressed blocks, graded half-spaces, an inclined plane."""

from itertools import pairwise

import numpy as np

from validate.arrays import Floats
from validate.fem.system import System, build
from validate.scene.contact import RigidContact, RigidPlane, Shape
from validate.scene.geometries.box import grid
from validate.scene.material import LawName, Material
from validate.scene.mesh import Mesh
from validate.scene.scene import Scene, Support, Weight
from validate.solve.types import Scheme, State

E, NU = 1e4, 0.3
E_STAR = E / (1 - NU**2)
DOWN = (0.0, 0.0, -1.0)


def pressed(mesh: Mesh, law: LawName = "linear", gap: float = 0.001) -> Scene:
    """A block of 0.1 m between symmetry planes; a rigid plate `gap` m above its top."""
    plate = RigidContact("plate", "z1", RigidPlane((0.0, 0.0, 0.1 + gap), DOWN), DOWN)
    supports = tuple(Support(f"{axis}0", (i,)) for i, axis in enumerate("xyz"))
    return Scene(mesh, Material(E, NU, law, 1000.0), supports, contacts=(plate,))


def graded(fine: float, cells: int, ratio: float, far: float) -> Floats:
    """0 to `far` m at least: `cells` of `fine` m, then ever longer ones."""
    ends = [i * fine for i in range(cells + 1)]
    while ends[-1] < far:
        ends.append(ends[-1] + ratio * (ends[-1] - ends[-2]))
    assert all(b > a for a, b in pairwise(ends))
    return np.array(ends)


def bricks(*lines: Floats) -> Mesh:
    """A grid with its lines at these coordinates m."""
    counts = tuple(len(x) - 1 for x in lines)
    mesh = grid((1.0,) * len(lines), counts)
    at = np.round(mesh.nodes * counts).astype(np.int64)
    nodes = np.stack([x[i] for x, i in zip(lines, at.T, strict=True)], axis=1)
    return Mesh(nodes, mesh.cells, mesh.kind, mesh.facets)


def half_space(
    shape: Shape, a: float, n: int, ratio: float = 1.8, far: float = 10.0, d: int = 3
) -> Scene:
    """A quarter (2-D: half) of a half-space below a tool: `n` cells a contact radius a m, the rest
    coarser out to `far` radii."""
    side = graded(a / n, int(1.3 * n) + 1, ratio, far * a)
    depth = -graded(a / n, n, ratio, far * a)[::-1]
    mesh = bricks(*[side] * (d - 1), depth)
    tool = RigidContact("tool", f"{'yz'[d - 2]}1", shape, DOWN[-d:])
    supports = [Support(f"{axis}0", (i,)) for i, axis in enumerate("xy"[: d - 1])]
    floor = Support(f"{'yz'[d - 2]}0", tuple(range(d)))
    return Scene(
        mesh, Material(E, NU), (*supports, floor), copies=2 ** (d - 1), contacts=(tool,)
    )  # fmt: skip


def on_a_slope(mesh: Mesh, angle: float, friction: float, gap: float = 0.0) -> System:
    """A block `gap` m above a rigid plane, gravity turned by `angle`: nothing else holds it."""
    fall = Weight("gravity", (np.sin(angle), 0.0, -np.cos(angle)))
    floor = RigidPlane((0.0, 0.0, -gap), (0.0, 0.0, 1.0))
    contacts = (RigidContact("floor", "z0", floor, friction=friction),)
    return build(Scene(mesh, Material(1e5, NU, rho=1000.0), loads=(fall,), contacts=contacts))


def walked(scheme: Scheme, system: System, inputs: Floats) -> list[State]:
    """The states after each of the inputs (nt, k); none may fail."""
    stepper = scheme.prepare(system)
    states = [stepper.rest()]
    for value in inputs:
        states.append(stepper.step(states[-1], value))
        assert states[-1].failure is None, states[-1].failure
    return states[1:]


def traced(states: list[State], name: str) -> Floats:
    return np.array([state.numbers[name] for state in states])
