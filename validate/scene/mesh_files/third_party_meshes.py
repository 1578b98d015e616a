"""Third-party mesh files: Abaqus .inp, Gmsh .msh, VTK's .vtu and .vtk.

One shape of solid elements, in the file's own unit, which it does not state. Node sets and labelled
facets become facet sets. Materials, steps and loads in a file are not taken: a scene declares its
own.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from validate.arrays import Floats, Ints
from validate.errors import RecordingError, SceneError
from validate.recording.formats.subprocess_decoder import decoded
from validate.scene.mesh import Kind, Mesh, require_positive_cells
from validate.scene.mesh_files.abaqus_arrays import arrays as abaqus_arrays
from validate.scene.shape_functions import EDGES
from validate.units import in_si

# --- One body out of a mesh of several: by the name of a label or set, or by its place by size.


def pieces(mesh: Mesh) -> Ints:
    """Of every cell (e,) which body it is of: parts without a common node, 1 the largest."""
    first = np.repeat(mesh.cells[:, 0], mesh.cells.shape[1])
    n = len(mesh.nodes)
    joined = coo_matrix((np.ones(len(first)), (first, mesh.cells.ravel())), shape=(n, n))
    _, labels = connected_components(joined, directed=False)
    _, of = np.unique(labels[mesh.cells[:, 0]], return_inverse=True)
    sizes = np.bincount(of, weights=np.abs(mesh.cell_volumes()))
    return np.asarray(np.argsort(np.argsort(-sizes, kind="stable"))[of] + 1)


def cells_of(mesh: Mesh, words: str, named: Mapping[str, Ints]) -> NDArray[np.bool_]:
    """Which cells (e,) are of the part of that name, in capitals or small letters, else of that
    number by size. Raises `SceneError` for none."""
    for name, cells in named.items():
        if name.upper() == words.upper():
            return np.isin(np.arange(len(mesh.cells)), cells)
    of = pieces(mesh)
    if words in {str(k) for k in range(1, of.max() + 1)}:
        return np.asarray(of == int(words))
    names = "".join(f"'{name[:40]}', " for name in list(named)[:12])
    sizes = f"1 (the largest) to {of.max()}" if of.max() > 1 else "1, the whole"
    raise SceneError(f"no part '{words[:40]}'; there are {names}by size {sizes}")


def only(mesh: Mesh, chosen: NDArray[np.bool_]) -> Mesh:
    """Return the chosen cells with their nodes, and what of the facet sets lies on their
    outside."""
    used = np.unique(mesh.cells[chosen])
    at = np.full(len(mesh.nodes), -1)
    at[used] = np.arange(len(used))
    alone = Mesh(mesh.nodes[used], at[mesh.cells[chosen]], mesh.kind)
    outer = {tuple(row) for row in np.sort(alone.surface, axis=1).tolist()}
    facets = {}
    for name, found in mesh.facets.items():
        mine = at[found]
        kept = mine[[tuple(sorted(row)) in outer for row in mine.tolist()]]
        if len(kept):
            facets[name] = kept
    return replace(alone, facets=facets)


# -------------------------------------------------------------------------------------------------

SUFFIXES = (".inp", ".msh", ".vtu", ".vtk")
_KINDS: Mapping[str, Kind] = {"tetra": "tet4", "hexahedron": "hex8", "tetra10": "tet4",
                              "hexahedron20": "hex8", "hexahedron27": "hex8"}  # fmt: skip
_HEX = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6),
        (3, 7))  # fmt: skip
# Between which corners the further nodes of quadratic cells lie, in their order.
_BETWEEN: Mapping[str, tuple[tuple[int, ...], ...]] = {
    "tetra10": EDGES[3],
    "hexahedron20": _HEX,
    "hexahedron27": (*_HEX, (0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 7, 6, 2), (0, 3, 2, 1),
                     (4, 5, 6, 7), (0, 1, 2, 3, 4, 5, 6, 7)),
}  # fmt: skip
_CELLS, _NSET, _FACET, _PART = "cells.", "nset.", "facet.", "part."
_MOST = 64 * 2**20  # bytes: some 500 000 tetrahedra
_LISTED = 12  # names of parts
_STRAIGHT = 1e-3  # of an edge: how far its middle node may lie off
_TURNED: Mapping[Kind, tuple[int, ...]] = {
    "tet4": (0, 2, 1, 3), "hex8": (4, 5, 6, 7, 0, 1, 2, 3),
}  # fmt: skip


@dataclass(frozen=True)
class ForeignBody:
    """A mesh, and what was done to the file's to make it, in words."""

    mesh: Mesh
    told: Mapping[str, str]

    def __post_init__(self) -> None:
        object.__setattr__(self, "told", MappingProxyType(dict(self.told)))


def metres(name: str, unit: str) -> float:
    """Metres in one `unit`; raises `SceneError` for what is no length."""
    factor = in_si(1.0, unit, "m")
    if factor is None:
        raise SceneError(f"{name}: '{unit}' is not a unit of length; write for example mm")
    return factor


def require_readable(path: Path) -> None:
    """Raise `SceneError` for a file that is missing, empty or too large."""
    size = path.stat().st_size if path.is_file() else -1
    if not 0 < size <= _MOST:
        why = "no such file" if size < 0 else f"{size} bytes; 1 to {_MOST} are read"
        raise SceneError(f"{path.name}: {why}")


def read_foreign(path: Path, unit: str, part: str | None = None) -> ForeignBody:
    """Return the body, lengths in `unit`; of several the `part` of that name or number (1: the
    largest); nodes that no element has are left out.

    Elements whose nodes are told the other way round are turned, but in .inp, whose order has a
    meaning. Raises `SceneError` for a file that is missing, too large or damaged, several parts of
    .inp of which none is chosen, a part that is not there, shapes other than linear and straight
    quadratic tetrahedra and hexahedra or several of them; `UsageError` without the library.
    """
    factor = metres(path.name, unit)
    require_readable(path)
    abaqus = path.suffix.lower() == ".inp"
    if abaqus:
        try:
            found = abaqus_arrays(path, part)
        except (SceneError, OSError) as error:
            raise SceneError(f"{path.name}: {error}") from None
    else:
        try:
            found = decoded("validate.scene.mesh_files.meshio_arrays", path)
        except RecordingError as error:
            raise SceneError(str(error)) from None
    return _body(path.name, found, factor, part, turn=not abaqus)


def _body(
    name: str, found: Mapping[str, NDArray[Any]], factor: float, part: str | None, *, turn: bool
) -> ForeignBody:
    shapes = {k.removeprefix(_CELLS): v for k, v in found.items() if k.startswith(_CELLS)}
    if len(shapes) != 1 or next(iter(shapes)) not in _KINDS:
        listed = ", ".join(f"{len(v)} {k}" for k, v in shapes.items()) or "none"
        raise SceneError(
            f"{name}: its elements are {listed}; one of {', '.join(_KINDS)} alone is "
            "supported: export them split into tetrahedra"
        )
    ((shape, cells),) = shapes.items()
    kind, points = _KINDS[shape], factor * found["points"]
    if not len(cells):
        raise SceneError(
            f"{name}: its {shape} elements are not valid; the file is damaged or truncated"
        )
    if cells.min() < 0 or cells.max() >= len(points):
        raise SceneError(
            f"{name}: its elements name nodes {cells.min()} to {cells.max()} of "
            f"{len(points)}; damaged"
        )
    unused = len(points) - len(np.unique(cells))
    if shape in _BETWEEN:
        _require_straight(name, points[cells], _BETWEEN[shape])
        cells = cells[:, : {"tet4": 4, "hex8": 8}[kind]]
    used, at = np.unique(cells, return_inverse=True)
    try:
        mesh = Mesh(points[used], at.reshape(cells.shape), kind)
        if part is not None:
            chosen = cells_of(mesh, part, _named(found))
            used, mesh = used[np.unique(mesh.cells[chosen])], only(mesh, chosen)
        mesh, turned = _turned(mesh) if turn else (mesh, 0)
        require_positive_cells(
            mesh,
            "reverse the order of their nodes, or save it as .vtu, where validate reverses it",
        )
    except SceneError as error:
        raise SceneError(f"{name}: {error}") from error
    told = {
        "turned": f"{turned} of {len(mesh.cells)} elements",
        "not used": f"{unused} of {len(points)} nodes",
    }
    if part is None and len(names := list(_named(found))) > 1:
        told["parts"] = f"{', '.join(names[:_LISTED])}: one alone by --part"
    if part is not None:
        told["part"] = f"{part}: {len(mesh.cells)} of {len(cells)} elements"
    if "beside" in found:
        told["left out"] = f"{found['beside']} in addition to the solid; their sets name its facets"
    if "placed" in found:
        told["moved"] = f"to the position of its instance '{found['placed']}'"
    if "included" in found:
        told["included"] = str(found["included"])
    mesh = replace(mesh, facets=_facets(mesh, used, found))
    return ForeignBody(mesh.quadratic() if shape in _BETWEEN else mesh, told)


def _named(found: Mapping[str, NDArray[Any]]) -> dict[str, Ints]:
    return {k.removeprefix(_PART): v for k, v in found.items() if k.startswith(_PART)}


def _turned(mesh: Mesh) -> tuple[Mesh, int]:
    """The mesh with its elements the right way round, and how many were not."""
    wrong = mesh.cell_volumes() < 0
    cells = mesh.cells.copy()
    cells[wrong] = cells[wrong][:, list(_TURNED[mesh.kind])]
    return replace(mesh, cells=cells), int(wrong.sum())


def _facets(mesh: Mesh, used: Ints, found: Mapping[str, NDArray[Any]]) -> dict[str, Ints]:
    """The outer facets (f, m) of every node set and label that has any; nodes in the file's numbers
    in what was found."""
    outer = used[mesh.surface]
    sets = {k.removeprefix(_NSET): v for k, v in found.items() if k.startswith(_NSET)}
    inside = {k: np.isin(outer, nodes).all(axis=1) for k, nodes in sets.items()}
    known = {k.removeprefix(_FACET): v for k, v in found.items() if k.startswith(_FACET)}
    inside |= {k: _labelled(outer, facets) for k, facets in known.items()}
    return {k: mesh.surface[rows] for k, rows in inside.items() if rows.any()}


def _labelled(outer: Ints, facets: Ints) -> NDArray[np.bool_]:
    """Which outer facets (f, m) are among the labelled ones (k, m), in whatever order of nodes."""
    if facets.shape[1] != outer.shape[1]:
        return np.zeros(len(outer), bool)
    wanted = {tuple(row) for row in np.sort(facets, axis=1).tolist()}
    return np.array([tuple(row) in wanted for row in np.sort(outer, axis=1).tolist()], dtype=bool)


def _require_straight(name: str, x: Floats, between: tuple[tuple[int, ...], ...]) -> None:
    """x (e, n, 3) m of quadratic cells, the last nodes `between` corners."""
    first = x.shape[1] - len(between)
    for k, corners in enumerate(between):
        ends = x[:, list(corners)]
        off = np.linalg.norm(x[:, first + k] - ends.mean(axis=1), axis=1)
        bent = off > _STRAIGHT * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        if bent.any():
            raise SceneError(
                f"{name}: {int(bent.sum())} edges or faces {'-'.join(map(str, corners))} are "
                f"curved, middles up to {1e3 * off.max():.3g} mm off; only straight elements "
                "are supported: export linear elements"
            )
