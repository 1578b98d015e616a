"""Mesh files: what is written is read; damage is one line; the shipped meshes are as they say."""

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from validate.errors import SceneError
from validate.scene.geometries.box import box
from validate.scene.mesh import Mesh, boundary_facets
from validate.scene.mesh_files import mesh_file
from validate.scene.mesh_files.mesh_file import read_mesh, write_mesh

BOX = box((0.1, 0.2, 0.3), (1, 2, 3))


@pytest.mark.parametrize("mesh", [BOX, BOX.quadratic(), box((1.0, 1.0), (2, 2))])
def test_what_is_written_is_read(tmp_path: Path, mesh: Mesh) -> None:
    write_mesh(mesh, tmp_path / "m.npz", "made here")
    read = read_mesh(tmp_path / "m.npz")
    assert read.kind == mesh.kind
    assert np.array_equal(read.nodes, mesh.nodes)
    assert np.array_equal(read.cells, mesh.cells)
    assert read.facets.keys() == mesh.facets.keys()
    assert all(np.array_equal(read.facets[k], mesh.facets[k]) for k in mesh.facets)
    with np.load(tmp_path / "m.npz", allow_pickle=False) as file:
        assert str(file["provenance"]) == "made here"
        assert file["cells"].dtype == np.int32


def _written(path: Path, **changes: NDArray[Any] | None) -> Path:
    arrays: dict[str, NDArray[Any]] = {
        "kind": np.array("tet4"), "nodes": BOX.nodes, "cells": BOX.cells,
        "facets.x0": BOX.facets["x0"],
    }  # fmt: skip
    for name, value in changes.items():
        key = name.replace("_", ".")
        if value is None:
            del arrays[key]
        else:
            arrays[key] = value
    with path.open("wb") as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]
    return path


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"nodes": None}, r"no \['nodes'\] among its arrays .*; write them: np.savez\(FILE, kind="),
        ({"kind": np.array("hex20")}, "kind 'hex20': one of tri3, tri6, tet4, tet10, quad4"),
        ({"kind": np.array("tet10")}, r"cells: shape \(36, 4\), expected \(any, 10\)"),
        ({"kind": np.array(3)}, "kind '3'"),
        ({"nodes": np.full(BOX.nodes.shape, np.nan)}, "72 of 72 values not finite"),
        ({"nodes": BOX.cells}, "'nodes' holds int64, expected floats"),
        ({"cells": BOX.cells + 1}, r"cells: entries 1..24 outside 0..23"),
        ({"cells": BOX.cells + 0.5}, "'cells' holds float64, expected integers"),
        ({"facets_x0": BOX.facets["x0"] - 50}, "facets 'x0': entries"),
        ({"facets_x0": np.array(["a"])}, "'x0' holds <U1, expected integers"),
        ({"cells": BOX.cells[:, [1, 0, 2, 3]]}, "36 of 36 elements inverted"),
        ({"nodes": np.array([{}])}, "damaged"),
    ],
)
def test_files_that_are_no_meshes_are_refused(
    tmp_path: Path, changes: dict[str, NDArray[Any] | None], words: str
) -> None:
    with pytest.raises(SceneError, match=words) as caught:
        read_mesh(_written(tmp_path / "m.npz", **changes))
    assert str(caught.value).startswith("m.npz: ")
    assert "\n" not in str(caught.value)


def test_damage_anywhere_is_one_line_or_nothing_at_all(tmp_path: Path) -> None:
    """Every 13th byte flipped, cut at every 29th: never another mesh, never a crash."""
    path = tmp_path / "m.npz"
    write_mesh(BOX, path, "note")
    whole = path.read_bytes()
    spoilt = [
        whole[:i] + bytes([whole[i] ^ 255]) + whole[i + 1 :] for i in range(0, len(whole), 13)
    ]
    spoilt += [whole[:i] for i in range(0, len(whole) - 1, 29)]
    refused = 0
    for data in spoilt:
        path.write_bytes(data)
        try:
            read = read_mesh(path)
        except SceneError:
            refused += 1
        else:  # the flipped byte was in the padding of a header, or in a time stamp
            assert np.array_equal(read.nodes, BOX.nodes)
            assert np.array_equal(read.cells, BOX.cells)
    assert refused > 0.6 * len(spoilt)


def test_sizes_are_bounded_before_memory_is_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "bomb.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("nodes.npy", bytes(65_000_000))
    assert path.stat().st_size < 100_000
    with pytest.raises(SceneError, match=r"bomb\.npz: 65000000 bytes"):
        read_mesh(path)
    monkeypatch.setattr(mesh_file, "MAX_BYTES", 1000)
    with pytest.raises(SceneError, match="the limit of a mesh file is 1000"):
        write_mesh(BOX, path)


def test_missing_files_are_one_line(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"no\.npz: cannot be read \(No such file"):
        read_mesh(tmp_path / "no.npz")
    with pytest.raises(SceneError, match="cannot be read"):
        read_mesh(tmp_path)


@pytest.mark.parametrize(
    ("name", "nodes", "tets", "volume"),
    [
        ("cube", 839, 3760, 1e-3),
        ("cone", 559, 2349, np.pi * 0.028 / 3 * (0.034**2 + 0.034 * 0.029 + 0.029**2)),
    ],
)
def test_the_shipped_meshes_are_near_the_printed_counts(
    project_root: Path, name: str, nodes: int, tets: int, volume: float
) -> None:
    """Paper 003 prints the counts; the cone's polygon loses some of the volume."""
    path = project_root / "experiments" / "meshes" / f"{name}.npz"
    mesh = read_mesh(path)
    assert path.stat().st_size < 200_000
    assert len(mesh.nodes) == pytest.approx(nodes, rel=0.01)
    assert len(mesh.cells) == pytest.approx(tets, rel=0.01)
    lost = 1 - mesh.cell_volumes().sum() / volume
    assert -1e-12 < lost < (1e-12 if name == "cube" else 0.015)
    assert len(boundary_facets(mesh.cells, 3)) == sum(len(f) for f in mesh.facets.values())
    assert len(np.unique(mesh.cells)) == len(mesh.nodes)
    assert mesh.cell_volumes().min() > 0.1 * mesh.cell_volumes().mean()


def test_the_shipped_meshes_have_the_nodes_that_are_watched(project_root: Path) -> None:
    folder = project_root / "experiments" / "meshes"
    wanted = {
        "cube": {"x0": (0, 0.05, 0.05), "z1": (0.05, 0.05, 0.1)},
        "cone": {"top": (0, 0, 0.028), "side": (0.0315, 0, 0.014), "bottom": (0, -0.034, 0)},
    }
    for name, places in wanted.items():
        mesh = read_mesh(folder / f"{name}.npz")
        for facets, place in places.items():
            node = mesh.nearest_node(np.array(place))
            assert mesh.nodes[node] == pytest.approx(place, abs=1e-12)
            assert node in mesh.facet_nodes(facets)
    cone = read_mesh(folder / "cone.npz")
    assert np.abs(cone.nodes[cone.facet_nodes("bottom"), 2]).max() == 0
    assert np.unique(cone.nodes[cone.facet_nodes("top"), 2]).tolist() == [0.028]
    side = cone.nodes[cone.facet_nodes("side")]
    assert np.hypot(*side[:, :2].T) == pytest.approx(0.034 - side[:, 2] * 5 / 28, abs=1e-9)
