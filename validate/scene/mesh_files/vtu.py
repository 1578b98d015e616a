"""VTK's .vtu files: writer of a grid, and reader of fields over time on one grid (.pvd).

Read in a process of its own. Text, binary, appended and compressed arrays alike, by meshio.
"""

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.files import inside, open_file, read_bytes
from validate.scene.mesh import Mesh
from validate.scene.mesh_files.meshio_arrays import read_quietly

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


LIBRARIES = ("meshio",)
DISPLACEMENTS = ("displacement", "Displacement", "displacements", "u", "U", "DISP")
REACTIONS = ("reaction", "Reaction", "reactions", "RF", "reaction_forces")


def arrays(path: Path) -> dict[str, NDArray[Any]]:
    """`t` (k,) as listed, `u` (k, n, 3), `reactions` of that shape where every file has them, and
    `points` (n, 3) of the first file.

    Raises `SceneError` for a list that is none, for files elsewhere than beside it, other numbers
    of points, and points without a displacement.
    """
    # Time and file of every step, in order of time.
    text = read_bytes(path)
    if b"<!" in text.replace(b"<!--", b""):
        raise SceneError("declares XML entities, which a list of files does not need")
    try:
        sets = list(ET.fromstring(text).iter("DataSet"))
        steps = sorted((float(s.attrib["timestep"]), s.attrib["file"]) for s in sets)
    except (ET.ParseError, KeyError, ValueError) as error:
        raise SceneError(f"not a list of files ({' '.join(str(error).split())[:100]})") from None
    if not steps:
        raise SceneError("it lists no file")
    listed = [(t, inside(path.parent, name)) for t, name in steps]
    found = [_fields(file) for _, file in listed]
    if len({len(one["points"]) for one in found}) != 1:
        raise SceneError("files of different numbers of points")
    series = {
        "t": np.array([t for t, _ in listed]),
        "u": np.stack([one["u"] for one in found]),
        "points": found[0]["points"],
    }
    if all("reactions" in one for one in found):
        series["reactions"] = np.stack([one["reactions"] for one in found])
    return series


def _fields(file: Path) -> dict[str, NDArray[Any]]:
    open_file(file).close()
    mesh = read_quietly(file, file.name)
    u = _of_points(mesh, DISPLACEMENTS)
    if u is None:
        raise SceneError(
            f"{file.name}: points have {sorted(mesh.point_data)}, expected a displacement: "
            f"{', '.join(DISPLACEMENTS)}"
        )
    found = {"points": np.asarray(mesh.points, dtype=np.float64), "u": u}
    reactions = _of_points(mesh, REACTIONS)
    return found if reactions is None else {**found, "reactions": reactions}


def _of_points(mesh: Any, names: tuple[str, ...]) -> NDArray[Any] | None:
    name = next((n for n in names if n in mesh.point_data), None)
    return None if name is None else np.asarray(mesh.point_data[name], dtype=np.float64)
