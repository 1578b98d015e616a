"""Paper 002's bending rod (section IV.B): held at one end, gravity switched on at t = 0."""

from dataclasses import replace

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.scene.geometries.box import grid
from validate.scene.geometries.specification import Box
from validate.scene.material import Material
from validate.scene.scene import Probe, Scene, Support, Weight

from ..needle_block.body import Mesher

MP3 = Material(7000.0, 0.2, rho=10_000.0, mass_damping=1.0, stiffness_damping=0.1)
SIZE = (0.5, 0.25, 0.25)  # m
GRAVITY = 0.05  # m/s^2


#: The tip is the middle of the free end.
ROD = Scene(
    body=Box(SIZE, cells=(6, 3, 3), element="hex8"),
    material=MP3,
    supports=(Support("x0"),),
    loads=(Weight("gravity", "-z"),),
    probes=(Probe("tip", (SIZE[0], SIZE[1] / 2, SIZE[2] / 2)),),
)


def bending_rod(n: int, material: Material = MP3, cells: Mesher = grid) -> Scene:
    """2n x n x n hexahedra, x = 0 held, the weight "gravity" along -z with its input in m/s^2.

    With `box` the cells are tetrahedra, six in such a brick. Probe "tip": the middle of the free
    end. Raises `SceneError` for n < 1.
    """
    if n < 1:
        raise SceneError(f"rod of {n} cells across: at least 1")
    return replace(ROD, material=material).resolved(cells(SIZE, (2 * n, n, n)))


def gravity_inputs(t: Floats) -> Floats:
    """Inputs (nt, 1) m/s^2 of the rod at times t (nt,) s: constant from the first step on."""
    return np.full((len(t), 1), GRAVITY)
