"""Bodies of Abaqus .inp files: nodes, one shape of solid elements, node sets as facet sets.

The file states no unit. Materials, steps and loads in it are not taken: a scene declares its own.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats, Ints
from validate.errors import RecordingError, SceneError
from validate.recording.formats.apart import decoded
from validate.scene.mesh import Kind, Mesh, quadratic, require_positive_cells
from validate.scene.shape_functions import EDGES
from validate.units import in_si

_KINDS: Mapping[str, Kind] = {"tetra": "tet4", "tetra10": "tet10", "hexahedron": "hex8"}
_CELLS, _NSET = "cells.", "nset."
_MOST = 64 * 2**20  # bytes: some 500 000 tetrahedra
_STRAIGHT = 1e-3  # of an edge: how far its middle node may lie off


def read_abaqus(path: Path, unit: str = "m") -> Mesh:
    """The body, lengths in `unit`; facet sets are the outer facets whose nodes are all in a node
    set. Nodes that no element has are left out.

    Raises `SceneError` for a file that is missing, too large or damaged, more than one part, shapes
    other than C3D4, C3D10, C3D8 and their variants or several of them, and curved edges;
    `UsageError` without the library.
    """
    factor = in_si(1.0, unit, "m")
    if factor is None:
        raise SceneError(f"{path.name}: '{unit}' is no unit of length; as mm")
    size = path.stat().st_size if path.is_file() else -1
    if not 0 < size <= _MOST:
        why = "no such file" if size < 0 else f"{size} bytes; 1 to {_MOST} are read"
        raise SceneError(f"{path.name}: {why}")
    try:
        found = decoded("validate.scene.abaqus_arrays", path, "abaqus")
    except RecordingError as error:
        raise SceneError(str(error)) from None
    return _mesh(path.name, found, factor)


def _mesh(name: str, found: Mapping[str, NDArray[Any]], factor: float) -> Mesh:
    shapes = {k.removeprefix(_CELLS): v for k, v in found.items() if k.startswith(_CELLS)}
    if len(shapes) != 1 or next(iter(shapes)) not in _KINDS:
        told = ", ".join(f"{len(v)} {k}" for k, v in shapes.items()) or "none"
        raise SceneError(f"{name}: its elements are {told}; one of {', '.join(_KINDS)} is taken")
    ((shape, cells),) = shapes.items()
    kind, points = _KINDS[shape], factor * found["points"]
    if kind == "tet10":
        _require_straight(name, points[cells])
        kind, cells = "tet4", cells[:, :4]
    used, at = np.unique(cells, return_inverse=True)
    mesh = Mesh(points[used], at.reshape(cells.shape), kind)
    try:
        require_positive_cells(mesh)
    except SceneError as error:
        raise SceneError(f"{name}: {error}") from error
    mesh = replace(mesh, facets=_facets(mesh, used, found))
    return quadratic(mesh) if shape == "tetra10" else mesh


def _facets(mesh: Mesh, used: Ints, found: Mapping[str, NDArray[Any]]) -> dict[str, Ints]:
    """The outer facets (f, m) of every node set that has any; nodes in the file's numbers."""
    outer = used[mesh.surface]
    sets = {k.removeprefix(_NSET): v for k, v in found.items() if k.startswith(_NSET)}
    inside = {k: np.isin(outer, nodes).all(axis=1) for k, nodes in sets.items()}
    return {k: mesh.surface[rows] for k, rows in inside.items() if rows.any()}


def _require_straight(name: str, x: Floats) -> None:
    """x (e, 10, 3) m of quadratic tetrahedra."""
    for k, (a, b) in enumerate(EDGES[3]):
        off = np.linalg.norm(x[:, 4 + k] - (x[:, a] + x[:, b]) / 2, axis=1)
        bent = off > _STRAIGHT * np.linalg.norm(x[:, b] - x[:, a], axis=1)
        if bent.any():
            raise SceneError(
                f"{name}: {int(bent.sum())} edges {a}-{b} are curved, middles up to "
                f"{1e3 * off.max():.3g} mm off; straight ones are taken: export linear elements"
            )
