"""Small bodies of paper 003's cube, their plain explicit runs by numpy, measurements at nodes."""

import numpy as np
from scipy import sparse

from validate.arrays import Floats
from validate.estimate.measurements import Measurements
from validate.fem.large_strain.hyperelastic import Body
from validate.fem.system import System, build
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.scene import Load, Probe, Scene, Support
from validate.solve.march import march
from validate.solve.types import Run, Stepper

SIDE = 0.1
CENTRE = (0.0, SIDE / 2, SIDE / 2)  # node A of paper 003: the middle of the loaded side


def cube(
    cells: tuple[int, int, int] = (2, 2, 2), *, E: float = 30e3, mass_damping: float = 0.0
) -> System:
    """Held at z0, pushed along x at x0."""
    material = Material(E, 0.49, "svk", 1000.0, mass_damping)
    loads = (Load("push", "x0", (1.0, 0.0, 0.0)),)
    mesh = box((SIDE, SIDE, SIDE), cells)
    supports = (Support("z0", (0, 1, 2)),)
    return build(Scene(mesh, material, supports, loads=loads, probes=(Probe("A", CENTRE),)))


def ramp(h: float, steps: int, force: float, rise: float) -> Floats:
    """Inputs (steps, 1) N at h, 2 h, ...: up to `force` within `rise` s, then constant."""
    t = h * np.arange(1, steps + 1)
    return np.asarray(force * np.minimum(t / rise, 1.0)[:, None])


def plain(system: System, h: float, inputs: Floats, bias: float = 0.0) -> Floats:
    """Displacements (steps, N) m of central difference, by the numpy body."""
    body, free = Body(system.scene), np.zeros(len(system.moves))
    free[system.free] = 1 / system.masses[system.free]
    half = system.scene.material.mass_damping * h / 2
    forces = np.vstack([np.zeros((1, inputs.shape[1])), inputs])
    u = before = np.zeros(len(free))
    out = []
    for f in forces[:-1]:
        push = h * h * free * (system.loads @ (f + bias) - body.force(u))
        u, before = (push + 2 * u - (1 - half) * before) / (1 + half), u
        out.append(u)
    return np.array(out)


def at_nodes(system: System, nodes: list[int], t: Floats, z: Floats, sd: float) -> Measurements:
    """All components of nodes: z (nt, 3 k) m."""
    dofs = (3 * np.array(nodes)[:, None] + np.arange(3)).ravel()
    H = sparse.csr_array(np.eye(len(system.moves))[dofs])
    names = tuple(f"n{node}.{c}" for node in nodes for c in "xyz")
    return Measurements(t, H, z, np.full(len(dofs), sd), names)


def unmeasured(system: System) -> Measurements:
    """A sensor whose only reading comes a year later."""
    node = system.scene.mesh.nearest_node(np.array(CENTRE))
    return at_nodes(system, [node], np.array([3e7]), np.zeros((1, 3)), 1e-5)


def run(stepper: Stepper, h: float, inputs: Floats, frames: int = 1) -> Run:
    """All steps, the field of every `frames`-th."""
    t = h * np.arange(1, len(inputs) + 1)
    return march("filter", stepper, t, inputs, np.arange(frames - 1, len(inputs), frames), 0.0)
