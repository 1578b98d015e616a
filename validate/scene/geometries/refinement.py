"""Refinement of a body's mesh, and its mesh of straight linear cells."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.spatial import KDTree

from validate.arrays import Ints
from validate.errors import SceneError, ValidateError
from validate.places import cache
from validate.scene.mesh import Kind, Mesh
from validate.scene.mesh_files.mesh_file import filled, read_mesh, write_mesh
from validate.scene.scene import Scene
from validate.scene.shape_functions import CORNERS, LATTICE

# --- A coarser mesh of a body whose own mesh is the finest that fits: filled anew from its
# surface.
#
# Where no finer mesh can be solved, an answer on this one bounds the numerical error of the own
# mesh. The two are not similar, so that no order can be observed: two sizes, a factor of safety
# of three.

_EDGE = 2.04  # of the cube root of its volume: the edge of a regular tetrahedron
_LARGE = 5_000  # nodes: filling takes some 8 s at 27 000, with edges twice as long 17 s
_FEW = 100
_WITHIN = 0.05  # of the coarse edge: how far the surface may lie off


def coarser(mesh: Mesh, times: int = 1) -> Mesh:
    """Return the body in linear tetrahedra with edges about twice as long, of a large mesh thrice;
    twice as long again for each further one of `times`.

    A facet set is of the facets next to those of the set on the own mesh; one that lies inside the
    body is left out. Raises `SceneError` for a mesh that is not 3-D, and what `filled` does.
    """
    if mesh.dimension != 3:
        raise SceneError(f"cells of {mesh.kind}: only bodies in 3-D are filled anew")
    if len(mesh.nodes) < _FEW:
        raise SceneError(f"{len(mesh.nodes)} nodes: too few for a mesh with fewer")
    by = (3.0 if len(mesh.nodes) > _LARGE else 2.0) * 2.0 ** (times - 1)
    # Triangles (t, 3) of a surface; a brick's face is two.
    if not mesh.bricks:
        triangles = mesh.surface[:, :3]
    else:
        triangles = np.concatenate([mesh.surface[:, [0, 1, 2]], mesh.surface[:, [0, 2, 3]]])
    edge = _EDGE * float(np.cbrt(np.abs(mesh.cell_volumes()).mean()))
    if mesh.bricks:
        edge /= _EDGE
    diagonal = float(np.linalg.norm(np.ptp(mesh.nodes, axis=0)))
    within = max(1e-3, _WITHIN * by * edge / diagonal)
    used, numbers = np.unique(triangles, return_inverse=True)
    points, corners = mesh.nodes[used].tobytes(), numbers.astype(np.int64).tobytes()
    try:
        coarse = _filling(points, corners, by * edge, within)
    except SceneError as error:
        words = f"its surface cannot be filled with edges of {1e3 * by * edge:.3g} mm"
        raise SceneError(f"{words}: {error}") from error
    if len(coarse.nodes) >= len(mesh.nodes):
        raise SceneError(
            f"a filling with edges of {1e3 * by * edge:.3g} mm has {len(coarse.nodes)} nodes, the "
            f"mesh {len(mesh.nodes)}: its surface has details that need small cells"
        )
    # The facet sets of the coarse mesh's surface by their nearest facets on the fine one.
    count = 4 if mesh.bricks else 3
    own, surface = mesh.surface[:, :count], coarse.surface
    centres = mesh.nodes[own].mean(axis=1)
    _, nearest = KDTree(centres).query(coarse.nodes[surface].mean(axis=1))
    keys = {tuple(sorted(facet)): i for i, facet in enumerate(own.tolist())}
    found = {}
    for name, facets in mesh.facets.items():
        rows = [keys.get(tuple(sorted(facet))) for facet in facets[:, :count].tolist()]
        inside = np.zeros(len(own), dtype=bool)
        inside[[row for row in rows if row is not None]] = True
        if inside.any():
            chosen = inside[nearest]
            if not chosen.any():  # smaller than a facet here
                chosen[KDTree(coarse.nodes[surface].mean(axis=1)).query(centres[inside])[1]] = True
            found[name] = surface[chosen]
    return Mesh(coarse.nodes, coarse.cells, coarse.kind, found)


def size_against(own: Mesh, coarse: Mesh) -> float:
    """How many times as far apart the nodes of the coarse mesh are; cells of two shapes have no
    common size."""
    return float(np.cbrt(len(own.nodes) / len(coarse.nodes)))


@lru_cache(maxsize=4)
def _filling(points: bytes, triangles: bytes, edge: float, within: float) -> Mesh:
    """The filling of a surface of points (n, 3) m and triangles (t, 3), kept in the user's cache:
    two fillings of one surface are two meshes, and a bound should not change from run to run."""
    asked = points + triangles + repr((edge, within)).encode()
    kept = cache("fillings") / f"{sha256(asked).hexdigest()[:32]}.npz"
    with suppress(ValidateError):
        return read_mesh(kept)
    corners = np.frombuffer(points).reshape(-1, 3)
    faces = np.frombuffer(triangles, np.int64).reshape(-1, 3) + 1
    lines = ["v {:.17g} {:.17g} {:.17g}".format(*x) for x in corners.tolist()]
    lines += ["f {} {} {}".format(*face) for face in faces.tolist()]
    with TemporaryDirectory(prefix="validate-") as folder:
        path = Path(folder) / "surface.obj"
        path.write_text("\n".join(lines) + "\n", "ascii")
        mesh = filled(path, "m", edge, within).mesh
    with suppress(OSError, ValidateError):
        kept.parent.mkdir(parents=True, exist_ok=True)
        write_mesh(mesh, kept)
    return mesh


# -------------------------------------------------------------------------------------------------

# The cells of a quadratic simplex, by the local numbers of its nodes (mesh.EDGES): corners first,
# then what is left in the middle.
_PARTS = {
    2: ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
    3: (
        (0, 4, 6, 7), (4, 1, 5, 8), (6, 5, 2, 9), (7, 8, 9, 3),
        (4, 8, 6, 7), (4, 5, 6, 8), (6, 8, 9, 7), (6, 5, 9, 8),
    ),
}  # fmt: skip
_HALVES = ((0, 2), (2, 1))  # of a quadratic edge


def linear(mesh: Mesh) -> Mesh:
    """Return the mesh of its vertices alone; linear ones as they are."""
    if mesh.order == 1:
        return mesh
    d = mesh.dimension
    kind: Kind = "hex8" if mesh.bricks else "tri3" if d == 2 else "tet4"
    count = int(mesh.corners.max()) + 1
    facets = {name: f[:, : 4 if mesh.bricks else d] for name, f in mesh.facets.items()}
    return Mesh(mesh.nodes[:count], mesh.corners, kind, facets)


def refined(scene: Scene) -> Scene:
    """Every cell cut into 2^d at the middles of its edges (of hexahedra also of their faces and of
    itself); facet sets and regions follow.

    Cells of linear elements. Raises `SceneError` for quadrilaterals.
    """
    fine = linear(scene.mesh).quadratic()
    d, kind = fine.dimension, linear(scene.mesh).kind
    inside, outside = _PARTS[d], _HALVES if d == 2 else _PARTS[2]
    if fine.bricks:
        inside, outside = _bricks(3), _bricks(2)
    facets = {name: _cut(f, outside) for name, f in fine.facets.items()}
    mesh = Mesh(fine.nodes, _cut(fine.cells, inside), kind, facets)
    each = np.arange(2**d)
    regions = tuple(
        replace(r, cells=(2**d * r.cells[:, None] + each).ravel()) for r in scene.regions
    )
    return replace(scene, body=mesh, regions=regions)


def _bricks(d: int) -> tuple[tuple[int, ...], ...]:
    """The 2^d bricks of a quadratic one, each at a corner, by the local numbers of its nodes."""
    at = {tuple(place): i for i, place in enumerate(LATTICE[d].tolist())}
    corners = CORNERS[d]
    return tuple(tuple(at[tuple((c + q) / 2)] for q in corners) for c in corners)


def _cut(cells: Ints, parts: Sequence[tuple[int, ...]]) -> Ints:
    """All `parts` of the first cell, then those of the second, ..."""
    return np.stack([cells[:, list(part)] for part in parts], axis=1).reshape(-1, len(parts[0]))


def of_element(scene: Scene, element: str) -> Scene:
    """Return the scene in elements "P1", "MD" (P1, nodal mean dilatation), "P2", "H8" or "Q4"."""
    mesh = linear(scene.mesh)
    if element in ("H8", "Q4"):
        shaped = any(drive.shape is not None for drive in scene.drives)  # node by node
        return scene if shaped else replace(scene, body=mesh)
    return replace(
        scene,
        body=mesh.quadratic() if element == "P2" else mesh,
        dilatation="nodal_mean" if element == "MD" else "pointwise",
    )
