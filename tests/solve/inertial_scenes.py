"""Blocks that move, and the exact motion of their free unknowns."""

from collections.abc import Callable

import numpy as np
from scipy.linalg import expm

from validate.arrays import Floats
from validate.fem.system import MassName, System, build, damping_of, mass_of
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.scene import Drive, Load, Probe, Scene, Support

TOTAL = 3000 * 16e-6  # N, of 3 kPa on the block's top (paper 001, Table 1)


def cube(damping: float = 0.1, cells: tuple[int, int, int] = (4, 4, 7)) -> System:
    """Paper 001's block, its top pulled; a probe at (2, 2, 7) mm."""
    return build(
        Scene(
            box((0.004, 0.004, 0.007), cells),
            Material(1e4, 0.47, rho=1068.0, stiffness_damping=damping),
            (Support("z0", (0, 1, 2)),),
            loads=(Load("pull", "z1", (0.0, 0.0, 1.0)),),
            probes=(Probe("top", (0.002, 0.002, 0.007)),),
        )
    )


def small(mass_damping: float = 20.0, stiffness_damping: float = 0.0005) -> System:
    """Twelve unknowns from 91 to 715 rad/s, lightly damped, pulled sideways."""
    return build(
        Scene(
            box((0.1, 0.1, 0.1), (1, 1, 1)),
            Material(
                1e5,
                0.3,
                rho=1000.0,
                mass_damping=mass_damping,
                stiffness_damping=stiffness_damping,
            ),
            (Support("z0", (0, 1, 2)),),
            loads=(Load("push", "z1", (1.0, 0.0, 0.0)),),
        )
    )


def driven() -> System:
    """A block of 2 x 2 x 2 cells between a driven plate and the ground, a load on its side."""
    return build(
        Scene(
            box((0.1, 0.1, 0.1), (2, 2, 2)),
            Material(1e5, 0.3, rho=1000.0, mass_damping=5.0, stiffness_damping=0.001),
            (Support("z0", (0, 1, 2)),),
            drives=(Drive("press", "z1", (0.0, 0.0, -1.0)),),
            loads=(Load("push", "x1", (1.0, 0.0, 0.0)),),
        )
    )


def exact(
    system: System,
    forces: Floats,
    generator: Floats,
    signal: Floats,
    t: float,
    mass: MassName = "consistent",
) -> Floats:
    """u, v (2 m,) of the free unknowns at t from rest, by the exponential of the whole system.

    M a + C v + K u = forces (m, s) @ y with y' = generator (s, s) @ y from y = signal (s,).
    """
    matrices = (mass_of(system, mass), damping_of(system, mass, "full"), system.K)
    M, C, K = (X[system.free][:, system.free].toarray() for X in matrices)
    m, s = len(M), len(signal)
    A = np.zeros((2 * m + s, 2 * m + s))
    A[:m, m : 2 * m] = np.eye(m)
    A[m : 2 * m, :m], A[m : 2 * m, m : 2 * m] = -np.linalg.solve(M, K), -np.linalg.solve(M, C)
    A[m : 2 * m, 2 * m :] = np.linalg.solve(M, forces)
    A[2 * m :, 2 * m :] = generator
    start = np.concatenate([np.zeros(2 * m), signal])
    return np.asarray((expm(A * t) @ start)[: 2 * m])


def orders(error: Callable[[int], float], counts: tuple[int, ...]) -> Floats:
    """Observed orders of convergence between successive numbers of steps."""
    errors = np.array([error(n) for n in counts])
    return np.log(errors[:-1] / errors[1:]) / np.log(np.array(counts[1:]) / np.array(counts[:-1]))
