"""A mesh file's body filled anew with larger cells: its volume, its sets, and what it bounds."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from validate.errors import SceneError
from validate.fem.system import Responses, build
from validate.scene.geometries import refinement
from validate.scene.geometries.box import box, grid
from validate.scene.geometries.refinement import _filling, coarser, size_against
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.scene import Drive, Scene, Support

# private: _filling: a cache, emptied as by a new process.

SIZE = (0.03, 0.02, 0.02)


def area(mesh: Mesh, name: str) -> float:
    x = mesh.nodes[mesh.facets[name]]
    return float(np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1).sum() / 2)


@pytest.mark.parametrize(
    "fine",
    [
        pytest.param(box(SIZE, (9, 6, 6)), id="tetrahedra"),
        pytest.param(grid(SIZE, (12, 8, 8)), id="hexahedra", marks=pytest.mark.slow),
    ],
)
def test_it_is_the_same_body_with_fewer_nodes_and_its_sets(fine: Mesh) -> None:
    corner = {"corner": fine.facets["x1"][:1]}
    inside = {"inside": fine.cells[len(fine.cells) // 2][None, : fine.facets["x1"].shape[1]]}
    fine = replace(fine, facets={**fine.facets, **corner, **inside})
    coarse = coarser(fine)
    assert coarse.kind == "tet4"
    assert 1.2 < size_against(fine, coarse) < 3
    assert len(coarser(fine, 2).nodes) < len(coarse.nodes)
    assert coarse.cell_volumes().sum() == pytest.approx(np.prod(SIZE), rel=5e-3)
    for axis, (name, other) in enumerate((("x0", "x1"), ("y0", "y1"), ("z0", "z1"))):
        for side, at in ((name, 0.0), (other, SIZE[axis])):
            assert coarse.nodes[coarse.facet_nodes(side)][:, axis] == pytest.approx(at, abs=4e-4)
            assert area(coarse, side) == pytest.approx(np.prod(SIZE) / SIZE[axis], rel=0.02)
    assert len(coarse.facets["corner"]) >= 1
    assert "inside" not in coarse.facets


@pytest.mark.slow
def test_a_cavity_stays_a_cavity() -> None:
    """A block without its middle cells: the wall is a set, and what it encloses is missing."""
    whole = grid((0.03, 0.03, 0.03), (9, 9, 9))
    middle = whole.nodes[whole.cells].mean(axis=1)
    kept = np.abs(middle - 0.015).max(axis=1) > 0.005
    hollow = Mesh(whole.nodes, whole.cells[kept], "hex8", {})
    used, cells = np.unique(hollow.cells, return_inverse=True)
    hollow = Mesh(hollow.nodes[used], cells.reshape(hollow.cells.shape), "hex8", {})
    x = hollow.nodes[hollow.surface].mean(axis=1)
    wall = hollow.surface[np.abs(x - 0.015).max(axis=1) < 0.006]
    coarse = coarser(replace(hollow, facets={"wall": wall}))
    assert coarse.cell_volumes().sum() == pytest.approx(0.03**3 - 0.01**3, rel=0.01)
    at = coarse.nodes[coarse.facet_nodes("wall")] - 0.015
    assert np.abs(at).max(axis=1) == pytest.approx(0.005, abs=6e-4)


@pytest.mark.slow
def test_its_answer_bounds_the_error_of_the_own_mesh() -> None:
    """Stiffness between bonded plates: half the cells lie within the bound of two sizes."""

    def stiffness(mesh: Mesh) -> float:
        scene = Scene(
            mesh, Material(1e4, 0.45), (Support("x0"), Support("x1", (1, 2))),
            drives=(Drive("press", "x1", (-1.0, 0.0, 0.0)),), dilatation="nodal_mean",
        )  # fmt: skip
        return float(Responses.of(build(scene)).reactions[0, 0])

    own, finest = box(SIZE, (12, 8, 8)), box(SIZE, (24, 16, 16))
    coarse = coarser(own)
    ratio = size_against(own, coarse)
    bound = 3 * abs(stiffness(coarse) - stiffness(own)) / (ratio**1.19 - 1)
    assert abs(stiffness(finest) - stiffness(own)) < bound


def test_one_filling_of_a_surface_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each filling here is another mesh, as those of the library are."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    others = iter((3, 4))

    def filling(*_: object) -> SimpleNamespace:
        return SimpleNamespace(mesh=box(SIZE, (next(others), 2, 2)))

    monkeypatch.setattr(refinement, "filled", filling)
    mesh = box(SIZE, (6, 4, 4))
    _filling.cache_clear()
    first = coarser(mesh)
    _filling.cache_clear()
    assert np.array_equal(coarser(mesh).nodes, first.nodes)
    (kept,) = (tmp_path / "validate" / "fillings").iterdir()
    kept.write_bytes(b"damaged")
    _filling.cache_clear()
    assert len(coarser(mesh).nodes) > len(first.nodes)
    _filling.cache_clear()


def test_what_has_no_coarser_filling_is_refused() -> None:
    with pytest.raises(SceneError, match="only bodies in 3-D are filled anew"):
        coarser(box((0.1, 0.1), (4, 4)))
    with pytest.raises(SceneError, match="8 nodes: too few"):
        coarser(box((0.1, 0.1, 0.1), (1, 1, 1)))
