"""Abaqus .inp: a body's nodes, elements and node sets, read by a library in a process apart."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from validate.errors import SceneError
from validate.scene.geometries.box import grid
from validate.scene.mesh import Mesh
from validate.scene.mesh_files import abaqus_arrays
from validate.scene.mesh_files import abaqus_text as abaqus_lines
from validate.scene.mesh_files.abaqus_arrays import placed
from validate.scene.mesh_files.abaqus_text import KeywordBlock
from validate.scene.mesh_files.mesh_file import read_mesh
from validate.scene.mesh_files.third_party_meshes import read_foreign

# private: _MOST: replaced by a small number: a short test.
# private: _range: called alone, case by case.

SHAPES = {"tet4": "C3D4T", "tet10": "c3d10mh", "hex8": "C3D8R"}
LIVER = "mesh/liver/Liver_Iso_935n_4408t.inp"


def inp(mesh: Mesh, shape: str = "", extra: str = "") -> str:
    """The mesh with gaps in its numbers, a node of no element, and its lower nodes as a set."""
    lines = ["*Heading", "** made for a test", "*Part, name=body", "*Node", "  7, 9., 9., 9."]
    lines += [f"{10 + 2 * i}, {', '.join(map(repr, x.tolist()))}" for i, x in enumerate(mesh.nodes)]
    lines.append(f"*Element, type={shape or SHAPES[mesh.kind]}, elset=all")
    for e, cell in enumerate(mesh.cells):
        lines.append(f"{e + 1}, " + ", ".join(str(10 + 2 * i) for i in cell))
    low = np.flatnonzero(mesh.nodes[:, 2] < 1e-9)
    lines += ["*Nset, nset=lower_plate", ", ".join(str(10 + 2 * i) for i in low[:8])]
    lines += [", ".join(str(10 + 2 * i) for i in low[8:])] if len(low) > 8 else []
    lines += ["*Nset, nset=lost", "7", "*End Part", extra]
    return "\n".join(lines) + "\n"


def body(kind: str) -> Mesh:
    mesh = grid((0.01, 0.02, 0.03), (1, 1, 2))
    if kind == "hex8":
        return mesh
    linear = Mesh(mesh.nodes, mesh.simplices, "tet4")
    return linear.quadratic() if kind == "tet10" else linear


@pytest.mark.parametrize("kind", SHAPES)
def test_a_body_comes_back_whole(tmp_path: Path, kind: str) -> None:
    whole = body(kind)
    path = tmp_path / "body.inp"
    path.write_text(inp(whole))
    got = read_mesh(path, "cm")
    assert (got.kind, got.cells.shape, len(got.nodes)) == (
        kind, whole.cells.shape, len(whole.nodes),
    )  # fmt: skip
    assert got.cell_volumes().sum() == pytest.approx(1e-6 * 6e-6)
    np.testing.assert_allclose(got.nodes[got.cells], 0.01 * whole.nodes[whole.cells], atol=1e-12)
    assert list(got.facets) == ["lower_plate"]
    lower = got.nodes[got.facet_nodes("lower_plate")]
    assert lower[:, 2].max() == 0
    assert len(lower) == (9 if kind == "tet10" else 4)


def test_the_liver(shared_data: Path) -> None:
    got = read_foreign(shared_data / LIVER, "m").mesh
    assert (got.kind, len(got.nodes), len(got.cells)) == ("tet4", 935, 4408)
    assert 0.5e-3 < got.cell_volumes().sum() < 3e-3  # m3: a liver of half a litre to three
    assert {"Disp", "FixT&P"} <= set(got.facets)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "0 bytes"),
        ("no mesh at all\n", "no elements: the file is not an Abaqus input file"),
        (inp(body("tet4"), extra="*Include, input=/etc/passwd"), "outside its folder .*line 36"),
        (inp(body("tet4"), extra="*Include, input=../x.inp"), "outside its folder .* copy it"),
        (inp(body("tet4"), extra="*Include, input=body.inp"), "'body.inp' in line 36 includes its"),
        (inp(body("tet4"), extra="*Include, input=a.inp, password=b"),
            "encrypted; export it without encryption"),
        (inp(body("tet4"), extra="*Include, input=a\0.inp"), "is not a file name"),
        (inp(body("tet4"), extra=f"*Include, input={300 * 'a'}"), "cannot be followed"),
        (inp(body("tet4")).replace("*Part", "*Ngen\n1, 5\n*Part"), r"\*Ngen in line 3: is not"),
        (inp(body("tet4")).replace("*Node", "*System\n1., 0\n*Node"), r"\*System in line 4: exp"),
        (inp(body("tet4")).replace("*Node", "*System\n1,0,0,1,0,0\n*Node"),
            "coincide or lie on a line"),
        (inp(body("tet4")).replace("*Node", "*Node, system=C"), "that are not Cartesian"),
        (inp(body("tet4")).replace("*Node", "*Node, input=n.txt"), "'n.txt' in line 4 is no file"),
        (inp(body("tet4")).replace("*End Part", "*Node\n10, 0., 0., 9."),
            "node 10 has two positions"),
        (inp(body("tet4"), "C3D6"), r"60 numbers, not 7 for each C3D6"),
        (inp(body("tet4"), "S4"), "12 S4; one of tetra"),
        (inp(body("tet4"), "XYZ9"), "12 XYZ9; one of tetra"),
        (inp(body("hex8"), "C3D20"), r"18 numbers, not 21 for each C3D20"),
        (inp(body("tet4")).replace("*Node\n  7, 9", "*Node\n  7, x"), r"\*Node in line 4: could"),
        (inp(body("tet4")).replace("*Nset", "*Nset, elset=none"), "no element set 'none'"),
        (inp(body("tet4")).replace("*Nset, nset=lost\n7", "*Nset, nset=x\ny"), "no set 'y' before"),
        (inp(body("tet4")).replace("\n12, 0", "\n1200, 0"), "there is no node 12"),
        (inp(body("tet4")).replace("\n2, ", "\n1, "), r"line \d+: element 1 is defined twice"),
    ],
    ids=["empty", "text", "passwd", "above", "itself", "locked", "zero", "long", "ngen", "system",
         "one point", "cylindrical", "input", "twice", "wedge",
         "shell", "unknown", "brick", "number", "elset", "nset", "node", "element"],
)  # fmt: skip
def test_what_is_no_body_is_one_line(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "body.inp"
    path.write_text(text)
    with pytest.raises(SceneError, match=said) as raised:
        read_foreign(path, "m")
    assert "\n" not in str(raised.value)


def test_what_a_deck_includes_stands_in_its_place(tmp_path: Path) -> None:
    """Nodes by input=, elements by a file that includes another, in a folder, written as Windows
    writes names."""
    text, path = inp(body("tet4")), tmp_path / "body.inp"
    path.write_text(text)
    whole = read_foreign(path, "m")
    assert "included" not in whole.told
    head, _, rest = text.partition("*Node\n")
    rows, keyword, more = rest.partition("*Element")
    cells, _, last = more.partition("*Nset, nset=lower_plate\n")
    sets, end, _ = last.partition("*Nset, nset=lost")
    (tmp_path / "mesh").mkdir()
    (tmp_path / "mesh" / "nodes.txt").write_text(rows)
    (tmp_path / "mesh" / "Cells.inp").write_text(f"{keyword}{cells}*Include,\n input=low.inp\n")
    (tmp_path / "low.inp").write_text("*Nset, nset=lower_plate, input=low.txt")
    (tmp_path / "low.txt").write_text(sets)
    path.write_text(f"{head}*Node, input=mesh/nodes.txt\n"
                    f"*INCLUDE, INPUT=mesh\\Cells.inp\n{end}\n7\n*End Part\n")  # fmt: skip
    got = read_foreign(path, "m")
    np.testing.assert_array_equal(got.mesh.nodes, whole.mesh.nodes)
    np.testing.assert_array_equal(got.mesh.cells, whole.mesh.cells)
    np.testing.assert_array_equal(got.mesh.facets["lower_plate"], whole.mesh.facets["lower_plate"])
    assert got.told["included"] == r"mesh/nodes.txt, mesh\Cells.inp, low.inp, low.txt"
    (tmp_path / "low.txt").write_text("12, x\n")
    with pytest.raises(SceneError, match=r"\*Nset in line 1 of 'low.inp'.*'x'"):
        read_foreign(path, "m")
    (tmp_path / "low.txt").write_text("*Nset\n")
    with pytest.raises(SceneError, match=r"'\*Nset' in line 1 of 'low.txt'"):
        read_foreign(path, "m")
    (tmp_path / "low.txt").unlink()
    (tmp_path / "low.txt").symlink_to("/etc/passwd")
    with pytest.raises(SceneError, match="is outside its folder"):
        read_foreign(path, "m")


def test_inclusions_in_a_loop_or_without_end_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "body.inp"
    path.write_text(inp(body("tet4"), extra="*Include, input=a.inp"))
    (tmp_path / "a.inp").write_text("*Include, input=b.inp\n")
    (tmp_path / "b.inp").write_text("*Include, input=a.inp\n")
    with pytest.raises(SceneError, match=r"'a.inp' in line 1 of 'b.inp'"):
        read_foreign(path, "m")
    for k in range(30):  # each twice the next: a thousand million lines
        (tmp_path / f"n{k}.inp").write_text(2 * f"*Include, input=n{k + 1}.inp\n")
    (tmp_path / "n30.inp").write_text("")
    (tmp_path / "a.inp").write_text("*Include, input=n0.inp\n")
    with pytest.raises(SceneError, match=r"more than 200 inclusions, at 'n"):
        read_foreign(path, "m")
    (tmp_path / "a.inp").unlink()
    (tmp_path / "a.inp").symlink_to("a.inp")
    with pytest.raises(SceneError, match="cannot be followed"):
        read_foreign(path, "m")


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        ("1., 2., 3.", lambda x, y, z: (x + 1, y + 2, z + 3)),
        # x shown along y (what it rises is left out), z as it is
        ("1., 2., 3., 1., 9., 8.", lambda x, y, z: (1 - y, 2 + x, 3 + z)),
        # x along z, y along x: so that z is along y
        ("1., 2., 3., 1., 2., 5.\n4., 2., 9.", lambda x, y, z: (1 + y, 2 + z, 3 + x)),
    ],
)
def test_nodes_in_a_system_of_their_own(
    rows: str, expected: Callable[..., tuple[float, ...]], tmp_path: Path
) -> None:
    """By hand, for *System's three forms; an empty one, and the end of the part, end it."""
    text, path = inp(body("tet4")), tmp_path / "body.inp"
    path.write_text(text)
    whole = read_foreign(path, "m").mesh
    path.write_text(text.replace("*Node", f"*System\n{rows}\n*Node"))
    got = read_foreign(path, "m").mesh
    moved = np.array([expected(*x) for x in whole.nodes.tolist()])
    np.testing.assert_allclose(got.nodes, moved, atol=1e-12)
    for ended in (f"*System\n{rows}\n*System\n*Node", f"*System\n{rows}\n*Part, name=b\n*Node"):
        path.write_text(text.replace("*Node", ended))
        np.testing.assert_array_equal(read_foreign(path, "m").mesh.nodes, whole.nodes)


def test_an_empty_place_between_commas_is_a_zero(tmp_path: Path) -> None:
    """Left out, a height became a breadth."""
    text, path = inp(body("tet4")), tmp_path / "body.inp"
    path.write_text(text)
    whole = read_foreign(path, "m").mesh
    path.write_text(text.replace(" 0.0, 0.0, 0.03", " , , 0.03"))
    assert ", , , 0.03" in path.read_text()
    np.testing.assert_array_equal(read_foreign(path, "m").mesh.nodes, whole.nodes)


def test_elements_inside_out_and_curved_ones_are_refused(tmp_path: Path) -> None:
    path, whole = tmp_path / "body.inp", body("tet4")
    turned = Mesh(whole.nodes, whole.cells[:, [1, 0, 2, 3]], "tet4")
    path.write_text(inp(turned))
    with pytest.raises(SceneError, match=r"body\.inp: 12 of 12 .*; reverse"):
        read_foreign(path, "m")
    round_ = body("tet10")
    nodes = round_.nodes.copy()
    nodes[round_.cells[0, 4]] += 1e-3
    path.write_text(inp(Mesh(nodes, round_.cells, "tet10")))
    with pytest.raises(SceneError, match="are curved"):
        read_foreign(path, "m")


def test_a_file_that_is_not_there_and_a_unit_that_is_none(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="no such file"):
        read_foreign(tmp_path / "none.inp", "m")
    with pytest.raises(SceneError, match="is not a unit of length"):
        read_foreign(tmp_path / "none.inp", "kPa")


# --- as Abaqus/CAE writes them -------------------------------------------------------------------

FRONT = "*Surface, type=ELEMENT, name=front\n_front_S{face}, S{face}"


def cae(mesh: Mesh, instance: str, more: str = "", meshed_on: str = "part") -> str:
    """One part and its instance, sets of the assembly, a reference point, a step; the mesh is on
    the part, or on the instance itself."""
    rows = ["*Node", *(f"{i + 1:7d}, {x[0]:g}, {x[1]:g}, {x[2]:g}"
                       for i, x in enumerate(1e3 * mesh.nodes))]  # fmt: skip
    rows += ["*Element, type=C3D4"]
    rows += [f"{e + 1}, " + ", ".join(str(i + 1) for i in c) for e, c in enumerate(mesh.cells)]
    rows += ["*Nset, nset=Set-1, generate", f"1, {len(mesh.nodes)}, 1"]
    low = np.flatnonzero(mesh.nodes[:, 2] < 1e-9) + 1
    empty = meshed_on == "instance"
    lines = ["*Heading", "** Generated by: Abaqus/CAE 2021", "*Preprint, echo=NO", "**",
             "*Part, name=Gel", *([] if empty else rows), "*End Part", "**",
             "*Assembly, name=Assembly", "*Instance, name=Gel-1, part=Gel", instance,
             *(rows if empty else []), "*End Instance", "*Node", "1, 0., 0., 99.",
             "*Nset, nset=RP, internal", "1,", "*Nset, nset=bottom, instance=Gel-1",
             ", ".join(map(str, low)), more, "*End Assembly", "*Material, name=Gel",
             "*Hyperelastic, neo hooke", "0.01, 2.", "*Step, nlgeom=YES", "*Static", "0.1, 1.",
             "*Boundary", "bottom, ENCASTRE", "*End Step"]  # fmt: skip
    return "\n".join(line for line in lines if line) + "\n"


@pytest.mark.parametrize("meshed_on", ["part", "instance"])
def test_a_part_stands_where_its_instance_stands(meshed_on: str, tmp_path: Path) -> None:
    """Shifted by 5 mm, then turned by a right angle about the line x = 5 mm along z."""
    whole, path = body("tet4"), tmp_path / "cae.inp"
    path.write_text(cae(whole, "5., 0., 0.\n5., 0., 0., 5., 0., 1., 90.", meshed_on=meshed_on))
    got = read_foreign(path, "mm")
    x, y, z = (whole.nodes + [5e-3, 0, 0]).T
    expected = np.stack([5e-3 - y, x - 5e-3, z], axis=1)
    np.testing.assert_allclose(got.mesh.nodes, expected, atol=1e-12)
    assert got.told["moved"] == "to the position of its instance 'Gel-1'"
    assert np.abs(got.mesh.nodes[got.mesh.facet_nodes("bottom"), 2]).max() < 1e-12
    assert "RP" not in got.mesh.facets  # the reference point has the number of a node


def test_names_are_the_same_in_capitals_and_small_letters(tmp_path: Path) -> None:
    """Else the instance is another's, and the body is silently left where its part stands."""
    whole, path = body("tet4"), tmp_path / "cae.inp"
    more = "*Elset, elset=One, instance=GEL-1\n1\n*Nset, nset=Again\nBOTTOM\n"
    faces = "".join(f"ONE, s{k}\n" for k in (1, 2, 3, 4))
    text = cae(whole, "5., 0., 0.", f"{more}*Surface, name=front\n{faces}")
    path.write_text(
        text.replace("part=Gel", "part=GEL").replace("instance=Gel-1", "instance=gel-1")
    )
    got = read_foreign(path, "mm").mesh
    np.testing.assert_allclose(got.nodes, whole.nodes + [5e-3, 0, 0], atol=1e-12)
    assert {"bottom", "Again", "front"} <= set(got.facets)
    np.testing.assert_array_equal(got.facets["Again"], got.facets["bottom"])


@pytest.mark.parametrize("kind", SHAPES)
@pytest.mark.parametrize("face", [1, 2, 3, 4, 5, 6])
def test_a_surface_is_the_faces_it_names(kind: str, face: int, tmp_path: Path) -> None:
    """Every outer face of an element that Abaqus' numbering names, by the plane it lies in."""
    whole, path = body(kind), tmp_path / "s.inp"
    path.write_text(inp(whole, extra=f"*Elset, elset=one\n1\n*Surface, name=front\none, S{face}"))
    if kind != "hex8" and face > 4:
        with pytest.raises(SceneError, match=f"element 1 has no face S{face}"):
            read_foreign(path, "m")
        return
    got = read_foreign(path, "m").mesh
    corners = {"tet4": 4, "tet10": 4, "hex8": 8}[kind]
    # By the published numbering: which corners of the element are on the face.
    on = {4: ("123", "142", "243", "341"),
          8: ("1234", "5876", "1562", "2673", "3784", "4851")}[corners]  # fmt: skip
    nodes = whole.nodes[whole.cells[0, [int(k) - 1 for k in on[face - 1]]]]
    outer = [sorted(map(tuple, got.nodes[f])) for f in got.facets.get("front", ())]
    drawn = sorted(map(tuple, nodes))
    is_outer = any(sorted(map(tuple, whole.nodes[f[: len(nodes)]])) == drawn for f in whole.surface)
    assert [f for f in outer if set(drawn) <= set(f)] == (outer if is_outer else [])
    assert len(outer) == int(is_outer)


def test_a_rigid_punch_beside_the_body_is_left_out_and_told(tmp_path: Path) -> None:
    punch = ("*Part, name=Punch\n*Node\n1, 0., 0., 40.\n2, 9., 0., 40.\n3, 0., 9., 40.\n"
             "*Element, type=R3D3\n1, 1, 2, 3\n*End Part\n*Assembly")  # fmt: skip
    path = tmp_path / "cae.inp"
    path.write_text(cae(body("tet4"), "").replace("*Assembly", punch, 1))
    got = read_foreign(path, "mm")
    assert got.mesh.cell_volumes().sum() == pytest.approx(6e-6)
    assert got.told["left out"].startswith("'Punch' in addition to the solid")


def test_of_two_bodies_and_of_one_that_stands_twice_one_is_chosen(tmp_path: Path) -> None:
    text, path = cae(body("tet4"), ""), tmp_path / "cae.inp"
    path.write_text(text.replace("*End Instance", "*End Instance\n*Instance, name=Gel-2, part=Gel\n"
                                 "50., 0., 0.\n*End Instance"))  # fmt: skip
    with pytest.raises(SceneError, match=r"2 bodies .*'Gel-2'\): .* --part Gel-1"):
        read_foreign(path, "mm")
    with pytest.raises(SceneError, match=r"2 bodies \('Gel-1', 'Gel-2'\)"):
        read_foreign(path, "mm", "Gel")
    for name, at in (("Gel-1", 0.0), ("gel-2", 0.05)):
        got = read_foreign(path, "mm", name)
        np.testing.assert_allclose(got.mesh.nodes, body("tet4").nodes + [at, 0, 0], atol=1e-12)
        assert got.told["part"] == f"{name}: 12 of 12 elements"
        assert ("bottom" in got.mesh.facets) == (name == "Gel-1")
    part = text[text.index("*Part") : text.index("*Assembly")]
    path.write_text(text.replace("*Assembly", part.replace("Gel", "Plate") + "*Assembly", 1))
    with pytest.raises(SceneError, match=r"2 bodies \('Gel-1', 'Plate'\)"):
        read_foreign(path, "mm")
    assert "'Gel'" in read_foreign(path, "mm", "PLATE").told["left out"]
    assert "'Plate'" in read_foreign(path, "mm", "Gel").told["left out"]


def test_a_set_of_elements_is_a_part(tmp_path: Path) -> None:
    """With what it shares with the rest as a facet set, which the whole has inside."""
    whole, path = body("hex8"), tmp_path / "x.inp"
    middle = np.flatnonzero(np.abs(whole.nodes[:, 2] - 0.015) < 1e-9)
    rows = (
        f"*Elset, elset=Upper\n2\n*Nset, nset=joint\n{', '.join(str(10 + 2 * i) for i in middle)}"
    )
    path.write_text(inp(whole, extra=rows))
    assert "joint" not in read_foreign(path, "m").mesh.facets
    got = read_foreign(path, "m", "upper")
    assert got.mesh.cell_volumes().sum() == pytest.approx(3e-6)
    assert got.mesh.nodes[:, 2].min() == 0.015
    assert got.mesh.nodes[got.mesh.facet_nodes("joint"), 2].max() == 0.015
    with pytest.raises(SceneError, match=r"no part 'x'; .*'Upper', .*by size 1"):
        read_foreign(path, "m", "x")


def test_sets_by_range_by_other_sets_and_by_elements(tmp_path: Path) -> None:
    whole, path = body("hex8"), tmp_path / "x.inp"
    rows = ("*Nset, nset=LOW, generate\n10, 16, 2\n*Nset, nset=again\nLOW,\n"
            "*Elset, elset=first\n1,\n*Nset, nset=ofone, elset=first")  # fmt: skip
    path.write_bytes(inp(whole, extra=rows).replace("\n", "\r\n").encode("latin-1"))
    got = read_foreign(path, "m").mesh
    assert set(got.facets) == {"lower_plate", "LOW", "again", "ofone"}
    assert np.array_equal(got.facets["LOW"], got.facets["again"])
    one = whole.nodes[whole.cells[0]]
    there = got.nodes[got.facet_nodes("ofone")]
    assert {tuple(x) for x in there} <= {tuple(x) for x in one}


def block(*rows: str) -> KeywordBlock:
    return KeywordBlock("*INSTANCE", {}, rows, "line 7")


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: placed(np.zeros((1, 3)), block("1, 2")), "a shift x, y, z, and a turn about two"),
        (
            lambda: placed(np.zeros((1, 3)), block("0, 0, 0", "1, 0, 0, 1, 0, 0, 90")),
            "the rotation axis has two equal points",
        ),
        (
            lambda: abaqus_arrays._range(block(), "1, 2.5"),
            "'1, 2.5': expected first, last and step",
        ),
        (lambda: abaqus_arrays._range(block(), "4"), "'4': expected first, last and step"),
    ],
)
def test_rows_of_a_deck_that_are_none_name_their_line(
    call: Callable[[], object], says: str
) -> None:
    with pytest.raises(SceneError, match=f"line 7.*{says}"):
        call()


def test_an_instance_is_shifted_then_turned_and_ranges_contain_their_ends() -> None:
    quarter = block("1, 0, 0", "0, 0, 0, 0, 0, 1, 90")
    assert placed(np.array([[1.0, 0.0, 5.0]]), quarter) == pytest.approx(np.array([[0, 2, 5]]))
    assert list(abaqus_arrays._range(block(), "2, 8, 3")) == [2, 5, 8]


def test_a_deck_that_grows_beyond_its_limit_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.inp").write_text("*NODE\n1, 0, 0, 0\n")
    monkeypatch.setattr(abaqus_lines, "_MOST", 10)
    with pytest.raises(SceneError, match="more than 10 bytes with what it includes"):
        list(abaqus_lines.Deck(tmp_path / "a.inp").lines())
