"""ParaView files: a collection (.pvd) of bodies (.vtu) and measured markers (.vtp)."""

from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from validate.arrays import Floats
from validate.compare.result import MethodResult, Result
from validate.fem.assembly.cell_fields import cell_fields
from validate.files import safe_name
from validate.report.sections.observations import markers_seen
from validate.scene.scene import Scene

MOST = 200  # frames of a method: evenly chosen where a run has more
_VTK = {"tri3": 5, "tri6": 22, "quad4": 9, "tet4": 10, "tet10": 24, "hex8": 12, "hex27": 12}
_CORNERS = {"hex27": 8}
_SIX = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))  # xx yy zz xy yz xz


def write_series(result: Result, folder: Path, progress: Callable[[str], None]) -> list[Path]:
    """`<method>.pvd` of every accepted method that has frames, with its files beside; SI units in
    the names of the arrays."""
    written = []
    for method in result.methods:
        if method.accepted and isinstance(method.scene, Scene) and len(method.run.u):
            progress(f"ParaView, {method.name}")
            written.append(_series(method, folder))
    return written


def _series(method: MethodResult, folder: Path) -> Path:
    import pyvista as pv

    scene, run = method.scene, method.run
    assert isinstance(scene, Scene)
    name = safe_name(method.name)
    parts = folder / name
    parts.mkdir(parents=True)
    seen = markers_seen(method)
    entries = []
    # VTK's packed cells and their kinds; middles of edges stand as ours do. hex27: its corners.
    mesh = scene.mesh
    cells = mesh.cells[:, : _CORNERS.get(mesh.kind, mesh.cells.shape[1])]
    packed = np.hstack([np.full((len(cells), 1), cells.shape[1]), cells]).ravel()
    kinds = np.full(len(cells), _VTK[mesh.kind])
    chosen = np.linspace(0, len(run.u) - 1, min(len(run.u), MOST)).round().astype(int)
    for k, frame in enumerate(np.unique(chosen)):
        t, u = float(run.t[run.at[frame]]), run.u[frame]
        body = pv.UnstructuredGrid(packed, kinds, _three(mesh.nodes))
        body.point_data["displacement [m]"] = _three(u)
        if run.sd is not None:
            body.point_data["sd [m]"] = _three(run.sd[frame])
        fields = cell_fields(scene, u)
        data: Any = body.cell_data
        data["strain [1]"] = np.stack([fields.strain[:, i, j] for i, j in _SIX], axis=1)
        if fields.stress is not None:
            data["stress [Pa]"] = np.stack([fields.stress[:, i, j] for i, j in _SIX], axis=1)
            data["von Mises [Pa]"] = fields.von_mises
        entries.append((t, 0, _saved(body, parts / f"body_{k:04d}.vtu")))
        # Visible markers as measured nearest to t, and the errors of the run there
        row = 0 if seen is None else int(np.abs(seen.t - t).argmin())
        if seen is not None and (there := ~np.isnan(seen.x[row]).any(axis=1)).any():
            x = seen.x[row][there]
            points = pv.PolyData(_three(x))
            points.point_data["error [m]"] = _three(seen.simulated(u)[there] - x)
            points.point_data["measured at [s]"] = np.full(len(x), seen.t[row])
            entries.append((t, 1, _saved(points, parts / f"markers_{k:04d}.vtp")))
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    inner = ElementTree.SubElement(root, "Collection")
    for t, part, file in entries:
        attributes = {"timestep": repr(t), "part": str(part), "file": file, "name": name}
        ElementTree.SubElement(inner, "DataSet", attributes)
    ElementTree.indent(root)
    collection = ElementTree.tostring(root, encoding="unicode", xml_declaration=True)
    path = folder / f"{name}.pvd"
    path.write_text(collection + "\n", "utf-8")
    return path


def _three(x: Floats) -> Floats:
    """Places or displacements (n, 3) of (n, d): VTK knows space only."""
    return np.pad(x, [(0, 0), (0, 3 - x.shape[1])])


def _saved(data: Any, path: Path) -> str:
    data.save(path)
    return f"{path.parent.name}/{path.name}"
