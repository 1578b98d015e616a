"""Mesh files as npz of plain arrays, and closed surfaces filled with tetrahedra by fTetWild.

Arrays: "kind" (text), "nodes" (n, d) float64 m, "cells" (e, k) int32, one "facets.<set>" (f, m)
int32 per facet set, and "provenance" (text), which is for people.
"""

from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from validate.errors import RecordingError, SceneError
from validate.files import npz_arrays
from validate.places import replacing
from validate.recording.formats.subprocess_decoder import decoded
from validate.scene.mesh import Kind, Mesh, require_positive_cells
from validate.scene.mesh_files.third_party_meshes import SUFFIXES as FOREIGN
from validate.scene.mesh_files.third_party_meshes import (
    ForeignBody,
    metres,
    read_foreign,
    require_readable,
)

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
        mesh = Mesh((factor * found["points"]), found["cells.tetra"], "tet4")
        if mesh.cell_volumes().sum() < 0:
            mesh = Mesh(mesh.nodes, mesh.cells[:, _TURN], "tet4")
        require_positive_cells(mesh)

    except SceneError as error:
        raise SceneError(f"{path.name}: {error}") from error
    volume, enclosed, may = (
        float(mesh.cell_volumes().sum()), *(factor**3 * float(found[k]) for k in
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


MAX_BYTES = 64_000_000  # of all arrays together: some 400 000 tetrahedra
_FACETS = "facets."
_TEXT = 4000  # characters of a text array


def write_mesh(mesh: Mesh, path: Path, provenance: str = "") -> None:
    """The mesh with a note of where it comes from; raises `SceneError` when it is too large."""
    arrays: dict[str, NDArray[Any]] = {
        "kind": np.array(mesh.kind),
        "nodes": mesh.nodes,
        "cells": mesh.cells.astype(np.int32),
        "provenance": np.array(provenance[:_TEXT]),
        **{f"{_FACETS}{name}": f.astype(np.int32) for name, f in mesh.facets.items()},
    }
    size = sum(a.nbytes for a in arrays.values())
    if size > MAX_BYTES:
        raise SceneError(f"mesh of {size} bytes, the limit of a mesh file is {MAX_BYTES}")
    with replacing(path) as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)


def read_mesh(path: Path, unit: str | None = None) -> Mesh:
    """Return the mesh of a file that `write_mesh` wrote, or of one of `foreign_mesh` with lengths
    in `unit`.

    Raises `SceneError`, one line that names the file, for one that is missing, damaged, too large
    or no such mesh, for inverted elements, without a unit that it needs, with one that it does not
    have (npz is in metres), and for a surface.
    """
    suffix = path.suffix.lower()
    if suffix in FOREIGN and unit is None:
        raise SceneError(f"{path.name}: no unit of length; give it: body.unit=mm")
    if suffix in FOREIGN:
        return read_foreign(path, unit or "").mesh
    if suffix in SUFFIXES:
        raise SceneError(
            f"{path.name}: the file is a surface; fill it first: validate body {path.name} "
            "--unit mm -o body.npz"
        )
    if unit is not None and metres(path.name, unit) != 1.0:
        raise SceneError(f"{path.name}: npz is in metres, not in {unit}; omit the unit")
    try:
        arrays = npz_arrays(path, MAX_BYTES)
    except RecordingError as error:
        raise SceneError(str(error)) from None
    try:
        missing = [name for name in ("kind", "nodes", "cells") if name not in arrays]
        if missing:
            raise SceneError(
                f"no {missing} among its arrays {sorted(arrays)[:8]}; write them: np.savez(FILE, "
                "kind='tet4', nodes=(n, 3) floats in metres, cells=(e, 4) whole numbers from 0)"
            )
        facets = {k.removeprefix(_FACETS): v for k, v in arrays.items() if k.startswith(_FACETS)}
        for name, a in {"cells": arrays["cells"], **facets}.items():
            if a.dtype.kind not in "iu":
                raise SceneError(f"'{name}' holds {a.dtype}, expected integers")
        if arrays["nodes"].dtype.kind != "f":
            raise SceneError(f"'nodes' holds {arrays['nodes'].dtype}, expected floats")
        mesh = Mesh(arrays["nodes"], arrays["cells"], _kind(arrays["kind"]), facets)
        require_positive_cells(mesh)
        return mesh
    except SceneError as error:
        raise SceneError(f"{path.name}: {error}") from error


def _kind(value: NDArray[Any]) -> Kind:
    kinds: tuple[Kind, ...] = get_args(Kind)
    for kind in kinds:
        if value.dtype.kind == "U" and value.shape == () and str(value) == kind:
            return kind
    raise SceneError(f"kind {str(value)[:40]!r}: one of {', '.join(kinds)}")
