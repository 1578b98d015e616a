"""Choices of faces, edges and points: counts on blocks, composition, finer meshes, empty ones."""

from dataclasses import replace

import numpy as np
import pytest

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.assembly.assemble import uniform_shares
from validate.fem.system import build
from validate.scene.geometries.box import box, grid
from validate.scene.geometries.refinement import refined
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.places import InBox, Labelled, Nearest, OnPlane, Site, facets_of, nodes_of
from validate.scene.scene import Foundation, Load, Mass, Scene, Support

SIZE = (0.03, 0.02, 0.01)
X, Z = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
FRONT, TOP = OnPlane(SIZE, X), OnPlane(SIZE, (0.0, 0.0, 2.0))
MESHES = {
    "tet4": box(SIZE, (3, 2, 2)),
    "tet10": box(SIZE, (3, 2, 2)).quadratic(),
    "hex8": grid(SIZE, (3, 2, 2)),
    "hex27": grid(SIZE, (3, 2, 2)).quadratic(),
}


@pytest.mark.parametrize("kind", MESHES)
def test_a_plane_chooses_the_facets_that_the_mesh_names(kind: str) -> None:
    mesh = MESHES[kind]
    named = np.sort(mesh.facets["x1"], axis=1)
    for rule in (FRONT, Labelled("x1"), InBox((0.03, 0.0, 0.0), SIZE)):
        chosen = np.sort(rule.faces.entities(mesh), axis=1)
        assert chosen[np.lexsort(chosen.T)].tolist() == named[np.lexsort(named.T)].tolist()
        assert nodes_of(mesh, rule.points).tolist() == mesh.facet_nodes("x1").tolist()


@pytest.mark.parametrize("kind", MESHES)
def test_two_planes_meet_in_an_edge(kind: str) -> None:
    mesh = MESHES[kind]
    edge = (FRONT & TOP).edges
    found = edge.entities(mesh)
    assert found.shape == (2, 3 if kind in ("tet10", "hex27") else 2)
    assert mesh.nodes[found][..., [0, 2]] == pytest.approx(np.full((*found.shape, 2), [0.03, 0.01]))
    lengths = uniform_shares(mesh, edge)
    assert lengths.sum() == pytest.approx(1.0, rel=1e-14)
    ends = np.abs(mesh.nodes[:, 1] - 0.01) > 0.009
    inner = {"tet4": 0.25, "hex8": 0.25, "tet10": 1 / 12, "hex27": 1 / 12}[kind]
    assert lengths[nodes_of(mesh, edge)][ends[nodes_of(mesh, edge)]] == pytest.approx(inner)


def test_rules_combine_by_facet_not_by_node() -> None:
    """A facet of the third side with its corners on both planes is on neither."""
    mesh = MESHES["tet4"]
    count = len(mesh.facets["x1"]) + len(mesh.facets["z1"])
    assert len((FRONT | TOP).faces.entities(mesh)) == count
    assert len((Labelled("x1") | Labelled("z1")).faces.entities(mesh)) == count
    every = OnPlane(SIZE, X, tolerance=1.0)
    rest = (every - FRONT - TOP).faces.entities(mesh)
    assert len(rest) == len(mesh.surface) - count
    both = (Labelled("x1") & Labelled("z1")).edges.entities(mesh)
    assert len(both) == len((FRONT & TOP).edges.entities(mesh)) == 2


@pytest.mark.parametrize("kind", MESHES)
def test_the_nearest_is_one(kind: str) -> None:
    mesh = MESHES[kind]
    (node,) = nodes_of(mesh, Nearest((0.031, 0.019, 0.011)).points)
    assert mesh.nodes[node] == pytest.approx(SIZE)
    assert len(Nearest((0.015, 0.01, 0.01)).edges.entities(mesh)) == 1  # of many as near


@pytest.mark.parametrize("kind", MESHES)
def test_the_surface_encloses_the_body(kind: str) -> None:
    """Its facets have the mesh's, middles included, and their areas add up."""
    mesh = MESHES[kind]
    named = {tuple(f) for name in mesh.facets for f in np.sort(mesh.facets[name], 1).tolist()}
    assert {tuple(f) for f in np.sort(mesh.surface, axis=1).tolist()} == named


def test_in_two_dimensions_edges_are_the_facets() -> None:
    mesh = box((0.02, 0.01), (4, 2))
    side = OnPlane((0.02, 0.0), (1.0, 0.0))
    assert side.faces.entities(mesh).tolist() == mesh.facets["x1"].tolist()
    assert side.edges.entities(mesh).tolist() == mesh.facets["x1"].tolist()


def loaded(mesh: Mesh) -> Scene:
    return Scene(
        mesh,
        Material(1e4, 0.3, rho=1000.0),
        (Support(OnPlane((0.0, 0.0, 0.0), X).faces, (0, 1, 2)),),
        loads=(Load("pull", (FRONT & TOP).edges, Z),),
    )


def moved(scene: Scene) -> Floats:
    system = build(scene)
    return system.factor().solve(system.loads[system.free, 0])


def test_a_choice_holds_on_a_finer_mesh() -> None:
    """The parts stay as they are; held and loaded are the new mesh's nodes."""
    scene = loaded(MESHES["tet4"])
    fine = refined(scene)
    assert len(nodes_of(fine.mesh, fine.loads[0].facets)) == 5
    assert build(fine).loads[:, 0].sum() == pytest.approx(1.0)


def test_a_choice_is_the_facet_set_to_every_digit() -> None:
    mesh = MESHES["tet10"]
    scene = replace(loaded(mesh), loads=(Load("pull", "x1", Z),))
    by_name = replace(scene, supports=(Support("x0", (0, 1, 2)),))
    by_rule = replace(scene, loads=(Load("pull", FRONT.faces, Z),))
    assert moved(by_rule) == pytest.approx(moved(by_name), rel=1e-12)


def test_facets_by_name_and_by_rule() -> None:
    mesh = MESHES["tet4"]
    assert facets_of(mesh, "x1") is mesh.facets["x1"]
    with pytest.raises(SceneError, match="no facets 'lid'"):
        facets_of(mesh, "lid")


@pytest.mark.parametrize(
    ("rule", "words"),
    [
        (OnPlane((0.033, 0.0, 0.0), X), r"none of 64 faces .* nearest, at \(30, .* is 3 mm away"),
        (InBox((0.0, 0.0, 0.012), (0.03, 0.02, 0.02)), r"none of 64 faces .* is 2 mm away"),
        (FRONT - FRONT, "none of 64 faces"),
        (OnPlane((0.0, 0.0), X), r"point of a plane: \(0.0, 0.0\), needs 3 finite numbers"),
        (OnPlane((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), "length 0; give a direction"),
        (InBox((1.0, 0.0, 0.0), (0.0, 1.0, 1.0)), "low must not exceed high"),
        (Labelled("lid"), "no facets 'lid'"),
    ],
)
def test_an_empty_choice_says_what_is_nearest(rule: Site, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        Scene(MESHES["tet4"], Material(1e4, 0.3), (Support(rule.faces, (0,)),))


def test_what_covers_an_area_needs_faces() -> None:
    with pytest.raises(SceneError, match="on edges; it needs an area: choose faces"):
        Scene(
            MESHES["tet4"],
            Material(1e4, 0.3),
            foundations=(Foundation((FRONT & TOP).edges, (0,), 1e3),),
        )


def test_a_load_or_mass_that_is_wholly_held_is_refused() -> None:
    scene = loaded(MESHES["tet4"])
    held = replace(scene, loads=(Load("pull", "x0", Z),))
    with pytest.raises(SceneError, match=r"'pull': .* 9 unknowns.*9 nodes.*10 mm"):
        build(held)
    hung = replace(scene, masses=(Mass("weight", OnPlane((0.0, 0.0, 0.0), X).points, 0.1),))
    with pytest.raises(SceneError, match=r"mass 'weight': .* hold all 27 unknowns"):
        build(hung)
    half = replace(scene, supports=(Support("x0", (2,)), Support("x1", (0, 1, 2))))
    with pytest.raises(SceneError, match="load 'pull'"):
        build(half)
    build(replace(half, loads=(Load("pull", "x0", X),)))


@pytest.mark.parametrize("mass", [-1.0, float("nan")])
def test_a_mass_is_not_below_zero(mass: float) -> None:
    with pytest.raises(SceneError, match=r"mass 'weight': .* kg; .* 0 or above"):
        Mass("weight", "x1", mass)
