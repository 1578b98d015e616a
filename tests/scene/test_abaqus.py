"""Abaqus .inp: a body's nodes, elements and node sets, read by a library in a process apart."""

from pathlib import Path

import numpy as np
import pytest

from validate.errors import SceneError
from validate.scene.box import grid
from validate.scene.foreign_mesh import read_foreign
from validate.scene.mesh import Mesh, cell_volumes, quadratic
from validate.scene.mesh_file import read_mesh

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
    return quadratic(linear) if kind == "tet10" else linear


@pytest.mark.parametrize("kind", SHAPES)
def test_a_body_comes_back_whole(tmp_path: Path, kind: str) -> None:
    whole = body(kind)
    path = tmp_path / "body.inp"
    path.write_text(inp(whole))
    got = read_mesh(path, "cm")
    assert (got.kind, got.cells.shape, len(got.nodes)) == (
        kind, whole.cells.shape, len(whole.nodes),
    )  # fmt: skip
    assert cell_volumes(got).sum() == pytest.approx(1e-6 * 6e-6)
    np.testing.assert_allclose(got.nodes[got.cells], 0.01 * whole.nodes[whole.cells], atol=1e-12)
    assert list(got.facets) == ["lower_plate"]
    lower = got.nodes[got.facet_nodes("lower_plate")]
    assert lower[:, 2].max() == 0
    assert len(lower) == (9 if kind == "tet10" else 4)


def test_the_liver(shared_data: Path) -> None:
    got = read_foreign(shared_data / LIVER, "m").mesh
    assert (got.kind, len(got.nodes), len(got.cells)) == ("tet4", 935, 4408)
    assert 0.5e-3 < cell_volumes(got).sum() < 3e-3  # m3: a liver of half a litre to three
    assert {"Disp", "FixT&P"} <= set(got.facets)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "0 bytes"),
        ("no mesh at all\n", "0 lists of nodes"),
        (inp(body("tet4"), extra="*Include, input=/etc/passwd"), "an [*]Include"),
        (inp(body("tet4"), extra="*Node\n900, 0., 0., 0."), "2 lists of nodes"),
        (inp(body("tet4"), "C3D6"), "meshio cannot read it .Expected number"),
        (inp(body("tet4"), "S4"), "12 quad; one of tetra"),
        (inp(body("tet4"), "XYZ9"), "not available: XYZ9"),
        (inp(body("hex8"), "C3D20"), "meshio cannot read it .Expected number"),
        (inp(body("tet4")).replace("*Node\n  7, 9", "*Node\n  7, x"), "body.inp: damaged"),
    ],
    ids=["empty", "text", "include", "nodes", "wedge", "shell", "unknown", "brick", "number"],
)
def test_what_is_no_body_is_one_line(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "body.inp"
    path.write_text(text)
    with pytest.raises(SceneError, match=said) as raised:
        read_foreign(path, "m")
    assert "\n" not in str(raised.value)


def test_elements_inside_out_and_curved_ones_are_refused(tmp_path: Path) -> None:
    path, whole = tmp_path / "body.inp", body("tet4")
    turned = Mesh(whole.nodes, whole.cells[:, [1, 0, 2, 3]], "tet4")
    path.write_text(inp(turned))
    with pytest.raises(SceneError, match=r"body\.inp: "):
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
    with pytest.raises(SceneError, match="no unit of length"):
        read_foreign(tmp_path / "none.inp", "kPa")
