"""Surfaces to look at: all of the boundary, or fewer triangles between nodes of it."""

import numpy as np
import pytest
from phantoms import COARSE_GRID, phantom_mesh, phantom_scene
from report_samples import scene as cube_scene

from validate.report.scenes.body import SurfacePart, skins
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.scene import Scene


def edges(skin: SurfacePart) -> dict[tuple[int, int], int]:
    found: dict[tuple[int, int], int] = {}
    for a, b, c in skin.triangles.tolist():
        for edge in ((a, b), (b, c), (c, a)):
            key = (min(edge), max(edge))
            found[key] = found.get(key, 0) + 1
    return found


@pytest.mark.parametrize("order", [1, 2])
def test_whole_surfaces_are_closed(order: int) -> None:
    mesh = phantom_mesh(COARSE_GRID, order)
    outside, wall = skins(phantom_scene(mesh), 10**6)
    assert len(wall.triangles) == (1 if order == 1 else 4) * len(mesh.facets["cavity"])
    assert set(edges(outside).values()) == set(edges(wall).values()) == {2}
    assert not set(outside.nodes) & set(wall.nodes)
    assert set(wall.nodes) == set(mesh.facets["cavity"].ravel())


def test_the_cubes_area() -> None:
    (outside,) = skins(cube_scene(), 10**6)
    corners = cube_scene().mesh.nodes[outside.nodes][outside.triangles]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert 0.5 * np.linalg.norm(cross, axis=1).sum() == pytest.approx(6 * 0.02**2)


@pytest.mark.parametrize("most", [600, 200, 100])
def test_thinned(most: int) -> None:
    mesh = phantom_mesh()
    whole = skins(phantom_scene(mesh), 10**6)
    thin = skins(phantom_scene(mesh), most)
    assert 0.15 * most < sum(len(s.triangles) for s in thin) <= most
    for w, t in zip(whole, thin, strict=True):
        assert t.whole == len(w.triangles)
        assert set(t.nodes) <= set(w.nodes)
        size = np.ptp(mesh.nodes[w.nodes], axis=0)
        assert (np.ptp(mesh.nodes[t.nodes], axis=0) > 0.4 * size).all()
        a, b, c = t.triangles.T
        assert ((a != b) & (b != c) & (a != c)).all()


def test_a_planar_mesh_has_none() -> None:
    nodes = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    mesh = Mesh(nodes, np.array([[0, 1, 2]]), "tri3")
    assert skins(Scene(mesh, Material(1e4, 0.4)), 100) == ()
