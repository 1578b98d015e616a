"""Every body under attack: a mesh of positive elements, or one typed line with the file.

A library in a process apart costs 0.3 s a call, filling a surface two: those formats get a fortieth
and a two-hundredth of the attacks.
"""

import base64
import os
import re
import resource
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np
import pytest
import trimesh
from attacks import damaged
from click.testing import CliRunner
from test_abaqus import body, cae, inp

from validate.commands.main import cli, run
from validate.errors import SceneError
from validate.scene.mesh import Mesh
from validate.scene.mesh_files.mesh_file import MAX_BYTES, filled, read_mesh, write_mesh
from validate.scene.mesh_files.mesh_file import SUFFIXES as SURFACES
from validate.scene.mesh_files.third_party_meshes import SUFFIXES as FOREIGN
from validate.scene.mesh_files.third_party_meshes import read_foreign

SPARSE = 4 * 2**30  # bytes


def by_meshio(form: str, *, binary: bool) -> Callable[[Path], None]:
    def make(path: Path) -> None:
        whole = body("tet4")
        made = meshio.Mesh(1e3 * whole.nodes, [("tetra", whole.cells)])
        made.write(path, file_format=form, **({} if form == "vtu" else {"binary": binary}))

    return make


def by_trimesh(path: Path) -> None:
    trimesh.creation.box((10.0, 20.0, 30.0)).export(path)


MAKE: dict[str, Callable[[Path], object]] = {
    "flat.inp": lambda path: path.write_text(inp(body("tet4"))),
    "cae.inp": lambda path: path.write_text(cae(body("tet4"), "5., 0., 0.")),
    "body.npz": lambda path: write_mesh(body("tet4"), path),
    "text.msh": by_meshio("gmsh22", binary=False),
    "binary.msh": by_meshio("gmsh22", binary=True),
    "x.vtu": by_meshio("vtu", binary=True),
    "x.vtk": by_meshio("vtk", binary=True),
    "x.stl": by_trimesh,
    "x.obj": by_trimesh,
    "x.ply": by_trimesh,
}
APART = [name for name in MAKE if not name.endswith((".inp", ".npz"))]
EACH = pytest.mark.parametrize("name", MAKE)


def read(path: Path) -> Mesh:
    suffix = path.suffix
    if suffix in SURFACES:
        return filled(path, "mm", 1e-2).mesh
    return read_foreign(path, "mm").mesh if suffix in FOREIGN else read_mesh(path)


def attacked(path: Path) -> None:
    """What is read is a body; what is refused is one line that can be shown."""
    try:
        mesh = read(path)
    except SceneError as error:
        said = str(error)
        assert said.startswith(path.name)
        assert said.isprintable()
    else:
        assert (mesh.cell_volumes() > 0).all()


def under_attack(path: Path, cuts: int, flips: int) -> None:
    whole = path.read_bytes()
    for data in damaged(whole, cuts, flips):
        path.write_bytes(data)
        attacked(path)
    assert [p.name for p in path.parent.iterdir()] == [path.name]


@pytest.mark.parametrize("name", [n for n in MAKE if n not in APART])
def test_some_cuts_and_flips_are_a_body_or_one_line(name: str, tmp_path: Path) -> None:
    MAKE[name](tmp_path / name)
    under_attack(tmp_path / name, cuts=10, flips=30)


@pytest.mark.slow
@EACH
def test_cuts_and_flips_are_a_body_or_one_line(name: str, tmp_path: Path) -> None:
    MAKE[name](tmp_path / name)
    surface = Path(name).suffix in SURFACES
    cuts, flips = (1, 4) if surface else (2, 6) if name in APART else (60, 600)
    under_attack(tmp_path / name, cuts, flips)


@EACH
def test_what_is_no_file_or_much_too_large_is_one_line(name: str, tmp_path: Path) -> None:
    """Four gigabytes of zeros, nothing at all, a folder, a loop of links, a pipe."""
    path = tmp_path / name
    path.write_bytes(b"")
    cases = [path]
    for what in ("zeros", "folder", "loop", "pipe"):
        cases.append(tmp_path / f"{what}{path.suffix}")
    cases[1].touch()
    os.truncate(cases[1], SPARSE)
    cases[2].mkdir()
    cases[3].symlink_to(cases[3])
    os.mkfifo(cases[4])
    for case in cases:
        with pytest.raises(SceneError) as raised:
            read(case)
        assert case.name in str(raised.value)


@pytest.mark.parametrize(
    "suffix",
    [".inp", ".npz",
     *(pytest.param(s, marks=pytest.mark.slow) for s in (*FOREIGN, *SURFACES) if s != ".inp")],
)  # fmt: skip
def test_the_command_leaves_nothing_of_a_body_that_cannot_be_read(
    suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / f"Gewebe é{suffix}"
    path.write_bytes(b"\x89MCAP0\r\n" * 40)
    (tmp_path / "b.npz").write_bytes(b"old")
    assert run(["body", str(path), "--unit", "mm", "-o", str(tmp_path / "b.npz"), "--force"]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"validate: Gewebe é{suffix}: ")
    assert said.count("\n") == 1
    assert (tmp_path / "b.npz").read_bytes() == b"old"
    assert len(list(tmp_path.iterdir())) == 2


def test_a_bomb_of_npz_is_refused_before_it_is_unpacked(tmp_path: Path) -> None:
    path = tmp_path / "bomb.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("nodes.npy", bytes(4 * MAX_BYTES))
    assert path.stat().st_size < MAX_BYTES / 100
    with pytest.raises(SceneError, match=r"bomb\.npz: 256\d+ bytes .* 64000000"):
        read_mesh(path)


@pytest.mark.slow
def test_a_bomb_of_vtu_is_refused_in_the_memory_of_its_file(tmp_path: Path) -> None:
    """256 MB of zeros behind a head of zlib that declares them: the children's peak tells."""
    path = tmp_path / "bomb.vtu"
    MAKE["x.vtu"](path)
    text, block, count = path.read_text(), 2**24, 16
    packed = zlib.compress(bytes(block), 9)
    head = np.array([count, block, block, *[len(packed)] * count], np.uint32).tobytes()
    whole = base64.b64encode(head) + base64.b64encode(packed * count)
    first = re.search(r"(<Points>.*?<DataArray[^>]*>)(.*?)(</DataArray>)", text, re.DOTALL)
    assert first is not None
    path.write_text(text[: first.start(2)] + whole.decode() + text[first.end(2) :])
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    with pytest.raises(SceneError, match=r"bomb\.vtu: "):
        read(path)
    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss < before + 150_000  # kB


@pytest.mark.parametrize(("old", "new"), [("10, 0.0", "10, nan"), ("10, 0.0", "10, 1e400")])
def test_a_place_that_is_no_number_is_one_line(old: str, new: str, tmp_path: Path) -> None:
    path = tmp_path / "x.inp"
    text = inp(body("tet4"))
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(SceneError, match=r"^x\.inp: "):
        read_foreign(path, "mm")


def test_a_wrong_suffix_is_named_with_what_is_read(tmp_path: Path) -> None:
    (tmp_path / "x.step").write_text("ISO-10303-21;")
    done = CliRunner().invoke(cli, ["body", str(tmp_path / "x.step"), "--unit", "mm"])
    assert "this format is not read; expected npz, .inp" in str(done.exception)
