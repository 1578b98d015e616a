"""Closed surfaces of others: what is inside does not depend on how a program writes triangles."""

import signal
from pathlib import Path

import numpy as np
import pytest
import trimesh
import vtk

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.scene.body_facts import quality
from validate.scene.geometries.box import grid
from validate.scene.mesh_files import mesh_file as filled_module
from validate.scene.mesh_files import surface_arrays
from validate.scene.mesh_files.mesh_file import filled
from validate.scene.mesh_files.surface_arrays import _oriented, _surface
from validate.scene.mesh_files.third_party_meshes import read_foreign

# private: _MOST: replaced by a small number: a short test.
# private: _oriented, _surface, _within: called alone, case by case.

BOX = trimesh.creation.box((10.0, 20.0, 30.0))
X, T = np.array(BOX.vertices), np.array(BOX.faces)
QUADS = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
CUBE = np.array([[x, y, z] for x in (0, 10) for y in (0, 20) for z in (0, 30)], dtype=float)


def stl(path: Path, points: Floats, triangles: Ints) -> Path:
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join(f"vertex {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in points[t])
        + "endloop\nendfacet\n"
        for t in triangles
    )
    path.write_text(f"solid x\n{facets}endsolid x\n")
    return path


def enclosed(points: Floats, triangles: Ints) -> float:
    """Volume by the divergence theorem; below 0 where triangles face inward."""
    return float(np.linalg.det(points[triangles]).sum()) / 6


def obj(vertex: str, corner: str, more: str = "") -> str:
    """A box of quads, corners written as a program does: i counts from 1, or from the end."""
    lines = [vertex.format(*x) for x in CUBE]
    for quad in QUADS:
        lines.append("f " + " ".join(corner.format(i=i + 1, n=i - len(CUBE)) for i in quad))
    return "\n".join([more, *lines]) + "\n"


@pytest.mark.parametrize(
    "text",
    [
        obj("v {} {} {}", "{i}"),
        obj("v {} {} {} 0.2 0.4 0.6", "{n}"),
        obj(
            "v {} {} {}",
            "{i}/1/1",
            "mtllib a.mtl\no box\nvt 0 0\nvt 1 0\nvn 0 0 1\nusemtl a\ns off",
        ),
        obj("v {} {} {}", "{i}//1", "vn 0 0 1\ng one two"),
    ],
    ids=["plain", "colours, from the end", "textures", "normals"],
)
def test_an_obj_is_its_corners_and_faces(text: str, tmp_path: Path) -> None:
    (tmp_path / "x.obj").write_text(text)
    points, triangles = _surface(tmp_path / "x.obj")
    assert triangles.shape == (12, 3)
    assert abs(enclosed(points, triangles)) == pytest.approx(6000)


def test_triangles_are_turned_the_same_way_round_and_out() -> None:
    """Whatever the order they come in; the outside is out, as told by the volume's sign."""
    rng = np.random.default_rng(5)
    for _ in range(20):
        wrong = rng.random(len(T)) < 0.5
        given = np.where(wrong[:, None], T[:, ::-1], T)
        found, turned = _oriented(X, given)
        assert enclosed(X, found) == pytest.approx(6000)
        assert turned == wrong.sum()
    assert _oriented(X, T[:, ::-1])[1] == len(T)
    assert _oriented(X, T)[1] == 0


def test_a_void_stays_a_void_though_some_of_its_walls_are_wrong() -> None:
    points = np.vstack([X, 0.5 * X])
    given = np.vstack([T, len(X) + T[:, ::-1]])
    given[-2:] = given[-2:, ::-1]
    found, turned = _oriented(points, given)
    assert turned == 2
    assert enclosed(points, found) == pytest.approx(6000 * (1 - 0.125))


@pytest.mark.slow
def test_a_surface_with_mixed_normals_is_filled_and_told(tmp_path: Path) -> None:
    given = T.copy()
    given[::3] = given[::3, ::-1]
    body = filled(stl(tmp_path / "x.stl", X, given), "mm", 6e-3)
    assert body.mesh.cell_volumes().sum() == pytest.approx(6e-6, rel=1e-3)
    assert body.told["turned"] == "4 of 12 triangles"
    assert quality(body.mesh).min() > 0.05


@pytest.mark.slow
def test_a_surface_with_a_void_is_filled_around_it(tmp_path: Path) -> None:
    points, both = np.vstack([X, 0.5 * X]), np.vstack([T, len(X) + T[:, ::-1]])
    body = filled(stl(tmp_path / "x.stl", points, both), "mm", 4e-3)
    assert body.mesh.cell_volumes().sum() == pytest.approx(6e-6 * (1 - 0.125), rel=0.01)


@pytest.mark.slow
def test_bodies_that_overlap_are_refused_with_both_volumes(tmp_path: Path) -> None:
    points, both = np.vstack([X, X + 5]), np.vstack([T, len(X) + T])
    with pytest.raises(SceneError, match=r"24 triangles .* 12 cm3, .* 10\.\d+ cm3"):
        filled(stl(tmp_path / "x.stl", points, both), "mm", 6e-3)


@pytest.mark.slow
def test_a_coordinate_that_is_no_number_is_one_line(tmp_path: Path) -> None:
    path = stl(tmp_path / "x.stl", X, T)
    path.write_text(path.read_text().replace("vertex -5 ", "vertex nan ", 1))
    with pytest.raises(SceneError, match=r"^x\.stl: "):
        filled(path, "mm")


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["None", "ZLib", "LZMA", "LZ4"])
@pytest.mark.parametrize("mode", ["Ascii", "Binary", "Appended"])
def test_vtk_packed_as_it_offers(kind: str, mode: str, tmp_path: Path) -> None:
    mesh = grid((0.01, 0.02, 0.03), (1, 2, 2))
    points = vtk.vtkPoints()
    for x in 1e3 * mesh.nodes:
        points.InsertNextPoint(x)
    body = vtk.vtkUnstructuredGrid()
    body.SetPoints(points)
    for cell in mesh.cells:
        body.InsertNextCell(vtk.VTK_HEXAHEDRON, len(cell), cell.tolist())
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetInputData(body)
    getattr(writer, f"SetDataModeTo{mode}")()
    getattr(writer, f"SetCompressorTypeTo{kind}")()
    writer.SetFileName(str(tmp_path / "x.vtu"))
    writer.Write()
    if kind == "LZ4":
        with pytest.raises(SceneError, match="compressed by LZ4"):
            read_foreign(tmp_path / "x.vtu", "mm")
        return
    found = read_foreign(tmp_path / "x.vtu", "mm").mesh
    assert found.cell_volumes().sum() == pytest.approx(6e-6, rel=1e-6)


def test_an_edge_below_zero_and_a_body_that_is_none_name_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "body.stl"
    path.write_bytes(b"solid")
    for edge in (-1e-3, np.inf):
        with pytest.raises(SceneError, match=f"body.stl: edges of {edge:g} m; 0 or above"):
            filled(path, "mm", edge)
    flat = {"points": np.zeros((4, 3)), "cells.tetra": np.array([[0, 1, 2, 3]])}
    monkeypatch.setattr(filled_module, "decoded", lambda *_: flat)
    with pytest.raises(SceneError, match=r"^body\.stl: "):
        filled(path, "mm")


def test_files_without_triangles_or_numbers_are_no_surface(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    with pytest.raises(SceneError, match="the file has no triangles, so"):
        _surface(path)
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n")
    with pytest.raises(SceneError, match="1 coordinates"):
        _surface(path)
    monkeypatch.setattr(surface_arrays, "_MOST", 0)
    with pytest.raises(SceneError, match="1 triangles, the limit is 0; simplify it"):
        _surface(path)


def test_a_reader_that_takes_too_long_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    caught: list[object] = []
    monkeypatch.setattr(signal, "signal", lambda number, handler: caught.append(handler))
    with (
        pytest.raises(SceneError, match="its reader took over 7 s; the file"),
        surface_arrays._within(7),
    ):
        caught[0](0, None)  # type: ignore[operator]


def test_a_filling_of_another_volume_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A tetrahedron of 1/6 cm3 in a surface around 1 cm3, of which a hundredth may differ."""
    corners = np.vstack([np.zeros(3), np.eye(3)])
    found = {"points": corners, "cells.tetra": np.array([[0, 1, 2, 3]]), "enclosed": 1.0,
             "may_differ": 0.01, "triangles": 12, "turned": 0}  # fmt: skip
    monkeypatch.setattr(filled_module, "decoded", lambda *_: found)
    (tmp_path / "a.stl").write_bytes(b"solid")
    with pytest.raises(
        SceneError,
        match=r"a.stl: 12.*1 cm3.*0.1667 cm3 \(-83.33.*1",
    ):
        filled(tmp_path / "a.stl", "cm")
