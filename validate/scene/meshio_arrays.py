"""What files of bodies hold, as plain arrays. The only file that imports meshio."""

import io
import re
import tempfile
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.errors import SceneError

# Abaqus' own variants (hybrid, reduced, thermally coupled, ...) of one shape; meshio knows some.
_SHAPE = re.compile(
    r"(?im)^(\*element\b.*?\btype\s*=\s*)(c3d(?:4|6|8|10|15|20))[a-z]*(?=\s*(?:,|$))"
)
_NODES = re.compile(r"(?im)^\*node\s*(?:,|$)")
_INCLUDE = re.compile(r"(?im)^\*include\b")
_NSET, _CELLS, _FACET = "nset.", "cells.", "facet."
_FLAT = {"triangle": 3, "quad": 4, "triangle6": 3, "quad8": 4, "quad9": 4}  # corners of a facet
_NOT_SOLID = {*_FLAT, "line", "line3", "vertex"}
_LABEL = "gmsh:physical"


def arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Points (n, 3), solid cells by meshio's names of their shapes, node sets and labelled facets
    by name."""
    mesh = _abaqus(path) if path.suffix.lower() == ".inp" else read_quietly(path, path.name)
    cells: dict[str, list[NDArray[Any]]] = {}
    for block in mesh.cells:
        if block.type not in _NOT_SOLID or path.suffix.lower() == ".inp":
            cells.setdefault(block.type, []).append(block.data)
    return {
        "points": np.asarray(mesh.points, dtype=np.float64),
        **{f"{_CELLS}{kind}": np.vstack(found) for kind, found in cells.items()},
        **{f"{_NSET}{name}": np.asarray(at) for name, at in mesh.point_sets.items()},
        **{f"{_FACET}{name}": at for name, at in _labelled(mesh).items()},
    }


def _labelled(mesh: Any) -> dict[str, NDArray[Any]]:
    """Corners (f, m) of facets by their label's name in Gmsh, else by its number."""
    names = {(int(v[0]), int(v[1])): k for k, v in mesh.field_data.items()}
    found: dict[str, list[NDArray[Any]]] = {}
    for block, labels in zip(mesh.cells, mesh.cell_data.get(_LABEL, ()), strict=False):
        if block.type in _FLAT:
            for label in np.unique(labels):
                name = names.get((int(label), 2), f"label {int(label)}")
                corners = block.data[labels == label][:, : _FLAT[block.type]]
                found.setdefault(name, []).append(corners)
    return {k: np.vstack(v) for k, v in found.items() if len({a.shape[1] for a in v}) == 1}


def read_quietly(path: Path, name: str) -> Any:
    """meshio's mesh; what it prints, and that it ends the interpreter, becomes one error."""
    import meshio

    said = io.StringIO()
    try:
        with redirect_stdout(said), redirect_stderr(said):
            return meshio.read(path)
    except SystemExit:  # its way to say that it cannot
        why = " ".join(said.getvalue().replace(str(path), name).split())
        raise SceneError(f"meshio cannot read it ({why[:200]})") from None


def _abaqus(path: Path) -> Any:
    text = path.read_bytes().decode("utf-8", "replace").replace("\r\n", "\n")
    blocks = len(_NODES.findall(text))
    if blocks != 1 or _INCLUDE.search(text):
        raise SceneError(
            f"{blocks} lists of nodes{' and an *Include' if _INCLUDE.search(text) else ''}: one "
            "part in one file is read; export the body alone"
        )
    with tempfile.TemporaryDirectory(prefix="validate-") as folder:
        known = Path(folder) / "body.inp"
        known.write_text(_SHAPE.sub(lambda m: m[1] + m[2].upper(), text), encoding="utf-8")
        return read_quietly(known, path.name)
