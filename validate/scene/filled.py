"""A body from its closed surface (STL, OBJ, PLY), filled with tetrahedra by fTetWild."""

from pathlib import Path

import numpy as np

from validate.errors import RecordingError, SceneError
from validate.recording.formats.apart import decoded
from validate.scene.foreign_mesh import ForeignBody, metres, require_readable
from validate.scene.mesh import Mesh, cell_volumes, require_positive_cells

SUFFIXES = (".stl", ".obj", ".ply")
_SECONDS = 300  # of meshing
_TURN = [0, 2, 1, 3]


def filled(path: Path, unit: str, edge: float = 0.0) -> ForeignBody:
    """The body inside a surface with lengths in `unit`, of edges of about `edge` m (0: a twentieth
    of its diagonal).

    Its surface lies within a thousandth of the diagonal of the given one; both volumes are told.
    Raises `SceneError` for a surface that is open, damaged or too large, `UsageError` without the
    library.
    """
    factor = metres(path.name, unit)
    if not (np.isfinite(edge) and edge >= 0):
        raise SceneError(f"{path.name}: edges of {edge:g} m; 0 or above")
    require_readable(path)
    try:
        found = decoded("validate.scene.surface_arrays", path, "surfaces",
                        {"edge": edge / factor}, _SECONDS)  # fmt: skip
    except RecordingError as error:
        raise SceneError(str(error)) from None
    mesh = Mesh(factor * found["points"], found["cells.tetra"], "tet4")
    if cell_volumes(mesh).sum() < 0:
        mesh = Mesh(mesh.nodes, mesh.cells[:, _TURN], "tet4")
    require_positive_cells(mesh)
    enclosed = factor**3 * float(found["enclosed"])
    told = {
        "surface": f"{int(found['triangles'])} triangles around {1e6 * enclosed:.4g} cm3",
        "filled": f"{1e6 * cell_volumes(mesh).sum():.4g} cm3 "
        f"({100 * (cell_volumes(mesh).sum() / enclosed - 1):+.2f} %)",
    }
    return ForeignBody(mesh, told)
