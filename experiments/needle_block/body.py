"""Paper 002's block that a needle pokes (section IV.A): a unit square held on three sides.

The needle pushes the middle of the free side inward at 0.08 m/s for 2 s and stops; the node is
free along the side. A displacement prescribed at a point has no limit under refinement: the force
falls with 1/ln of the mesh size.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.scene.geometries.box import grid
from validate.scene.geometries.specification import Box
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.scene import Drive, Load, Probe, Scene, Support

Plane = Literal["strain", "stress"]
Mesher = Callable[[tuple[float, ...], tuple[int, ...]], Mesh]

MP1 = Material(200.0, 0.47, rho=2000.0, mass_damping=1.0, stiffness_damping=0.1)
MP2 = Material(60e3, 0.495, rho=1140.0, mass_damping=1.0, stiffness_damping=0.1)
STEP = 1 / 30  # s
SPEED = 0.08  # m/s
STOP = 2.0  # s


#: Probes lie on the free side, and inside.
BLOCK = Scene(
    body=Box((1.0, 1.0), cells=(20, 20), element="quad4"),
    material=MP1,
    supports=tuple(Support(side, (0, 1)) for side in ("x0", "y0", "y1")),
    drives=(Drive("needle", "x1", (-1.0, 0.0), (1.0, 0.5), ((0.0, SPEED), (STOP, 0.0))),),
    probes=(Probe("side", (1.0, 0.25)), Probe("inside", (0.75, 0.5))),
)


def needle_block(n: int, material: Material = MP1, plane: Plane = "strain") -> Scene:
    """n x n quadrilaterals, the drive "needle" at (1, 0.5) m; forces are N per metre.

    The drive's input is the depth, 0.08 min(t, 2) m; its `speeds` are that motion's. Probes "side"
    and "inside" lie at (1, 0.25) and (0.75, 0.5) m. Raises `SceneError` for an odd n, whose side
    has no middle node.
    """
    if n < 2 or n % 2:
        raise SceneError(f"needle block of {n} cells a side: an even number, so that a node is hit")
    return replace(BLOCK, material=material, plane=plane).resolved(grid((1.0, 1.0), (n, n)))


def needle_depth(t: Floats) -> Floats:
    """Inputs (nt, 1) m of the block at times t (nt,) s."""
    return np.asarray(SPEED * np.minimum(t, STOP))[:, None]


def needle_from_above(n: int, material: Material = MP1, plane: Plane = "strain") -> Scene:
    """The same block a quarter turn on, the needle along -y at (0.5, 1) m and no probes.

    Node numbers run along y first: sweeps in their order (Gauss-Seidel) see another problem.
    """
    block = needle_block(n, material, plane)
    needle = replace(block.drives[0], facets="y1", direction=(0.0, -1.0), point=(0.5, 1.0))
    sides = tuple(Support(side, (0, 1)) for side in ("y0", "x0", "x1"))
    return replace(block, supports=sides, drives=(needle,), probes=())


def pressed_block(n: int, material: Material = MP1, cells: Mesher = grid) -> Scene:
    """The block pressed by a traction "press" on the middle fifth of its free side, without needle
    and probes; of quadrilaterals, or by `box` of triangles. n of 10, 20, ... hit the fifth."""
    block, mesh = needle_block(n, material), cells((1.0, 1.0), (n, n))
    side = mesh.facets["x1"]
    middle = side[np.abs(mesh.nodes[side].mean(axis=1)[:, 1] - 0.5) < 0.1]
    pressed = Mesh(mesh.nodes, mesh.cells, mesh.kind, {**mesh.facets, "middle": middle})
    load = Load("press", "middle", (-1.0, 0.0))
    return replace(block, body=pressed, drives=(), loads=(load,), probes=())
