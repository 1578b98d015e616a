"""Blocks and cylinders below an indenter, with small hexahedra at the contact.

A body that is pressed in its middle along z is a quarter, where nothing but its force is judged.
"""

from dataclasses import dataclass, replace
from math import exp, log, sinh
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.optimize import brentq

from validate.arrays import Floats
from validate.errors import SceneError
from validate.parameters import quantity, take_units
from validate.scene.geometries.box import grid, member
from validate.scene.mesh import Mesh
from validate.scene.places import OnPlane
from validate.scene.scene import Support

# --- Blocks of hexahedra whose cells are small around one point, for contact there.

_EVEN = 1.01  # smallest cell over mean cell above which a line stays even


def clustered_block(
    low: tuple[float, ...],
    high: tuple[float, ...],
    cells: tuple[int, ...],
    at: tuple[float, ...],
    share: tuple[float, ...],
) -> Mesh:
    """Return hexahedra of [low, high] m with sets "x0", "x1", ..., clustered around the point `at`.

    `share`: length of the cells at that point over the mean one, per axis (1: even). The lines of a
    finer grid lie on the same map of [0, 1], so that grids of one share are similar.
    """
    size = tuple(b - a for a, b in zip(low, high, strict=True))
    mesh = grid(size, cells)
    nodes = np.stack(
        [
            low[c] + size[c] * clustered(mesh.nodes[:, c] / size[c], (at[c] - low[c]) / size[c], s)
            for c, s in enumerate(share)
        ],
        axis=1,
    )
    return replace(mesh, nodes=nodes)


def clustered(t: Floats, at: float, share: float) -> Floats:
    """Return x(t) in [0, 1], monotone, with slope `share` where x = `at`.

    x = at (1 + sinh(k (t - B)) / sinh(k B)): Roberts' interior clustering (Tannehill, Anderson,
    Pletcher, Computational Fluid Mechanics and Heat Transfer, 2nd ed. 1997, eq 5.221).
    """
    at = min(max(at, 0.0), 1.0)
    if share * _EVEN >= 1:
        return t
    k = brentq(lambda k: _slope(k, at) - share, 1e-6, 60.0)
    B = _middle(k, at)
    # Both forms of one map: at an end B or 1 - B is 0, and one of them divides by it.
    if at >= 0.5:
        return np.asarray(at * (1 + np.sinh(k * (t - B)) / sinh(k * B)))
    return np.asarray(at + (1 - at) * np.sinh(k * (t - B)) / sinh(k * (1 - B)))


def _middle(k: float, at: float) -> float:
    return log(((1 - at) + at * exp(k)) / ((1 - at) + at * exp(-k))) / (2 * k)


def _slope(k: float, at: float) -> float:
    B = _middle(k, at)
    return at * k / sinh(k * B) if at >= 0.5 else (1 - at) * k / sinh(k * (1 - B))


# -------------------------------------------------------------------------------------------------

Element = Literal["hex8", "hex27"]


@dataclass(frozen=True)
class IndentedBlock:
    """A block [0, size] whose cells are clustered around the point `at`.

    `cells` are those of the meshed part, `shares` the lengths of its cells at that point over the
    mean ones, per axis. A quarter is the part beyond the middle planes across x and y, held there.
    """

    size: tuple[float, ...] = quantity((), "m", "lengths along x, y, z, of the whole body")
    cells: tuple[int, ...] = quantity((), "1", "cells along x, y, z, of the meshed part")
    at: tuple[float, ...] = quantity((), "m", "the point that is pressed")
    shares: tuple[float, ...] = quantity(
        (1.0, 1.0, 1.0), "1", "length of the cells there over the mean one, per axis"
    )
    part: Literal["whole", "quarter"] = quantity("whole", "1", "what is meshed")
    element: Element = quantity("hex8", "1", "element")

    def __post_init__(self) -> None:
        take_units(self)
        if {len(self.size), len(self.cells), len(self.at), len(self.shares)} != {3}:
            raise SceneError(
                f"an indented block of size {self.size}, cells {self.cells}, at {self.at}, shares "
                f"{self.shares}: three numbers each are needed"
            )

    def resolved(self, folder: Path) -> Mesh:
        low = (*(s / 2 if self.part == "quarter" else 0.0 for s in self.size[:2]), 0.0)
        mesh = clustered_block(low, self.size, self.cells, self.at, self.shares)
        return _bare(mesh, self.element)

    def scaled(self, share: float) -> "IndentedBlock":
        return replace(self, cells=member(self.cells, share))

    @property
    def middle(self) -> tuple[float, ...]:
        """x, y m of the axis of symmetry of a quarter."""
        return tuple(s / 2 for s in self.size[:2]) if self.part == "quarter" else ()

    @property
    def held(self) -> tuple[Support, ...]:
        return _held(self.middle)

    @property
    def copies(self) -> int:
        return 4 if self.part == "quarter" else 1


@dataclass(frozen=True)
class IndentedCylinder:
    """A quarter of a cylinder about z from the origin up, pressed on its axis; held on its planes.

    `shares`: the lengths of the cells at the pressed end over the mean ones, along the radius and
    the height.
    """

    diameter: float = quantity(0.0, "m", "diameter")
    height: float = quantity(0.0, "m", "height")
    cells: tuple[int, ...] = quantity((4, 4), "1", "cells along the radius and the height")
    shares: tuple[float, ...] = quantity(
        (1.0, 1.0), "1", "length of the cells at the end over the mean one"
    )
    end: Literal["zmax", "zmin"] = quantity("zmax", "1", "the end that is pressed")
    element: Element = quantity("hex8", "1", "element")

    def __post_init__(self) -> None:
        take_units(self)
        if {len(self.cells), len(self.shares)} != {2}:
            raise SceneError(
                f"an indented cylinder of cells {self.cells}, shares {self.shares}: two numbers "
                "each are needed, along the radius and the height"
            )

    def resolved(self, folder: Path) -> Mesh:
        (radial, axial), R = self.cells, self.diameter / 2
        top = self.height if self.end == "zmax" else 0.0
        mesh = clustered_block(
            (0.0,) * 3, (1.0, 1.0, self.height), (radial, radial, axial), (0.0, 0.0, top),
            (self.shares[0], self.shares[0], self.shares[1]),
        )  # fmt: skip
        u, v, z = mesh.nodes.T
        nodes = np.stack([R * u * np.sqrt(1 - v**2 / 2), R * v * np.sqrt(1 - u**2 / 2), z], axis=1)
        return _bare(replace(mesh, nodes=nodes), self.element)

    def scaled(self, share: float) -> "IndentedCylinder":
        return replace(self, cells=member(self.cells, share))

    @property
    def middle(self) -> tuple[float, ...]:
        return (0.0, 0.0)

    @property
    def held(self) -> tuple[Support, ...]:
        return _held(self.middle)

    @property
    def copies(self) -> int:
        return 4


def _bare(mesh: Mesh, element: Element) -> Mesh:
    """Without facet sets: those of a part would be named as sides of the whole body."""
    bare = replace(mesh, facets={})
    return bare.quadratic() if element == "hex27" else bare


def _held(axis: tuple[float, ...]) -> tuple[Support, ...]:
    """Planes of symmetry through an axis x, y m."""
    if not axis:
        return ()
    at, normals = (*axis, 0.0), ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    return tuple(Support(OnPlane(at, n).faces, (c,)) for c, n in enumerate(normals))
