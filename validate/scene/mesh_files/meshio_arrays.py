"""Arrays of mesh files read by meshio. The only file that imports meshio."""

import io
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.errors import SceneError
from validate.files import open_file

LIBRARIES, MEMORY = ("meshio",), 2**26  # bytes beyond it and the file's
_READ = ("2", "2.1", "2.2", "4.1")  # of Gmsh's formats
_NSET, _CELLS, _FACET, _PART = "nset.", "cells.", "facet.", "part."
_FLAT = {"triangle": 3, "quad": 4, "triangle6": 3, "quad8": 4, "quad9": 4}  # corners of a facet
_NOT_SOLID = {*_FLAT, "line", "line3", "vertex"}
_LABEL = "gmsh:physical"
SURFACE = (
    "a surface of VTK (PolyData); save a closed surface as STL (ParaView: File, Save Data; "
    "pyvista: mesh.save('FILE.stl')), then validate body FILE.stl --unit mm"
)


def arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Points (n, 3), solid cells by meshio's names of their shapes, node sets, labelled facets and
    labelled cells (their numbers, where all have one shape) by name."""
    if path.suffix.lower() == ".msh":
        # Raises `SceneError` for Gmsh's older and in-between formats, which no reader here takes.
        with open_file(path) as file:
            head = file.read(200).decode("latin-1").split()
        version = head[1] if len(head) > 1 and head[0] == "$MeshFormat" else "1"
        gmsh = bool(head) and head[0] in ("$MeshFormat", "$NOD")
        plain = version.rstrip("0").rstrip(".") if "." in version else version  # netgen's 2.000000
        if gmsh and plain not in _READ:
            raise SceneError(
                f"Gmsh's format {version} is not supported; save it as 2.2 or 4.1: gmsh FILE -0 "
                "-format msh41 -o NEW.msh"
            )
    mesh = read_quietly(path, path.name)
    cells: dict[str, list[NDArray[Any]]] = {}
    for block in mesh.cells:
        if block.type not in _NOT_SOLID:
            cells.setdefault(block.type, []).append(block.data)
    return {
        "points": np.asarray(mesh.points, dtype=np.float64),
        **{f"{_CELLS}{kind}": np.vstack(found) for kind, found in cells.items()},
        **{f"{_NSET}{name}": np.asarray(at) for name, at in mesh.point_sets.items()},
        **{f"{_FACET}{name}": at for name, at in _labelled(mesh).items()},
        **{f"{_PART}{name}": at for name, at in _parts(mesh).items() if len(cells) == 1},
    }


def _labelled(mesh: Any) -> dict[str, NDArray[Any]]:
    """Corners (f, m) of facets by their label's name in Gmsh, else by its number."""
    names = {(int(v[0]), int(v[1])): k for k, v in mesh.field_data.items()}
    found: dict[str, list[NDArray[Any]]] = {}
    for block, labels in zip(mesh.cells, mesh.cell_data.get(_LABEL, ()), strict=False):
        if block.type in _FLAT:
            for label in np.unique(labels[labels != 0]):  # 0: Gmsh's word for none
                name = names.get((int(label), 2), f"label {int(label)}")
                corners = block.data[labels == label][:, : _FLAT[block.type]]
                found.setdefault(name, []).append(corners)
    return {k: np.vstack(v) for k, v in found.items() if len({a.shape[1] for a in v}) == 1}


def _parts(mesh: Any) -> dict[str, NDArray[Any]]:
    """Numbers of the solid cells with a label, by its name in Gmsh, else by its number."""
    names = {(int(v[0]), int(v[1])): k for k, v in mesh.field_data.items()}
    solid = [
        labels
        for block, labels in zip(mesh.cells, mesh.cell_data.get(_LABEL, ()), strict=False)
        if block.type not in _NOT_SOLID
    ]
    labels = np.concatenate(solid) if solid else np.zeros(0)
    return {
        names.get((int(label), 3), f"label {int(label)}"): np.flatnonzero(labels == label)
        for label in np.unique(labels[labels != 0])
    }


def read_quietly(path: Path, name: str) -> Any:
    """meshio's mesh; what it prints, and that it ends the interpreter, becomes one error."""
    import meshio

    with open_file(path) as file:
        head = file.read(4096)
    if b"vtkLZ4DataCompressor" in head:
        raise SceneError(
            "compressed by LZ4, which is not supported; save it with zlib or uncompressed"
        )
    if b"DATASET POLYDATA" in head.upper():
        raise SceneError(SURFACE)
    said = io.StringIO()
    try:
        with redirect_stdout(said), redirect_stderr(said):
            return meshio.read(path)
    except SystemExit:  # its way to say that it cannot
        why = " ".join(said.getvalue().replace(str(path), name).split())
        raise SceneError(f"meshio cannot read it ({why[:200]})") from None
