"""The liver of paper 003, section 3.2: the data folder's body, or one of ours of about that size.

The paper's mesh (4941 tetrahedra, 1083 nodes) is not printed, nor are its sets beyond words: "nodes
on the left side of the top surface" held, "the right lobe, on both top and bottom surfaces" loaded.
Here both are rules that hold on any such body, and so are the nodes that are observed. Axes: x to
the body's left, z up.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from validate.arrays import Floats, Ints
from validate.datasets.home import data_path
from validate.errors import RecordingError, SceneError
from validate.parameters import quantity
from validate.pipeline.experiment.experiment import Progress
from validate.pipeline.experiment.tree import Tree, beside
from validate.pipeline.run.twin_record import stamped
from validate.recording.types import Recording
from validate.scene.geometries.box import box
from validate.scene.mesh import Mesh
from validate.scene.mesh_files.mesh_file import read_mesh

FOLDER, FILE = "mesh/liver", "Liver_Iso_935n_4408t.inp"
Body = Literal["data", "generated"]

SIZE = (0.22, 0.17, 0.13)  # m, of the box that our body is bent from
CELLS = (13, 9, 7)  # boxes of six tetrahedra along its edges
_ROUND = 0.6  # of the way from a box to a ball: a whole ball has flat cells along the box's edges
_THIN, _SHALLOW = 0.62, 0.42  # what the left end lacks of height and of depth
_DOME, _HOLLOW = 0.10, 0.14  # of half the height: ends below the middle, hollow of the underside
_LEFT, _RIGHT = 0.30, 0.28  # of the length: where faces are held, where they are loaded
_FACING = 0.35  # least vertical part of an outward normal: what counts as top or bottom


@dataclass(frozen=True)
class LiverBody:
    """The geometry of a scene, with the facet sets "held" and "loaded"."""

    body: Literal["here", "data", "generated"] = quantity(
        "here", "1", "the data folder's liver, a generated one, or the first where it is here"
    )
    file: str = quantity("", "1", "another body in m instead of the data folder's (.inp, .npz)")

    def which(self, folder: Path) -> Body:
        """What stands for the liver on this machine; `folder` is that of the experiment."""
        if self.body != "here":
            return self.body
        try:
            return "data" if self.file or data_path(FOLDER, FILE, folder) else "generated"
        except RecordingError:
            return "generated"

    def resolved(self, folder: Path) -> Mesh:
        """The mesh. Raises `RecordingError` naming the command that brings an absent file,
        `SceneError` for a body that has no faces to hold or to load."""
        if self.which(folder) == "generated":
            return with_sets(generated_liver())
        path = data_path(FOLDER, FILE, folder, self.file or None, "body.file")
        return with_sets(read_mesh(path, "m"))

    def scaled(self, share: float) -> "LiverBody":
        """Raises `SceneError`: no other mesh of the data folder's body is known."""
        raise SceneError("the liver has no similar meshes; vary another parameter")


def generated_liver(cells: tuple[int, int, int] = CELLS) -> Mesh:
    """A rounded wedge with a thick right and a thin left end, domed above, hollow below.

    A grid of boxes, six tetrahedra each, bent by formulas: the same on every machine. Raises
    `SceneError` where the bending turns a cell over.
    """
    grid = box((2.0, 2.0, 2.0), cells)
    mesh = Mesh(_bent(grid.nodes - 1) * np.array(SIZE) / 2, grid.cells, "tet4")
    if (mesh.cell_volumes() <= 0).any():
        raise SceneError(f"{cells} cells: the bending turns a cell over; use other numbers")
    return mesh


def _bent(q: Floats) -> Floats:
    """Points of the cube [-1, 1]^3 (n, 3) on the body, before it is scaled."""
    x, y, z = ((1 - _ROUND) * q + _ROUND * _ball(q)).T
    left = (1 + x) / 2
    below = (1 - z) / 2
    height = 1 - _THIN * left
    upward = 0.8 * _THIN * left - _DOME * x**2 + _HOLLOW * below * (1 - y**2) * (1 - x**2)
    return np.stack([x, (1 - _SHALLOW * left) * y - 0.2 * left, height * z + upward], axis=1)


def _ball(q: Floats) -> Floats:
    """The cube's points on a ball: faces go to its surface."""
    a, b = q[:, [1, 2, 0]] ** 2, q[:, [2, 0, 1]] ** 2
    return np.asarray(q * np.sqrt(1 - a / 2 - b / 2 + a * b / 3))


def with_sets(mesh: Mesh) -> Mesh:
    """The body with "held" (top faces of the left part) and "loaded" (top and bottom faces of the
    right lobe); raises `SceneError` where one of them would be empty."""
    facets, up, x = mesh.surface, _vertical(mesh), mesh.nodes[mesh.surface[:, :3], 0]
    low, high = mesh.nodes[:, 0].min(), mesh.nodes[:, 0].max()
    left = (x >= high - _LEFT * (high - low)).all(axis=1)
    right = (x <= low + _RIGHT * (high - low)).all(axis=1)
    sets: dict[str, Ints] = {
        "held": facets[left & (up > _FACING)],
        "loaded": facets[right & (np.abs(up) > _FACING)],
    }
    for name, chosen in sets.items():
        if not len(chosen):
            raise SceneError(f"no faces are {name}: the body's length must lie along x, up along z")
    return replace(mesh, facets={**mesh.facets, **sets})


def watched(mesh: Mesh) -> dict[str, int]:
    """Return nodes A, of the loaded ones the nearest to their middle, and B, of the free ones of
    the surface the nearest to the middle of the body's top."""
    x, loaded = mesh.nodes, mesh.facet_nodes("loaded")
    taken = np.union1d(loaded, mesh.facet_nodes("held"))
    free = np.setdiff1d(np.unique(mesh.surface), taken)
    low, high = x.min(axis=0), x.max(axis=0)
    top = np.array([*(low + high)[:2] / 2, high[2]])
    return {
        "node_A": _nearest(x, loaded, x[loaded].mean(axis=0)),
        "node_B": _nearest(x, free, top),
    }


def _nearest(x: Floats, nodes: Ints, point: Floats) -> int:
    return int(nodes[np.argmin(np.linalg.norm(x[nodes] - point, axis=1))])


def of_its_body(
    tree: Tree, folder: Path, shipped: str, record: Callable[[Tree, Progress], Recording]
) -> tuple[Recording, ...]:
    """Return the named recording, else the shipped one of the generated body, else one of the data
    folder's body, made in memory.

    Raises `RecordingError` for a recording of another body than the one that is here.
    """
    which = tree.scene.body.which(folder)
    if which == "data" and not tree.recording:
        return (stamped(record(tree, lambda _: None), tree),)
    (recording,) = beside(replace(tree, recording=tree.recording or shipped), folder)
    of = recording.metadata.get("provenance", {}).get("body", which)
    if of != which:
        raise RecordingError(
            f"{recording.source.path} is of body '{of}', not of '{which}'; pass --set "
            f"body.body={of}"
        )
    return (recording,)


def _vertical(mesh: Mesh) -> Floats:
    """Vertical part (f,) of the outward unit normals of the surface."""
    p = mesh.nodes[mesh.surface[:, :3]]
    normals = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    return np.asarray(normals[:, 2] / np.linalg.norm(normals, axis=1))
