"""Bodies of Gmsh, VTK and of closed surfaces, as libraries of others write them."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest
import pyvista as pv
from click.testing import CliRunner

from validate.commands.main import cli
from validate.errors import SceneError, UsageError, ValidateError
from validate.scene.body_facts import facts, odd_size, quality
from validate.scene.geometries.box import grid
from validate.scene.mesh import Mesh, boundary_facets
from validate.scene.mesh_files import meshio_arrays, third_party_meshes, vtu
from validate.scene.mesh_files.mesh_file import filled, read_mesh, write_mesh
from validate.scene.mesh_files.third_party_meshes import read_foreign

pytestmark = pytest.mark.usefixtures("decoded_here")

# private: _body: called alone, case by case.

SIZE = (0.01, 0.02, 0.03)


def linear() -> Mesh:
    mesh = grid(SIZE, (1, 2, 2))
    return Mesh(mesh.nodes, mesh.simplices, "tet4")


def facets_at(mesh: Mesh, height: float) -> np.ndarray:
    facets = boundary_facets(mesh.cells, 3)
    return facets[(np.abs(mesh.nodes[facets][..., 2] - height) < 1e-9).all(axis=1)]


def gmsh2(path: Path, mesh: Mesh) -> Path:
    """With its lower facets as the physical group `plate`, the upper ones without a name; mm."""
    low, high = facets_at(mesh, 0.0), facets_at(mesh, SIZE[2])
    labels = [np.full(len(low), 7), np.full(len(high), 8), np.full(len(mesh.cells), 1)]
    meshio.Mesh(
        1e3 * mesh.nodes,
        [("triangle", low), ("triangle", high), ("tetra", mesh.cells)],
        cell_data={"gmsh:physical": labels, "gmsh:geometrical": labels},
        field_data={"plate": np.array([7, 2]), "gel": np.array([1, 3])},
    ).write(path, file_format="gmsh22", binary=False)
    return path


def gmsh4(path: Path, mesh: Mesh) -> Path:
    """The same in version 4.1, after its documentation: two surfaces and a volume."""
    low, high = facets_at(mesh, 0.0), facets_at(mesh, SIZE[2])
    box = "0 0 0 10 20 30"
    names = ["$MeshFormat", "4.1 0 8", "$EndMeshFormat", "$PhysicalNames", "2", '2 7 "plate"',
             '3 1 "gel"', "$EndPhysicalNames"]  # fmt: skip
    entities = ["$Entities", "0 0 2 1", f"1 {box} 1 7 0", f"2 {box} 1 8 0", f"1 {box} 1 1 2 1 2",
                "$EndEntities"]  # fmt: skip
    n = len(mesh.nodes)
    nodes = ["$Nodes", f"1 {n} 1 {n}", f"3 1 0 {n}", *(str(i + 1) for i in range(n))]
    nodes += [" ".join(map(repr, (1e3 * x).tolist())) for x in mesh.nodes] + ["$EndNodes"]
    total = len(low) + len(high) + len(mesh.cells)
    elements, number = ["$Elements", f"3 {total} 1 {total}"], 0
    for head, cells in ((f"2 1 2 {len(low)}", low), (f"2 2 2 {len(high)}", high),
                        (f"3 1 4 {len(mesh.cells)}", mesh.cells)):  # fmt: skip
        elements.append(head)
        for cell in cells:
            number += 1
            elements.append(f"{number} " + " ".join(str(i + 1) for i in cell))
    path.write_text("\n".join([*names, *entities, *nodes, *elements, "$EndElements", ""]))
    return path


def test_a_body_s_corner_at_zero_is_told_as_zero() -> None:
    """Not as what rounding left of it, -4.441e-16 mm."""
    mesh = linear()
    low = mesh.nodes.min(axis=0)
    assert "from (0, 0, 0) mm" in facts(replace(mesh, nodes=mesh.nodes - low - 4e-19))["box"]


def test_a_version_of_gmsh_may_be_written_with_zeros(tmp_path: Path) -> None:
    """As netgen writes it."""
    path = gmsh2(tmp_path / "x.msh", linear())
    text = path.read_text("utf-8")
    assert "\n2.2 0 8" in text
    path.write_text(text.replace("\n2.2 0 8", "\n2.000000 0 8"), "utf-8")
    assert len(read_foreign(path, "mm").mesh.cells) == len(linear().cells)


@pytest.mark.parametrize("write", [gmsh2, gmsh4])
def test_groups_of_gmsh_are_facet_sets(write: Callable[[Path, Mesh], Path], tmp_path: Path) -> None:
    body = read_foreign(write(tmp_path / "x.msh", linear()), "mm")
    assert body.mesh.cell_volumes().sum() == pytest.approx(np.prod(SIZE))
    low = body.mesh.facet_nodes("plate")
    assert np.abs(body.mesh.nodes[low, 2]).max() < 1e-12
    assert len(body.mesh.facets["plate"]) == 4
    assert len(body.mesh.facets["label 8"]) == 4
    assert body.told["turned"].startswith("0 of")


@pytest.mark.parametrize("suffix", [".vtu", ".vtk"])
def test_elements_told_the_other_way_round_are_turned_and_told(suffix: str, tmp_path: Path) -> None:
    mesh = linear()
    wrong = mesh.cells.copy()
    wrong[::2] = wrong[::2][:, [1, 0, 2, 3]]
    types = np.full(len(wrong), pv.CellType.TETRA)
    cells = np.hstack([np.full((len(wrong), 1), 4), wrong]).ravel()
    pv.UnstructuredGrid(cells, types, 1e3 * mesh.nodes).save(tmp_path / f"x{suffix}")
    body = read_foreign(tmp_path / f"x{suffix}", "mm")
    assert (body.mesh.cell_volumes() > 0).all()
    assert body.mesh.cell_volumes().sum() == pytest.approx(np.prod(SIZE))
    assert body.told["turned"] == f"{len(wrong[::2])} of {len(wrong)} elements"


def test_hexahedra_and_quadratic_tetrahedra_come_in(tmp_path: Path) -> None:
    hexahedra = grid(SIZE, (2, 2, 2))
    meshio.Mesh(hexahedra.nodes, [("hexahedron", hexahedra.cells)]).write(tmp_path / "h.vtu")
    assert read_foreign(tmp_path / "h.vtu", "m").mesh.kind == "hex8"
    curved = linear().quadratic()
    body = read_mesh(_inp(tmp_path / "q.vtu", curved), "m")
    assert (body.kind, len(body.nodes)) == ("tet10", len(curved.nodes))


def _inp(path: Path, mesh: Mesh) -> Path:
    meshio.Mesh(mesh.nodes, [("tetra10", mesh.cells)]).write(path)
    return path


@pytest.mark.slow
def test_a_sphere_is_filled_to_its_volume(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The volume of the triangulated sphere, within the envelope of a thousandth; nothing is left
    in the current folder, where the library would write."""
    monkeypatch.chdir(tmp_path)
    surface = pv.Icosphere(radius=10.0, nsub=3)
    surface.save(tmp_path / "ball.stl")
    body = filled(tmp_path / "ball.stl", "mm", 4e-3)
    assert body.mesh.cell_volumes().sum() == pytest.approx(1e-9 * surface.volume, rel=5e-3)
    assert (quality(body.mesh) > 0.1).all()
    edges = np.linalg.norm(body.mesh.nodes[body.mesh.cells[:, 0]]
                           - body.mesh.nodes[body.mesh.cells[:, 1]], axis=1)  # fmt: skip
    assert 1.5e-3 < np.median(edges) < 6e-3
    assert "triangles around" in body.told["surface"]
    assert [f.name for f in tmp_path.iterdir()] == ["ball.stl"]


@pytest.mark.own_process
def test_an_open_surface_is_refused_with_its_open_edges(tmp_path: Path) -> None:
    pv.Plane(i_resolution=2, j_resolution=2).triangulate().save(tmp_path / "open.stl")
    with pytest.raises(SceneError, match=r"open\.stl: 8 open.*8 triangles"):
        filled(tmp_path / "open.stl", "mm")


@pytest.mark.slow
def test_the_beam_of_others_is_filled(shared_data: Path) -> None:
    """30 x 30 x 100 mm, as its makers say."""
    body = filled(shared_data / "markers/silicone-beam/beam.stl", "mm", 8e-3)
    assert body.mesh.cell_volumes().sum() == pytest.approx(90e-6, rel=0.01)


@pytest.mark.own_process
@pytest.mark.parametrize(
    ("name", "text", "why"),
    [
        ("x.msh", "$MeshFormat\n1 0 8\n$EndMeshFormat\n", "x.msh: "),
        *(
            pytest.param(*case, marks=pytest.mark.slow)  # each starts a process
            for case in (
                ("x.vtk", "# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\n", "x.vtk: "),
                ("x.vtu", "<VTKFile>", "x.vtu: "),
                ("x.obj", "v 0 0 0\n", "x.obj: "),
                ("x.stl", "solid x\nendsolid x\n", "x.stl: "),
                ("x.ply", "ply\nformat ascii 1.0\n", "x.ply: "),
            )
        ),
    ],
)
def test_a_reader_that_ends_the_interpreter_costs_a_line(
    name: str, text: str, why: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_text(text)
    read = filled if name[-3:] in ("obj", "ply", "stl") else read_foreign
    with pytest.raises(SceneError, match=why) as raised:
        read(tmp_path / name, "mm")
    assert len(str(raised.value).splitlines()) == 1


def test_quality_of_a_regular_tetrahedron_and_of_a_cube_is_one() -> None:
    corners = np.array([[1, 1, 1], [-1, 1, -1], [1, -1, -1], [-1, -1, 1.0]])
    regular = Mesh(corners, np.array([[0, 2, 1, 3]]), "tet4")
    assert quality(regular) == pytest.approx(1)
    assert quality(grid((0.1, 0.1, 0.1), (1, 1, 1))) == pytest.approx(1)
    flat = Mesh(corners * [1, 1, 1e-3], np.array([[0, 2, 1, 3]]), "tet4")
    assert quality(flat)[0] < 0.05
    assert "1 tet4, 4 nodes" in facts(regular)["elements"]


def test_two_bodies_without_a_common_node_are_told(tmp_path: Path) -> None:
    one = linear()
    both = Mesh(
        np.vstack([one.nodes, one.nodes + [0.05, 0, 0]]),
        np.vstack([one.cells, one.cells + len(one.nodes)]), "tet4",
    )  # fmt: skip
    assert (facts(one)["bodies"], facts(both)["bodies"]) == ("1", "2")
    path = gmsh2(tmp_path / "x.msh", both)
    shown = CliRunner().invoke(cli, ["body", str(path), "--unit", "mm"])
    assert shown.exit_code == 0
    assert "x.msh: 2 bodies share no node" in shown.output
    assert "--part 1 (the largest)" in shown.output


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".msh", ".npz", ".stl"])
def test_one_of_two_bodies_is_chosen_by_size_and_by_label(suffix: str, tmp_path: Path) -> None:
    """The smaller, which stands first in the file; its facet set comes with it."""
    path, run = tmp_path / f"x{suffix}", CliRunner()
    if suffix == ".stl":
        small, large = pv.Box((0, 10, 0, 20, 0, 30)), pv.Box((50, 70, 0, 20, 0, 30))
        small.merge(large).triangulate().save(path)
    else:
        one = linear()
        nodes = np.vstack([one.nodes, one.nodes * [2, 1, 1] + [0.05, 0, 0]])
        both = Mesh(nodes, np.vstack([one.cells, one.cells + len(one.nodes)]), "tet4")
        gmsh2(path.with_suffix(".msh"), both)
        write_mesh(replace(both, facets={"plate": facets_at(both, 0.0)}), tmp_path / "x.npz")
    unit = [] if suffix == ".npz" else ["--unit", "mm"]
    unit += ["--edge", "10mm"] if suffix == ".stl" else []
    for part, volume in (("1", 12e-6), ("2", 6e-6))[suffix == ".stl" :]:
        out = tmp_path / f"{part}.npz"
        done = run.invoke(cli, ["body", str(path), *unit, "--part", part, "-o", str(out)])
        assert done.exit_code == 0, done.output
        got = read_mesh(out)
        assert got.cell_volumes().sum() == pytest.approx(volume, rel=1e-3)
        assert got.nodes[:, 0].min() == pytest.approx(0.05 if part == "1" else 0.0, abs=1e-4)
        if suffix != ".stl":
            low = got.facets["plate"]
            assert (len(low), got.nodes[low][..., 2].max()) == (4, 0.0)
    if suffix == ".npz":
        odd = run.invoke(cli, ["body", str(path), "--part", "3"])
        assert re.search(r"x.npz: no part '3'; .* 1 \(the largest\) to 2", str(odd.exception))


@pytest.mark.slow
def test_a_label_of_gmsh_is_a_part(tmp_path: Path) -> None:
    """Two that share nodes: the lower half of a body."""
    mesh, path = linear(), tmp_path / "x.msh"
    upper = mesh.nodes[mesh.cells][..., 2].mean(axis=1) > SIZE[2] / 2
    meshio.Mesh(
        1e3 * mesh.nodes, [("tetra", mesh.cells)],
        cell_data={k: [np.where(upper, 5, 4)] for k in ("gmsh:physical", "gmsh:geometrical")},
        field_data={"fat": np.array([4, 3])},
    ).write(path, file_format="gmsh22", binary=False)  # fmt: skip
    assert read_foreign(path, "mm").told["parts"] == "fat, label 5: one alone by --part"
    fat, other = (read_foreign(path, "mm", part).mesh for part in ("fat", "label 5"))
    for half, low in ((fat, 0.0), (other, SIZE[2] / 2)):
        assert half.cell_volumes().sum() == pytest.approx(np.prod(SIZE) / 2)
        assert half.nodes[:, 2].min() == low


def test_the_command_asks_for_the_unit_and_writes_what_experiments_take(tmp_path: Path) -> None:
    path = gmsh2(tmp_path / "x.msh", linear())
    run = CliRunner()
    refused = run.invoke(cli, ["body", str(path)])
    assert "has no unit; give it, as --unit mm" in str(refused.exception)
    shown = run.invoke(cli, ["body", str(path), "--unit", "mm", "-o", str(tmp_path / "b.npz")])
    assert shown.exit_code == 0, shown.output
    assert "10 x 20 x 30 mm" in shown.output
    assert set(read_mesh(tmp_path / "b.npz").facets) == {"plate", "label 8"}
    with pytest.raises(SceneError, match=r"no unit.*body\.unit=mm"):
        read_mesh(path)
    pv.Icosphere().save(tmp_path / "s.stl")
    odd = run.invoke(cli, ["body", str(path), "--unit", "mm", "--edge", "2mm"])
    assert "only a surface (.stl, .obj, .ply) is filled" in str(odd.exception)
    assert run.invoke(cli, ["body", str(tmp_path / "b.npz"), "--unit", "m"]).exit_code == 0
    again = run.invoke(cli, ["body", str(tmp_path / "b.npz"), "--unit", "mm"])
    assert "b.npz: npz is in metres, not in mm; omit the unit" in str(again.exception)
    with pytest.raises(SceneError, match=r"validate body s.stl --unit mm"):
        read_mesh(tmp_path / "s.stl", "mm")


def test_a_body_of_an_unusual_size_is_asked_about_its_unit(tmp_path: Path) -> None:
    """One in metres that was read in mm was 0.03 mm high, and nothing was said."""
    path, mesh, run = tmp_path / "x.vtu", linear(), CliRunner()
    meshio.Mesh(6 * mesh.nodes, [("tetra", mesh.cells)]).write(path)
    out = tmp_path / "b.npz"
    odd = run.invoke(cli, ["body", str(path), "--unit", "mm", "-o", str(out)])
    assert isinstance(odd.exception, UsageError)
    assert str(odd.exception) == (
        "x.vtu: the body is 0.06 x 0.12 x 0.18 mm (lengths in mm); 0.6 x 1.2 x 1.8 mm in cm, "
        "1.524 x 3.048 x 4.572 mm in inch, 60 x 120 x 180 mm in m: give another --unit, or confirm "
        "its largest side: --size 0.18mm"
    )
    assert not out.exists()
    for said in (["--unit", "m"], ["--unit", "mm", "--size", "180um"], ["--unit", "cm"]):
        assert run.invoke(cli, ["body", str(path), *said]).exit_code == 0
    other = run.invoke(cli, ["body", str(path), "--unit", "m", "--size", "18mm"])
    assert "--size 18mm: the largest side is 180 mm in m; check" in str(other.exception)
    write_mesh(replace(mesh, nodes=1e3 * mesh.nodes), out)
    large = run.invoke(cli, ["body", str(out)])
    assert "3e+04 mm (lengths in m); 10 x 20 x 30 mm in mm" in str(large.exception)
    assert ": give nodes in m, or confirm its largest side" in str(large.exception)


@pytest.mark.parametrize(("side", "unit"), [(1e-3, "mm"), (10.0, "m"), (0.18, "mm")])
def test_a_body_of_a_usual_size_is_not_asked_about(side: float, unit: str) -> None:
    mesh = linear()
    assert odd_size(replace(mesh, nodes=mesh.nodes * (side / SIZE[2])), unit) == ""
    for beyond in (0.99e-3, 10.1):
        assert odd_size(replace(mesh, nodes=mesh.nodes * (beyond / SIZE[2])), unit)


def test_a_surface_of_vtk_is_told_how_to_come_in(tmp_path: Path) -> None:
    whole, run = pv.Box((0, 10, 0, 10, 0, 10)).triangulate(), CliRunner()
    for name in ("s.vtk", "s.vtp"):
        whole.save(tmp_path / name)
        refused = run.invoke(cli, ["body", str(tmp_path / name), "--unit", "mm"])
        assert re.search(rf"{name}: a surface of VTK .* mesh.save", str(refused.exception))


@pytest.mark.parametrize("cells", [[[0, 1, 2, 4]], [[-1, 1, 2, 3]]])
def test_elements_of_nodes_that_are_not_there_are_refused(cells: list[list[int]]) -> None:
    found = {"points": np.zeros((4, 3)), "cells.tetra": np.array(cells)}
    low, high = np.min(cells), np.max(cells)
    with pytest.raises(SceneError, match=rf"x\.vtu: .* nodes {low} to {high} of 4"):
        third_party_meshes._body("x.vtu", found, 1.0, None, turn=False)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("<VTKFile>", r"not a list of files \("),
        ("<VTKFile><DataSet file='a.vtu'/></VTKFile>", r"not a list of files \('timestep'\)"),
        ("<VTKFile><DataSet timestep='x' file='a'/></VTKFile>", r"not a list of files \(could not"),
        ("<VTKFile></VTKFile>", "lists no file"),
        ("<VTKFile><DataSet timestep='0' file='../a.vtu'/></VTKFile>", "'../a.vtu' is outside"),
        (
            "<!DOCTYPE x><VTKFile></VTKFile>",
            "declares XML entities, which a list of files does not need",
        ),
    ],
)
def test_a_series_that_is_none_is_refused(text: str, says: str, tmp_path: Path) -> None:
    (tmp_path / "a.pvd").write_text(text)
    with pytest.raises(ValidateError, match=says):
        vtu.arrays(tmp_path / "a.pvd")


def test_a_series_of_two_meshes_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    listed = "".join(f"<DataSet timestep='{t}' file='{t}.vtu'/>" for t in (1, 0))
    (tmp_path / "a.pvd").write_text(f"<VTKFile>{listed}</VTKFile>")
    sizes = {"0.vtu": 4, "1.vtu": 4}

    def fields(path: Path) -> dict[str, np.ndarray]:
        points = np.zeros((sizes[path.name], 3))
        return {"points": points, "u": points + int(path.stem)}

    monkeypatch.setattr(vtu, "_fields", fields)
    found = vtu.arrays(tmp_path / "a.pvd")
    assert found["t"].tolist() == [0.0, 1.0]
    assert found["u"][:, 0, 0].tolist() == [0.0, 1.0]
    sizes["1.vtu"] = 5
    with pytest.raises(SceneError, match="files of different numbers of points"):
        vtu.arrays(tmp_path / "a.pvd")


@pytest.mark.own_process
@pytest.mark.parametrize(
    ("head", "says"),
    [
        (
            b"<VTKFile compressor='vtkLZ4DataCompressor'>",
            "compressed by LZ4, which is not supported; ",
        ),
        (b"# vtk DataFile\nDATASET POLYDATA", "surface"),
    ],
)
def test_files_that_would_end_the_library_are_refused_first(
    head: bytes, says: str, tmp_path: Path
) -> None:
    (tmp_path / "a.vtu").write_bytes(head)
    with pytest.raises(SceneError, match=says):
        meshio_arrays.read_quietly(tmp_path / "a.vtu", "a.vtu")
