"""E_s, its shell check, surface distances and what is refused before they are taken."""

import numpy as np
import pytest
from phantoms import grid_mesh

from experiments.fluid_phantom.square_hole import square_with_hole
from validate.arrays import Floats
from validate.compare.shapes.pair import (
    Boundary,
    Field,
    Soundness,
    crossings,
    deformed_boundary,
    enclosed,
    inverted_cells,
    outline_boundary,
    pair,
    require_comparable,
)
from validate.compare.shapes.shape_error import (
    Boundaries,
    _beyond_booleans,
    distances,
    hausdorff,
    mean_absolute,
    mean_surface_distance,
    polygon,
    shell_error,
    surface_error,
    symmetric_difference,
)
from validate.compare.shapes.two_fields import FieldScores, compared
from validate.errors import ComparisonError
from validate.scene.geometries.box import box, grid
from validate.scene.mesh import Mesh

# private: _beyond_booleans: says which of two methods the public call took.

PLANE, SOLID = ((1.0, 0.8), (6, 5)), ((1.0, 0.8, 0.6), (4, 3, 3))
MESHES = {
    "tri3": box(*PLANE),
    "tri6": box(*PLANE).quadratic(),
    "quad4": grid(*PLANE),
    "tet4": box(*SOLID),
    "tet10": box(*SOLID).quadratic(),
    "hex8": grid(*SOLID),
    "hex27": grid(*SOLID).quadratic(),
    "hole": square_with_hole(1.0, 0.2, 5),
}


@pytest.fixture(params=MESHES, name="mesh")
def _mesh(request: pytest.FixtureRequest) -> Mesh:
    return MESHES[request.param]


def still(mesh: Mesh) -> Field:
    return Field(mesh, np.zeros(mesh.nodes.shape), "reference")


def along_x(mesh: Mesh, moved: Floats) -> Field:
    u = np.zeros(mesh.nodes.shape)
    u[:, 0] = moved
    return Field(mesh, u, "run")


def test_boundaries_enclose_what_the_cells_fill(mesh: Mesh) -> None:
    """Also deformed, where bilinear facets are no planes: the volume is that of the Jacobians."""
    assert enclosed(still(mesh).boundary) == pytest.approx(mesh.cell_volumes().sum(), rel=1e-13)
    bent = 0.03 * np.sin(4 * mesh.nodes[:, ::-1]) * np.sin(5 * mesh.nodes).prod(axis=1)[:, None]
    if mesh.order == 1:
        moved = Mesh(mesh.nodes + bent, mesh.cells, mesh.kind)
        assert enclosed(deformed_boundary(mesh, moved.nodes)) == pytest.approx(
            moved.cell_volumes().sum(), rel=1e-13
        )


def test_a_stretch_by_hand(mesh: Mesh) -> None:
    """x grows by a tenth: the rest body lies within, E_s = 0.1 and the far side moves 0.1 L."""
    x = mesh.nodes[:, 0] - mesh.nodes[:, 0].min()
    between = pair(along_x(mesh, 0.1 * x), still(mesh))
    if mesh is not MESHES["hole"]:
        assert surface_error(between) == pytest.approx(0.1, rel=1e-12)
        assert hausdorff(between.one.boundary, between.other.boundary) == pytest.approx(
            0.1, rel=1e-12
        )
        assert shell_error(between) == pytest.approx(0.1, rel=1e-12)
    swapped = surface_error(between.swapped) * 1.1
    assert surface_error(between) == pytest.approx(swapped, rel=1e-12)


def test_a_hole_counts_on_both_of_its_sides() -> None:
    """A square of 1 m with a hole of .2 m, shifted by .01 m: 2 (1 + .2) .01 of .96 m2."""
    mesh = MESHES["hole"]
    between = pair(along_x(mesh, np.full(len(mesh.nodes), 0.01)), still(mesh))
    assert surface_error(between) == pytest.approx(0.024 / 0.96, rel=1e-12)
    assert shell_error(between) == pytest.approx(0.024 / 0.96, rel=1e-12)


def test_a_cavity_counts_on_its_wall_too() -> None:
    """A cube of 5 m, a cube of 1 m cut out, shifted by .01 m: 2 (25 + 1) .01 of 124 m3."""
    mesh = grid_mesh((6, 6, 6), (5.0, 5.0, 5.0), ((slice(2, 3),) * 3,))
    between = pair(along_x(mesh, np.full(len(mesh.nodes), 0.01)), still(mesh))
    assert surface_error(between) == pytest.approx(0.52 / 124, rel=1e-10)
    assert shell_error(between) == pytest.approx(0.52 / 124, rel=1e-10)


@pytest.mark.parametrize("size", [1e-3, 1e-5, 1e-8, 1e-10])
def test_shell_and_boolean_agree_to_first_order(mesh: Mesh, size: float) -> None:
    reference = 0.03 * np.sin(3 * mesh.nodes[:, ::-1])
    run = Field(mesh, reference + size * np.cos(5 * mesh.nodes[:, ::-1] + 1), "run")
    between = pair(run, Field(mesh, reference, "reference"))
    boolean = symmetric_difference(run.boundary, between.other.boundary) / enclosed(
        between.other.boundary
    )
    share = max(10 * size, 1e-14 / size, 2e-2 * (size < 1e-9))
    assert boolean == pytest.approx(shell_error(between), rel=share, abs=0)
    resolved = size > 1e-9 or mesh.dimension == 2
    expected = boolean if resolved else shell_error(between)
    assert surface_error(between) == pytest.approx(expected, rel=1e-13, abs=0)


@pytest.mark.parametrize("corners", [2, 3])
def test_the_mean_of_a_linear_function_s_size_is_exact(corners: int) -> None:
    """Against a fine midpoint sum; also zeros and one sign."""
    values = np.vstack([np.random.default_rng(2).normal(size=(40, corners)), np.eye(corners)])
    values = np.vstack([values, -np.abs(values[:5]), np.zeros((1, corners))])
    s = (np.arange(400) + 0.5) / 400
    if corners == 2:
        L = np.stack([1 - s, s], axis=1)
    else:
        a, b = (g.ravel() for g in np.meshgrid(s, s))
        a, b = np.where(a + b > 1, 1 - a, a), np.where(a + b > 1, 1 - b, b)
        L = np.stack([1 - a - b, a, b], axis=1)
    assert mean_absolute(values) == pytest.approx(np.abs(values @ L.T).mean(axis=1), abs=2e-4)


def test_an_inside_out_mesh_is_refused() -> None:
    turned = MESHES["tet4"].cells[:, [0, 2, 1, 3]]
    mesh = Mesh(MESHES["tet4"].nodes, turned, "tet4")
    with pytest.raises(ComparisonError, match="216 of 216 cells"):
        still(mesh)


@pytest.mark.slow
def test_a_run_turned_inside_out_is_no_perfect_match(mesh: Mesh) -> None:
    """x -> -x: the booleans would call it empty and the error 0."""
    found = compared(pair(along_x(mesh, -2 * mesh.nodes[:, 0]), still(mesh)))
    scores = {s.name: s for s in found.scores}
    assert scores["inverted"].value == scores["inverted"].count == len(mesh.cells)
    assert scores["inverted.reference"].value == 0
    assert scores["E_i.mean"].value > 0
    assert "run is turned inside out" in dict(found.refused)["E_s"]


def test_an_inverted_cell_is_named(mesh: Mesh) -> None:
    """One inner vertex pulled through its neighbours inverts some cells round it and no other."""
    inner = int(np.argmin(np.linalg.norm(mesh.nodes - mesh.nodes.mean(axis=0) - 0.01, axis=1)))
    u = np.zeros(mesh.nodes.shape)
    u[inner] = 0.5
    wrong = inverted_cells(mesh, u)
    around = np.flatnonzero((mesh.cells == inner).any(axis=1))
    assert 0 < len(wrong) <= len(around)
    assert np.isin(wrong, around).all()


@pytest.mark.slow
@pytest.mark.parametrize("make", [box, grid])
@pytest.mark.parametrize("d", [2, 3])
def test_a_strip_wound_over_itself_crosses_without_inverted_cells(d: int, make) -> None:  # type: ignore[no-untyped-def]
    """A ring of 7 rad covers its own start; at 6 rad it does not."""
    mesh = make((1.0, 0.1, 0.1)[:d], (30, 1, 1)[:d])
    for angle, crosses in ((6.0, False), (7.0, True)):
        turn, radius = angle * mesh.nodes[:, 0], 0.5 - mesh.nodes[:, 1]
        places = mesh.nodes.copy()
        places[:, 0], places[:, 1] = radius * np.sin(turn), -radius * np.cos(turn)
        found = compared(pair(Field(mesh, places - mesh.nodes, "run"), still(mesh)))
        scores = {s.name: s.value for s in found.scores}
        assert scores["inverted"] == 0
        assert (scores["crossings"] > 0) is crosses
        assert ("E_s" in scores) is not crosses
        if crosses:
            assert "crosses itself" in dict(found.refused)["E_s"]


@pytest.mark.parametrize("turned", [False, True])
def test_a_needle_through_a_triangle_is_one_crossing_a_side(turned: bool) -> None:
    """Two of a needle's triangles pass through a plate, whichever comes first; a third shares no
    edge with it; a needle that ends at the plate does not cross."""
    plate = np.array([[-5.0, -5.0, 0.0], [5.0, -5.0, 0.0], [0.0, 9.0, 0.0]])
    needle = np.array([[0.0, 0.0, -1.0], [0.1, 0.0, 1.0], [0.0, 0.1, 1.0], [0.1, 0.1, 1.0]])
    pieces = np.array([[0, 1, 2], [3, 4, 5], [3, 5, 6], [4, 6, 5]])
    pieces = pieces[::-1] if turned else pieces
    assert crossings(Boundary(np.vstack([plate, needle]), pieces)) == 2
    assert crossings(Boundary(np.vstack([plate, needle + [0.0, 0.0, 1.0]]), pieces)) == 0


def test_distances_to_a_box_are_exact() -> None:
    """The distance to the sides of a box in closed form, inside and outside."""
    boundary = still(MESHES["tet4"]).boundary
    points = np.random.default_rng(4).uniform(-0.5, 1.5, size=(300, 3))
    half = np.array([0.5, 0.4, 0.3])
    away = np.abs(points - half) - half
    outside = np.linalg.norm(np.maximum(away, 0), axis=1)
    exact = np.where(away.max(axis=1) > 0, outside, -away.max(axis=1))
    assert distances(points, boundary) == pytest.approx(exact, rel=1e-12, abs=1e-15)


def test_the_mean_distance_by_hand() -> None:
    """A square of side 1, its right side moved by s = 0.01 m.

    Run to reference (s + s^2)/(4 + 2 s), reference to run (s - s^2)/4.
    """
    mesh, s = grid((1.0, 1.0), (200, 200)), 0.01
    between = pair(along_x(mesh, s * mesh.nodes[:, 0]), still(mesh))
    exact = ((s + s**2) / (4 + 2 * s) + (s - s**2) / 4) / 2
    assert mean_surface_distance(between.one.boundary, between.other.boundary) == pytest.approx(
        exact, rel=1e-3
    )


def test_an_outline_against_a_recorded_one() -> None:
    """Squares of 20 and 22 mm about one centre; the sense of an outline does not matter."""
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    run, seen = outline_boundary(0.011 * square), outline_boundary(0.010 * square[::-1])
    found = {s.name: s for s in Boundaries(run, seen, "recorded").scores("cyst")}
    assert found["cyst.E_s"].value == pytest.approx(0.21, rel=1e-12)
    assert found["cyst.hausdorff"].value == pytest.approx(1e-3 * np.sqrt(2), rel=1e-12)
    assert all(s.count == 8 and s.against == "recorded" for s in found.values())
    bow = outline_boundary(0.01 * square[[0, 2, 1, 3]] * [1.0, 1.3] + [0, 1e-3])
    with pytest.raises(ComparisonError, match="crosses itself"):
        Boundaries(bow, seen, "recorded")
    with pytest.raises(ComparisonError, match="2 points encloses nothing"):
        outline_boundary(square[:2])


def test_an_open_boundary_is_no_body() -> None:
    closed = still(MESHES["tet4"]).boundary
    with pytest.raises(ComparisonError, match="encloses no solid"):
        symmetric_difference(Boundary(closed.points, closed.pieces[1:]), closed)


def test_bodies_on_different_meshes_keep_their_own_boundary() -> None:
    """A quarter circle arc by 4 and by 64 chords: E_s is the area between the polygons."""
    coarse, fine = grid((1.0, 1.0), (4, 1)), grid((1.0, 1.0), (64, 1))

    def rolled(mesh: Mesh) -> Floats:
        turn, radius = np.pi / 2 * mesh.nodes[:, 0], 2.0 - mesh.nodes[:, 1]
        return np.stack([radius * np.sin(turn), -radius * np.cos(turn)], axis=1)

    one, other = (Field(m, rolled(m) - m.nodes, f"{len(m.cells)}") for m in (coarse, fine))
    area = lambda n: 3 * n * np.sin(np.pi / 2 / n) / 2  # noqa: E731
    # Chords inside both arcs: outer slivers are lost, inner slivers gained.
    between = (4 + 1) / 2 * (64 * np.sin(np.pi / 128) - 4 * np.sin(np.pi / 8))
    found = {s.name: s.value for s in FieldScores.of(one, other).whole()}
    assert found["E_s"] == pytest.approx(between / area(64), rel=1e-10)


def test_a_curve_that_crosses_itself_encloses_no_plane_body() -> None:
    """Two lobes of 1.5 and 0.5 m2: the signed area is their difference, 1 m2."""
    points = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [2.0, 2.0], [2.0, 3.0]])
    with pytest.raises(ComparisonError, match=r"5 segments.*\(Self-inters"):
        polygon(outline_boundary(points))


def test_a_boundary_that_touches_itself_is_no_outline() -> None:
    points = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [-1.0, 0.0], [-1.0, -1.0]])
    pieces = np.array([[0, 1], [1, 2], [2, 0], [0, 3], [3, 4], [4, 0]])
    with pytest.raises(ComparisonError, match="touches itself in 1 nodes, so"):
        polygon(Boundary(points, pieces))


@pytest.mark.parametrize(
    ("volume", "crossings", "says"),
    [
        (-0.5, 0, r"run is turned inside out \(signed volume -0.5; 2 of 9 cells are inverted\)"),
        (0.0, 3, r"run is turned inside out \(signed volume 0;"),
        (0.5, 3, r"boundary of run crosses itself in 3 places \(2 of 9 cells are inverted\)"),
    ],
)
def test_a_body_without_an_interior_is_refused(volume: float, crossings: int, says: str) -> None:
    with pytest.raises(ComparisonError, match=says):
        require_comparable(Soundness(np.array([1, 4]), 9, volume, crossings), "run")


@pytest.mark.parametrize("finer", [False, True])
def test_two_equal_solids_differ_by_nothing_on_a_third_mesh(finer: bool) -> None:
    """Carried onto another mesh than their own, they are compared by their booleans."""
    mesh, third = box((1.0, 1.0, 1.0), (2, 2, 2)), box((1.0, 1.0, 1.0), (3, 3, 3))
    one, other = (Field(mesh, np.zeros_like(mesh.nodes), name) for name in ("a", "b"))
    found = pair(one, other, third if finer else mesh)
    assert _beyond_booleans(found) != finer
    assert surface_error(found) == pytest.approx(0.0, abs=1e-12)
