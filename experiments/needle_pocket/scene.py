"""The body of paper 000, section 5.2: the block of section 3.3 around a pocket, held below.

5 x 5 cm, E 34 kPa, nu .35, plane strain; "solid" is a cube of the same side around a capsule, which
the paper does not have. x is centred, y runs up from -side to 0. In the plane forces are per metre
of depth.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from validate.parameters import quantity
from validate.scene.geometries.hollow_block import Cavities, HollowBlock
from validate.scene.geometries.inclusion import Block, Capsule
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.scene import Cavity, Scene, Support

POCKET = "pocket"
Space = Literal["plane", "solid"]


@dataclass(frozen=True)
class PocketBody:
    """The geometry, with the facet sets "bottom", "top" and "pocket"."""

    space: Space = quantity("plane", "1", "the plane block of section 3.3, or a cube in 3-D")
    side: float = quantity(0.05, "m", "of the block")
    pocket: float = quantity(0.010, "m", "side of the square pocket, in the middle")
    radius: float = quantity(0.009, "m", "of the capsule, in 3-D")
    length: float = quantity(0.028, "m", "of the capsule, along z, in 3-D")
    plane: int = quantity(40, "1", "squares across the plane block, of two triangles each")
    solid: int = quantity(8, "1", "cells along an edge of the cube, of six tetrahedra each")
    element: Literal["linear", "quadratic"] = quantity("linear", "1", "element order")

    @property
    def dimension(self) -> int:
        return 2 if self.space == "plane" else 3

    @property
    def held(self) -> tuple[Support, ...]:
        return (Support("bottom", tuple(range(self.dimension))),)

    def resolved(self, folder: Path) -> Mesh:
        """The mesh. Raises `SceneError` for a pocket that it cannot hold."""
        mesh = self._plane() if self.space == "plane" else self._solid()
        return mesh.quadratic() if self.element == "quadratic" else mesh

    def scaled(self, share: float) -> "PocketBody":
        """In 3-D half as far from this one: few cells do not resolve the capsule."""
        plane, solid = round(share * self.plane), round((1 + share) / 2 * self.solid)
        return replace(self, plane=plane, solid=solid)

    def _plane(self) -> Mesh:
        cavity = Cavities(1, self.pocket, self.pocket)
        mesh = HollowBlock(self.side, self.side, self.plane, cavities=cavity).resolved(Path())
        facets = {k: mesh.facets[k] for k in ("bottom", "top")} | {POCKET: mesh.facets["cavity0"]}
        return Mesh(mesh.nodes, mesh.cells, mesh.kind, facets)

    def _solid(self) -> Mesh:
        a = self.side
        shape = Capsule((a / 2, a / 2, a / 2), self.radius, self.length, axis=2)
        mesh = Block(a, a, a).around((self.solid + 1,) * 3, shape)
        facets = {"bottom": "y0", "top": "y1", POCKET: "cavity"}
        return Mesh(
            mesh.nodes - [a / 2, a, a / 2], mesh.cells, mesh.kind,
            {name: mesh.facets[of] for name, of in facets.items()},
        )  # fmt: skip


SCENE = Scene(
    body=PocketBody(),
    material=Material("34 kPa", 0.35),
    cavities=(Cavity(POCKET, POCKET),),
)
