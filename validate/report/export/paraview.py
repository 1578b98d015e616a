"""ParaView files: a collection (.pvd) of bodies (.vtu) and measured markers (.vtp)."""

from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from validate.arrays import Floats, Ints
from validate.compare.result import MethodResult, Result
from validate.fem.assembly.cell_fields import cell_fields
from validate.files import safe_name
from validate.register.markers.markers import MarkerObservation
from validate.report.sections.observations import markers_seen
from validate.scene.scene import Scene
from validate.solve.types import Run

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
    for k, frame in enumerate(_chosen(len(run.u))):
        t = float(run.t[run.at[frame]])
        # VTK's packed cells and their kinds; middles of edges stand as ours do. hex27: its
        # corners.
        mesh = scene.mesh
        cells = mesh.cells[:, : _CORNERS.get(mesh.kind, mesh.cells.shape[1])]
        packed = np.hstack([np.full((len(cells), 1), cells.shape[1]), cells]).ravel()
        body = pv.UnstructuredGrid(
            *(packed, np.full(len(cells), _VTK[mesh.kind])), _three(scene.mesh.nodes)
        )
        _fill(body, scene, run, int(frame))
        entries.append((t, 0, _saved(body, parts / f"body_{k:04d}.vtu")))
        if seen is not None:
            points = _points(pv, seen, run.u[frame], t)
            if points is not None:
                entries.append((t, 1, _saved(points, parts / f"markers_{k:04d}.vtp")))
    path = folder / f"{name}.pvd"
    path.write_text(_collection(entries, name), "utf-8")
    return path


def _chosen(count: int) -> Ints:
    return np.unique(np.linspace(0, count - 1, min(count, MOST)).round().astype(int))


def _three(x: Floats) -> Floats:
    """Places or displacements (n, 3) of (n, d): VTK knows space only."""
    return np.pad(x, [(0, 0), (0, 3 - x.shape[1])])


def _fill(body: Any, scene: Scene, run: Run, frame: int) -> None:
    u = run.u[frame]
    body.point_data["displacement [m]"] = _three(u)
    if run.sd is not None:
        body.point_data["sd [m]"] = _three(run.sd[frame])
    fields, cells = cell_fields(scene, u), body.cell_data
    cells["strain [1]"] = np.stack([fields.strain[:, i, j] for i, j in _SIX], axis=1)
    if fields.stress is not None:
        cells["stress [Pa]"] = np.stack([fields.stress[:, i, j] for i, j in _SIX], axis=1)
        cells["von Mises [Pa]"] = fields.von_mises


def _points(pv: Any, seen: MarkerObservation, u: Floats, t: float) -> Any | None:
    """Markers as measured nearest to t, those seen, with what the run is off by there."""
    row = int(np.abs(seen.t - t).argmin())
    there = ~np.isnan(seen.x[row]).any(axis=1)
    if not there.any():
        return None
    x = seen.x[row][there]
    points = pv.PolyData(_three(x))
    points.point_data["error [m]"] = _three(seen.simulated(u)[there] - x)
    points.point_data["measured at [s]"] = np.full(len(x), seen.t[row])
    return points


def _saved(data: Any, path: Path) -> str:
    data.save(path)
    return f"{path.parent.name}/{path.name}"


def _collection(entries: list[tuple[float, int, str]], name: str) -> str:
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    inner = ElementTree.SubElement(root, "Collection")
    for t, part, file in entries:
        told = {"timestep": repr(t), "part": str(part), "file": file, "name": name}
        ElementTree.SubElement(inner, "DataSet", told)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"
