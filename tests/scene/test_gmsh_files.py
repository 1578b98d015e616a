"""Files of Gmsh 4.15 (tests/scene/gmsh: a block of 40 x 30 x 50 mm), as it wrote them."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from validate.commands.main import cli
from validate.errors import SceneError, UsageError
from validate.scene.body_facts import quality
from validate.scene.mesh_files.mesh_file import read_mesh
from validate.scene.mesh_files.third_party_meshes import read_foreign

pytestmark = pytest.mark.usefixtures("decoded_here")

FILES = Path(__file__).parent / "gmsh"
SIDES = {f"side{i}": n for i, n in enumerate((6, 6, 12, 12, 12, 12), 1)}


@pytest.mark.parametrize("name", ["groups_41.msh", "groups_41_binary.msh", "all.inp", "order2.inp"])
def test_groups_become_facet_sets(name: str) -> None:
    body = read_foreign(FILES / name, "mm")
    assert body.mesh.cell_volumes().sum() == pytest.approx(6e-5)
    found = {k: len(f) for k, f in body.mesh.facets.items()}
    assert {k: found[k] for k in SIDES} == SIDES
    top = body.mesh.nodes[body.mesh.facet_nodes("side6")]
    assert np.ptp(top, axis=0).min() == 0.0
    assert body.told["not used"].startswith("0 of")


def test_what_stands_beside_a_solid_is_told_and_names_facets() -> None:
    body = read_foreign(FILES / "order2.inp", "mm")
    assert body.told["left out"].startswith("24 T3D3, 60 CPS6 in addition to the solid")
    assert body.mesh.kind == "tet10"
    assert len(body.mesh.facets["Surface3"]) == 12
    assert "left out" not in read_foreign(FILES / "groups_41.msh", "mm").told


def test_a_shell_on_a_solid_is_no_facet(tmp_path: Path) -> None:
    text = (FILES / "all.inp").read_text("utf-8").replace("type=CPS3", "type=S3")
    (tmp_path / "shell.inp").write_text(text, "utf-8")
    with pytest.raises(SceneError, match="its elements are 60 S3, 60 tetra"):
        read_foreign(tmp_path / "shell.inp", "mm")


@pytest.mark.parametrize("name", ["bricks20.inp", "bricks20.msh", "bricks27.msh"])
def test_straight_quadratic_bricks_come_in(name: str, tmp_path: Path) -> None:
    """Two bricks of 10 x 20 x 15 mm with a node on every edge, or on faces and within, too."""
    body = read_foreign(FILES / name, "mm")
    assert (body.mesh.kind, body.mesh.cells.shape) == ("hex27", (2, 27))
    assert body.mesh.cell_volumes().sum() == pytest.approx(6e-6)
    assert quality(body.mesh).min() == pytest.approx(1)
    bottom = body.mesh.facets["bottom" if name.endswith("msh") else "Surface5"]
    assert np.abs(body.mesh.nodes[bottom][..., 2]).max() < 1e-12
    assert bottom.shape == (1, 9)
    text = (FILES / name).read_text("utf-8")
    place, bent = ("5, 0, 0", "5, 0, 0.5") if name.endswith("inp") else ("\n5 0 0", "\n5 0 0.5")
    assert place in text
    (tmp_path / name).write_text(text.replace(place, bent), "utf-8")
    with pytest.raises(SceneError, match=r"1 edges or faces .* 0\.5 mm off"):
        read_foreign(tmp_path / name, "mm")


def test_faces_of_a_quadratic_brick_are_those_of_its_corners(tmp_path: Path) -> None:
    """All of both bricks': ten are outside."""
    rows = "\n".join(f"Volume1, S{k}" for k in range(1, 7))
    text = (FILES / "bricks20.inp").read_text("utf-8")
    (tmp_path / "s.inp").write_text(f"{text}*Surface, name=all\n{rows}\n", "utf-8")
    body = read_foreign(tmp_path / "s.inp", "mm")
    assert body.mesh.facets["all"].shape == (10, 9)


def test_no_group_is_no_set() -> None:
    assert dict(read_foreign(FILES / "no_groups_22.msh", "mm").mesh.facets) == {}


@pytest.mark.parametrize("text", ["$NOD\n1\n1 0 0 0\n$ENDNOD\n", "$MeshFormat\n3 0 8\n"])
def test_formats_that_are_not_read_are_named(tmp_path: Path, text: str) -> None:
    old = tmp_path / "old.msh"
    old.write_text(text, "utf-8")
    for file in (old, FILES / "groups_40.msh"):
        with pytest.raises(SceneError, match=r"format [134] .* as 2\.2 or 4\.1"):
            read_foreign(file, "mm")


def test_faces_are_named_by_words(tmp_path: Path) -> None:
    out = tmp_path / "body.npz"
    file = str(FILES / "no_groups_22.msh")
    names = ["--face", "top=zmax", "--face", "side=x=40mm", "--face", "spot=near 0,15mm,25mm"]
    CliRunner().invoke(cli, ["body", file, "--unit", "mm", *names, "-o", str(out)])
    facets = read_mesh(out).facets
    assert {k: len(f) for k, f in facets.items()} == {"top": 12, "side": 6, "spot": 1}
    done = CliRunner().invoke(cli, ["body", file, "--unit", "mm", "--face", "a=lid"])
    assert isinstance(done.exception, SceneError)
    (tmp_path / "b.unv").write_text("    -1\n", "utf-8")
    odd = CliRunner().invoke(cli, ["body", str(tmp_path / "b.unv"), "--unit", "mm"])
    assert isinstance(odd.exception, UsageError)
    assert "this format is not read; expected npz, .inp" in str(odd.exception)
