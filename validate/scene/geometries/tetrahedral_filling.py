"""Tetrahedra in a closed surface (STL, OBJ, PLY), by fTetWild."""

from pathlib import Path

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import RecordingError, SceneError
from validate.recording.formats.subprocess_decoder import decoded
from validate.scene.mesh import Mesh, cell_volumes, require_positive_cells
from validate.scene.mesh_files.third_party_meshes import ForeignBody, metres, require_readable

SUFFIXES = (".stl", ".obj", ".ply")
_SECONDS = 300  # of meshing
_TURN = [0, 2, 1, 3]


def filled(path: Path, unit: str, edge: float = 0.0, within: float = 1e-3) -> ForeignBody:
    """Return the body inside a surface with lengths in `unit`, of edges of about `edge` m (0: a
    twentieth of its diagonal).

    Its surface lies `within` that share of the diagonal of the given one; both volumes are told,
    and how many triangles were the wrong way round. Two fillings of one surface are two meshes.
    Raises `SceneError` for a surface that is open, cuts itself, is damaged or too large,
    `UsageError` without the library.
    """
    factor = metres(path.name, unit)
    if not (np.isfinite(edge) and edge >= 0):
        raise SceneError(f"{path.name}: edges of {edge:g} m; 0 or above")
    require_readable(path)
    try:
        found = decoded(
            "validate.scene.mesh_files.surface_arrays",
            path,
            {"edge": edge / factor, "within": within},
            _SECONDS,
        )
    except RecordingError as error:
        raise SceneError(str(error)) from None
    try:
        mesh = _mesh(factor * found["points"], found["cells.tetra"])
    except SceneError as error:
        raise SceneError(f"{path.name}: {error}") from error
    volume, enclosed, may = (
        float(cell_volumes(mesh).sum()), *(factor**3 * float(found[k]) for k in
                                           ("enclosed", "may_differ")),
    )  # fmt: skip
    share = f"{1e6 * volume:.4g} cm3 ({100 * (volume / enclosed - 1):+.2f} %)"
    around = f"{int(found['triangles'])} triangles around {1e6 * enclosed:.4g} cm3"
    if abs(volume - enclosed) > may:
        raise SceneError(
            f"{path.name}: {around}, filled are {share}, where {100 * may / enclosed:.2g} % "
            "may differ: the surface intersects itself, or parts of it overlap; unite them "
            "first"
        )
    turned = f"{int(found['turned'])} of {int(found['triangles'])} triangles"
    return ForeignBody(mesh, {"surface": around, "turned": turned, "filled": share})


def _mesh(nodes: Floats, cells: Ints) -> Mesh:
    mesh = Mesh(nodes, cells, "tet4")
    if cell_volumes(mesh).sum() < 0:
        mesh = Mesh(mesh.nodes, mesh.cells[:, _TURN], "tet4")
    require_positive_cells(mesh)
    return mesh
