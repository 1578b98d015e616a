"""Planar block with rectangular cavities in a row.

    HollowBlock(cells=40)                                          one cavity of 10 mm in 50 mm
    HollowBlock(cells=40, cavities=Cavities(2, septum="5 mm"))     two, with a wall between them

x is centred, y runs from -height to 0. Facet sets: "bottom", "top", "patch" (the middle of the
top), "cavity0", "cavity1", "cavity2".
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.parameters import quantity, take_units
from validate.scene.mesh import Mesh, boundary_facets


@dataclass(frozen=True)
class Cavities:
    """Equal cavities in a row, centred in their block."""

    count: int = quantity(1, "1", "cavities in a row: 1, 2 or 3")
    width: float = quantity(0.010, "m", "of each cavity")
    height: float = quantity(0.010, "m", "of each cavity")
    septum: float = quantity(0.005, "m", "wall between two cavities")

    def __post_init__(self) -> None:
        take_units(self)


@dataclass(frozen=True)
class HollowBlock:
    """Squares split by alternating diagonals into triangles."""

    width: float = quantity(0.05, "m", "of the block")
    height: float = quantity(0.05, "m", "of the block")
    cells: int = quantity(40, "1", "squares across the block, of two triangles each")
    element: Literal["tri3", "tri6"] = quantity("tri3", "1", "element")
    cavities: Cavities = Cavities()
    patch: float = quantity(0.01, "m", "width of the facet set 'patch' in the middle of the top")

    def __post_init__(self) -> None:
        take_units(self)

    def resolved(self, folder: Path) -> Mesh:
        """Return the mesh. Raises `SceneError` for cavities that touch each other or the outside,
        or do not fall on whole squares."""
        h = self.width / self.cells
        nx, ny = self.cells, _whole(self.height, h, "body.height")
        solid = np.ones((nx, ny), dtype=bool)
        # The squares of each cavity, centred in the block.
        cavities = self.cavities
        if cavities.count not in (1, 2, 3):
            raise SceneError(f"body.cavities.count = {cavities.count}: 1, 2 or 3")
        wide = _whole(cavities.width, h, "body.cavities.width")
        tall = _whole(cavities.height, h, "body.cavities.height")
        if cavities.count > 1 and not cavities.septum > 0:
            raise SceneError(
                f"body.cavities.septum = {1e3 * cavities.septum:g} mm: the {cavities.count} "
                "cavities touch each other; leave a wall between them"
            )
        apart = _whole(cavities.septum, h, "body.cavities.septum") if cavities.count > 1 else 0
        row = cavities.count * wide + (cavities.count - 1) * apart
        if row > nx - 2 or tall > ny - 2:
            raise SceneError(
                f"{cavities.count} cavities take {row} x {tall} of {nx} x {ny} squares: they "
                "touch the outside; make them smaller"
            )
        if (nx - row) % 2 or (ny - tall) % 2:
            raise SceneError(
                f"{cavities.count} cavities take {row} x {tall} of {nx} x {ny} squares: not "
                "centred on whole ones; take another body.cells"
            )
        left, bottom = (nx - row) // 2, (ny - tall) // 2
        starts = [left + k * (wide + apart) for k in range(cavities.count)]
        boxes = [(slice(s, s + wide), slice(bottom, bottom + tall)) for s in starts]
        for i, j in boxes:
            solid[i, j] = False
        x, y = np.meshgrid(
            np.linspace(-self.width / 2, self.width / 2, nx + 1),
            np.linspace(-self.height, 0.0, ny + 1), indexing="ij",
        )  # fmt: skip
        nodes, cells = _split(np.stack([x.ravel(), y.ravel()], axis=1), solid)
        outside = boundary_facets(cells, 2)
        middle = nodes[outside].mean(axis=1)
        facets = {
            "bottom": outside[np.isclose(middle[:, 1], -self.height)],
            "top": outside[np.isclose(middle[:, 1], 0.0)],
        }
        on_patch = np.abs(middle[:, 0]) < max(self.patch / 2, 0.51 * h)
        facets["patch"] = outside[np.isclose(middle[:, 1], 0.0) & on_patch]
        for k, (i, j) in enumerate(boxes):
            low = np.array([x[i.start, 0], y[0, j.start]]) - h / 4
            high = np.array([x[i.stop, 0], y[0, j.stop]]) + h / 4
            facets[f"cavity{k}"] = outside[((middle > low) & (middle < high)).all(axis=1)]
        mesh = Mesh(nodes, cells, "tri3", facets)
        return mesh.quadratic() if self.element == "tri6" else mesh

    def scaled(self, share: float) -> "HollowBlock":
        return replace(self, cells=round(share * self.cells))


def _whole(length: float, h: float, name: str) -> int:
    count = round(length / h)
    if count < 1 or abs(length / h - count) > 1e-6:
        raise SceneError(
            f"{name} = {1e3 * length:g} mm is {length / h:.3f} squares of {1e3 * h:.4g} mm: choose "
            "whole squares, or other body.cells"
        )
    return count


def _split(nodes: Floats, solid: np.ndarray) -> tuple[Floats, Ints]:
    """Two triangles of every solid square, diagonals alternating; unused nodes dropped."""
    i, j = (a.ravel() for a in np.nonzero(solid))
    n = solid.shape[1] + 1
    a, b = i * n + j, (i + 1) * n + j
    d, c = a + 1, b + 1
    even = ((i + j) % 2 == 0)[:, None]
    first = np.where(even, np.stack([a, b, c], 1), np.stack([a, b, d], 1))
    second = np.where(even, np.stack([a, c, d], 1), np.stack([b, c, d], 1))
    used, number = np.unique(np.vstack([first, second]), return_inverse=True)
    return nodes[used], np.asarray(number).reshape(-1, 3)
