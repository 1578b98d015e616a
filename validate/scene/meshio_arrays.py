"""What files of bodies hold, as plain arrays. The only file that imports meshio."""

import io
import re
import tempfile
from collections import Counter
from collections.abc import Mapping
from contextlib import redirect_stderr, redirect_stdout
from functools import partial
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
# What Gmsh writes of faces and edges beside a solid, with their numbers of nodes.
_BESIDE = re.compile(
    r"(?im)^\*element\b(?P<said>[^\n]*\btype\s*=\s*(?P<type>CPS\w+|T3D[23])\b[^\n]*)\n"
    r"(?P<rows>(?:(?!\*).*\n?)*)"
)
_NAME = re.compile(r"(?i)\belset\s*=\s*([^,\s]+)")
_ELSETS = re.compile(r"(?im)^\*elset\b[^\n]*\n(?:(?!\*).*\n?)*")
_READ = ("2", "2.1", "2.2", "4.1")  # of Gmsh's formats
_INCLUDE = re.compile(r"(?im)^\*include\b")
_NSET, _CELLS, _FACET = "nset.", "cells.", "facet."
_FLAT = {"triangle": 3, "quad": 4, "triangle6": 3, "quad8": 4, "quad9": 4}  # corners of a facet
_NOT_SOLID = {*_FLAT, "line", "line3", "vertex"}
_LABEL = "gmsh:physical"


def arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Points (n, 3), solid cells by meshio's names of their shapes, node sets and labelled facets
    by name."""
    beside: Counter[str] = Counter()
    if path.suffix.lower() == ".msh":
        _require_version(path)
    abaqus = path.suffix.lower() == ".inp"
    mesh = _abaqus(path, beside) if abaqus else read_quietly(path, path.name)
    cells: dict[str, list[NDArray[Any]]] = {}
    for block in mesh.cells:
        if block.type not in _NOT_SOLID or abaqus:
            cells.setdefault(block.type, []).append(block.data)
    return {
        "points": np.asarray(mesh.points, dtype=np.float64),
        **{f"{_CELLS}{kind}": np.vstack(found) for kind, found in cells.items()},
        **{f"{_NSET}{name}": np.asarray(at) for name, at in mesh.point_sets.items()},
        **{f"{_FACET}{name}": at for name, at in _labelled(mesh).items()},
        **({"beside": np.array(_counted(beside))} if beside else {}),
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


def _require_version(path: Path) -> None:
    """Raises `SceneError` for Gmsh's older and in-between formats, which no reader here takes."""
    with path.open("rb") as file:
        head = file.read(200).decode("latin-1").split()
    version = head[1] if len(head) > 1 and head[0] == "$MeshFormat" else "1"
    gmsh = bool(head) and head[0] in ("$MeshFormat", "$NOD")
    if gmsh and version not in _READ:
        raise SceneError(
            f"Gmsh's format {version}; 2.2 and 4.1 are read: save it again, "
            "gmsh FILE -0 -format msh41 -o NEW.msh"
        )


def _counted(beside: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {kind}" for kind, count in beside.items())


def _abaqus(path: Path, beside: Counter[str]) -> Any:
    """Faces and edges that Gmsh writes beside a solid become sets of nodes, and are told."""
    text = path.read_bytes().decode("utf-8", "replace").replace("\r\n", "\n")
    blocks = len(_NODES.findall(text))
    if blocks != 1 or _INCLUDE.search(text):
        raise SceneError(
            f"{blocks} lists of nodes{' and an *Include' if _INCLUDE.search(text) else ''}: one "
            "part in one file is read; export the body alone"
        )
    if _BESIDE.search(text):
        text = _BESIDE.sub(partial(_as_nodes, beside), _ELSETS.sub("", text))
    with tempfile.TemporaryDirectory(prefix="validate-") as folder:
        known = Path(folder) / "body.inp"
        known.write_text(_SHAPE.sub(lambda m: m[1] + m[2].upper(), text), encoding="utf-8")
        return read_quietly(known, path.name)


def _as_nodes(beside: Counter[str], block: re.Match[str]) -> str:
    """A block of faces as the set of its nodes, by its name; edges are left out."""
    rows = [[int(n) for n in row.split(",") if n.strip()] for row in block["rows"].splitlines()
            if row.strip() and not row.startswith("**")]  # fmt: skip
    name = _NAME.search(block["said"])
    beside[block["type"].upper()] += len(rows)
    if name is None or block["type"].upper().startswith("T3D"):
        return ""
    nodes = sorted({n for row in rows for n in row[1:]})
    lines = [", ".join(map(str, nodes[i : i + 10])) for i in range(0, len(nodes), 10)]
    return f"*NSET,NSET={name[1]}\n" + ",\n".join(lines) + "\n"
