"""Writer of VTK unstructured grids (.vtu, text): nodes and cells in order, full precision."""

from pathlib import Path

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.scene.mesh import Mesh

#: VTK's number of a cell; its nodes run as ours do.
CELL_TYPES = {"tet4": 10, "tet10": 24, "hex8": 12}

_HEAD = (
    '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="0.1" '
    'byte_order="LittleEndian">\n<UnstructuredGrid>\n'
)


def write_vtu(mesh: Mesh, path: Path) -> None:
    """Raise `SceneError` for a kind of cell that is not carried."""
    if mesh.kind not in CELL_TYPES:
        raise SceneError(f"cells of kind {mesh.kind}: a .vtu carries {', '.join(CELL_TYPES)}")
    number = CELL_TYPES[mesh.kind]
    cells = mesh.cells
    e, k = cells.shape
    blocks = (
        f'{_HEAD}<Piece NumberOfPoints="{len(mesh.nodes)}" NumberOfCells="{e}">\n<Points>\n',
        _array("Float64", "Points", mesh.nodes, ' NumberOfComponents="3"'),
        "</Points>\n<Cells>\n",
        _array("Int64", "connectivity", cells),
        _array("Int64", "offsets", k * np.arange(1, e + 1)[:, None]),
        _array("UInt8", "types", np.full((e, 1), number)),
        "</Cells>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n",
    )
    path.write_text("".join(blocks), encoding="ascii")


def _array(kind: str, name: str, values: Floats | Ints, more: str = "") -> str:
    rows = "\n".join(" ".join(map(repr, row)) for row in values.tolist())
    return f'<DataArray type="{kind}" Name="{name}"{more} format="ascii">\n{rows}\n</DataArray>\n'
