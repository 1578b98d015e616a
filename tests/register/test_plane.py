"""Sections of the inclusion with an image plane: circles and ellipses of known size."""

import numpy as np
import pytest
from phantoms import CAPSULE, PAPER_GRID, grid_mesh, phantom_mesh
from scipy.spatial.transform import Rotation

from validate.errors import RegistrationError
from validate.register.outlines.sections import (
    SurfaceSampler,
    from_image,
    require_rigid,
    section,
    to_image,
)

CENTRE = np.array(CAPSULE.centre)
FLAT = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # image x, y along x, z; normal along -y


def pose_at(height: float, tilt_deg: float = 0.0) -> np.ndarray:
    """A plane at `height` m over the inclusion's centre, turned about the image's x axis."""
    pose = np.eye(4)
    pose[:3, :3] = FLAT @ Rotation.from_euler("x", tilt_deg, degrees=True).as_matrix()
    pose[:3, 3] = CENTRE + [0, height, 0]
    return pose


def signed_area(outline: np.ndarray) -> float:
    x, y = outline.T
    return float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2)


@pytest.fixture(scope="module")
def wall():
    return SurfaceSampler.of_cavity(phantom_mesh(PAPER_GRID), "cavity", CAPSULE)


@pytest.mark.parametrize("height", [-0.0055, -0.003, 0.0, 0.002, 0.00549, 0.009, -0.012])
def test_level_section_is_a_circle_of_known_radius(wall, height):
    """On the straight part the capsule's own radius, on its caps sqrt(r^2 - h^2)."""
    over = max(abs(height) - 0.0055, 0.0)
    radius = np.sqrt(0.0085**2 - over**2)
    outline = section(wall.rest, wall.triangles, pose_at(height))
    r = np.linalg.norm(outline, axis=1)
    # Samples lie on the capsule, 0.6 mm apart; the chords between them sag up to 0.03 mm.
    assert r.max() < radius + 1e-12
    assert r.min() > radius - 5e-5
    assert signed_area(outline) == pytest.approx(np.pi * radius**2, rel=8e-3)
    assert signed_area(outline) > 0  # counter-clockwise


def test_section_converges_at_second_order():
    errors = []
    for parts in (4, 8, 16):
        wall = SurfaceSampler.of_cavity(phantom_mesh(PAPER_GRID), "cavity", CAPSULE, parts)
        area = signed_area(section(wall.rest, wall.triangles, pose_at(0.002)))
        errors.append(1 - area / (np.pi * 0.0085**2))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.3)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2, abs=0.3)


@pytest.mark.parametrize("tilt", [10.0, -25.0])
def test_tilted_section_of_the_cylinder_is_an_ellipse(wall, tilt):
    outline = section(wall.rest, wall.triangles, pose_at(0.0, tilt))
    long = 0.0085 / np.cos(np.deg2rad(tilt))
    level = (outline[:, 0] / 0.0085) ** 2 + (outline[:, 1] / long) ** 2
    assert level == pytest.approx(1.0, abs=0.012)
    assert signed_area(outline) == pytest.approx(np.pi * 0.0085 * long, rel=8e-3)


def test_facets_as_they_are_give_a_smaller_outline(wall):
    flat = SurfaceSampler.of_cavity(phantom_mesh(PAPER_GRID), "cavity", None)
    areas = [signed_area(section(s.rest, s.triangles, pose_at(0.0))) for s in (flat, wall)]
    assert 0.7 * areas[1] < areas[0] < areas[1]


def test_wall_follows_the_displacement(wall):
    mesh = phantom_mesh(PAPER_GRID)
    G = 0.05 * np.random.default_rng(0).normal(size=(3, 3))
    u = (mesh.nodes - CENTRE) @ G.T + [1e-3, 0, 0]
    flat = SurfaceSampler.of_cavity(mesh, "cavity", None, 3)
    assert flat.deformed(u) == pytest.approx(flat.rest + (flat.rest - CENTRE) @ G.T + [1e-3, 0, 0])
    shifted = np.tile([1e-3, 0.0, -2e-3], (len(mesh.nodes), 1))
    outline = section(wall.deformed(shifted), wall.triangles, pose_at(0.0))
    at_rest = section(wall.rest, wall.triangles, pose_at(0.0))
    moved = [signed_area(outline), *outline.mean(axis=0)]
    still = [signed_area(at_rest), *(at_rest.mean(axis=0) + [1e-3, -2e-3])]
    assert moved == pytest.approx(still, abs=1e-9)


def test_nearest_node_reads_wall_nodes_only():
    mesh = phantom_mesh(PAPER_GRID)
    wall = SurfaceSampler.of_cavity(mesh, "cavity", CAPSULE, 4, nearest=True)
    assert np.isin(wall.rows.weights.indices, mesh.facet_nodes("cavity")).all()
    assert np.array_equal(np.diff(wall.rows.weights.indptr), np.ones(len(wall.rest)))
    assert (wall.rows.weights.data == 1).all()
    reached = mesh.nodes[wall.rows.weights.indices]
    for point, node in zip(wall.rest[::37], reached[::37], strict=True):
        others = mesh.nodes[mesh.facet_nodes("cavity")]
        shortest = np.linalg.norm(others - point, axis=1).min()
        assert np.linalg.norm(node - point) == pytest.approx(shortest)


def test_samples_are_shared_between_facets(wall):
    """One point per place: a closed triangulated surface, V - E + F = 2."""
    edges = np.sort(wall.triangles[:, [[0, 1], [1, 2], [0, 2]]].reshape(-1, 2), axis=1)
    edges, uses = np.unique(edges, axis=0, return_counts=True)
    assert (uses == 2).all()
    assert len(wall.rest) - len(edges) + len(wall.triangles) == 2


def test_plane_through_vertices_and_along_edges_is_cut_cleanly():
    mesh = grid_mesh((5, 5, 5), holes=((slice(1, 3), slice(1, 3), slice(1, 3)),))
    triangles = mesh.facets["hole0"]
    pose = np.eye(4)
    for z in (0.375, 0.5, 0.75):  # between nodes, through nodes, at the upper face
        pose[2, 3] = z
        outline = section(mesh.nodes, triangles, pose)
        assert signed_area(outline) == pytest.approx(0.25, rel=1e-12)
        assert outline.min() == pytest.approx(0.25)
        assert outline.max() == pytest.approx(0.75)


def test_largest_of_several_outlines_is_the_section():
    small = (slice(1, 2), slice(1, 2), slice(1, 3))
    large = (slice(3, 5), slice(1, 3), slice(1, 3))
    mesh = grid_mesh((7, 7, 5), holes=(small, large))
    pose = np.eye(4)
    pose[2, 3] = 0.4
    both = np.vstack([mesh.facets["hole0"], mesh.facets["hole1"]])
    assert signed_area(section(mesh.nodes, both, pose)) == pytest.approx(4 / 36)


@pytest.mark.parametrize("height", [0.0141, -0.05])
def test_plane_that_misses_is_refused_with_the_span(wall, height):
    low = -1e3 * (0.014 - height)
    with pytest.raises(RegistrationError, match=r"misses the inclusion, which spans") as refused:
        section(wall.rest, wall.triangles, pose_at(height))
    spans = str(refused.value).split("spans ")[1].split(" mm")[0].split("..")
    assert [float(s) for s in spans] == pytest.approx([low, low + 28], abs=0.2)


def test_open_surface_has_no_closed_outline(wall):
    with pytest.raises(RegistrationError, match="not a closed outline"):
        section(wall.rest, wall.triangles[: len(wall.triangles) // 3], pose_at(0.0))


def test_image_and_scene_coordinates_are_inverse():
    pose = pose_at(0.003, 33.0)
    points = np.random.default_rng(3).normal(size=(7, 2))
    back = to_image(pose, from_image(pose, points))
    assert back == pytest.approx(np.column_stack([points, np.zeros(7)]), abs=1e-14)
    above = pose[:3, 3] + 0.25 * pose[:3, 2]
    assert to_image(pose, above[None])[0] == pytest.approx([0, 0, 0.25], abs=1e-15)


def test_proper_pose_is_accepted():
    require_rigid(pose_at(0.01, 20.0), "outline")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda R: R * [1, 1, -1], "pose 'probe' mirrors the image; give T_frame_from_image"),
        (lambda R: R * 1.01, "pose 'probe' is not orthogonal: error 2.0e-02"),
        (lambda R: R + np.eye(3, k=1) * 1e-3, "is not orthogonal: error"),
    ],
)
def test_improper_poses_are_refused(change, message):
    pose = pose_at(0.0)
    pose[:3, :3] = change(pose[:3, :3])
    with pytest.raises(RegistrationError, match=message):
        require_rigid(pose, "probe")


def test_pose_given_transposed_is_refused():
    with pytest.raises(RegistrationError, match="pose 'probe'"):
        require_rigid(pose_at(0.0).T, "probe")
