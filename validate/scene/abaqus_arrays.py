"""What an Abaqus .inp holds of a body, as plain arrays. The only file that imports meshio."""

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
_NSET, _CELLS = "nset.", "cells."


def arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Points (n, 3), cells by meshio's names of their shapes, node sets by name."""
    import meshio

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
        said = io.StringIO()
        try:
            with redirect_stdout(said), redirect_stderr(said):
                mesh = meshio.read(known)
        except SystemExit:  # its way to say that it cannot
            why = " ".join(said.getvalue().replace(str(known), path.name).split())
            raise SceneError(f"meshio cannot read it ({why[:200]})") from None
    cells: dict[str, list[NDArray[Any]]] = {}
    for block in mesh.cells:
        cells.setdefault(block.type, []).append(block.data)
    return {
        "points": np.asarray(mesh.points, dtype=np.float64),
        **{f"{_CELLS}{kind}": np.vstack(found) for kind, found in cells.items()},
        **{f"{_NSET}{name}": np.asarray(at) for name, at in mesh.point_sets.items()},
    }
