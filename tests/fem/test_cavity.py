"""Cavity volumes and pressure loads: exact on polyhedra, under maps, and as derivative."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from phantoms import CAPSULE, COARSE_GRID, PAPER_GRID, grid_mesh, phantom_mesh

from validate.errors import SceneError
from validate.fem import cavity as module
from validate.fem.cavity import CavitySurface, cavity_surface, volume_form
from validate.scene.mesh import Kind, Mesh

# private: _require_closed_line: called alone, case by case.

HOLE = ((slice(1, 3), slice(1, 2), slice(1, 4)),)
BOX = (2 / 4) * (1 / 3) * (3 / 5)  # of the unit cube
CENTRE = np.array([0.5, 0.5, 0.5])
kinds = pytest.mark.parametrize("kind", ["tet4", "tet10"])


def box(kind: Kind) -> tuple[Mesh, CavitySurface]:
    mesh = grid_mesh((5, 4, 6), holes=HOLE, kind=kind)
    return mesh, cavity_surface(mesh, "box", "hole0")


@kinds
def test_volume_of_a_box_is_exact(kind: Kind) -> None:
    mesh, surface = box(kind)
    assert surface.volume(mesh.nodes) == pytest.approx(BOX, rel=1e-14)
    assert np.array_equal(surface.nodes, mesh.facet_nodes("hole0"))


@kinds
@settings(max_examples=30)
@given(arrays(float, (3, 3), elements=st.floats(-3, 3)))
def test_affine_maps_scale_the_volume_by_the_determinant(kind: Kind, A: np.ndarray) -> None:
    mesh, surface = box(kind)
    mapped = surface.volume(mesh.nodes @ A.T + [1.0, -2.0, 3.0])
    assert mapped == pytest.approx(np.linalg.det(A) * BOX, abs=1e-13 * (1 + np.abs(A).max() ** 3))


def test_curved_quadratic_facets_are_integrated_exactly() -> None:
    """A quadratic map of straight facets is met by their nodes, so its volume is known."""
    mesh, surface = box("tet10")
    x, y, z = mesh.nodes.T
    sheared = np.stack([x, y, z + 0.7 * x**2 - 0.4 * x * y], axis=1)
    assert surface.volume(sheared) == pytest.approx(BOX, rel=1e-13)
    stretched = np.stack([x + 0.3 * x**2, y, z], axis=1)
    mean_x = 0.5  # of the hole
    assert surface.volume(stretched) == pytest.approx(BOX * (1 + 0.6 * mean_x), rel=1e-13)


@kinds
def test_far_origin_loses_no_digits(kind: Kind) -> None:
    mesh, surface = box(kind)
    near = 1e-2 * mesh.nodes
    far = near + [1e3, -1e3, 1e3]
    # Data rounding is 1e-13 m of 1e-2 m; without the centroid 1e-5 of the volume would be lost.
    assert surface.volume(far) == pytest.approx(surface.volume(near), rel=1e-9)
    ours = volume_form(surface, np.stack([far, near]))
    assert ours == pytest.approx(volume_form(surface, np.stack([near, near])), rel=1e-9)


@kinds
def test_far_origin_loses_nothing_of_exact_data(kind: Kind) -> None:
    """Binary fractions moved by 2^20 m are not rounded, so no digit of the volume may change."""
    hole = ((slice(1, 3), slice(1, 2), slice(1, 4)),)
    mesh = grid_mesh((5, 5, 9), holes=hole, kind=kind)
    surface = cavity_surface(mesh, "box", "hole0")
    far = mesh.nodes + 2.0**20
    exact = (2 / 4) * (1 / 4) * (3 / 8)
    assert surface.volume(far) == pytest.approx(exact, rel=1e-14)
    form = volume_form(surface, np.stack([far, far]))
    assert form == pytest.approx(exact, rel=1e-14)


def test_volume_of_the_capsule_converges_from_below() -> None:
    volumes = []
    for grid in (COARSE_GRID, PAPER_GRID):
        mesh = phantom_mesh(grid)
        volumes.append(cavity_surface(mesh, "cyst", "cavity").volume(mesh.nodes))
    assert volumes[0] < volumes[1] < CAPSULE.volume


@kinds
def test_load_is_the_derivative_of_the_volume(kind: Kind) -> None:
    mesh, surface = box(kind)
    rng = np.random.default_rng(5)
    positions = mesh.nodes + 0.05 * rng.normal(size=mesh.nodes.shape)
    load = surface.pressure_load(positions)
    for _ in range(5):
        move = rng.normal(size=positions.shape)
        # V is cubic along a line: this difference formula of order 4 is exact.
        V = {s: surface.volume(positions + s * move) for s in (-2, -1, 1, 2)}
        slope = (8 * (V[1] - V[-1]) - (V[2] - V[-2])) / 12
        assert (load * move).sum() == pytest.approx(slope, rel=1e-10, abs=1e-11)


@kinds
def test_load_is_in_balance_and_pushes_the_wall_outward(kind: Kind) -> None:
    mesh, surface = box(kind)
    load = surface.pressure_load(mesh.nodes)
    assert np.abs(load.sum(axis=0)).max() < 1e-15
    assert np.abs(np.cross(mesh.nodes, load).sum(axis=0)).max() < 1e-15
    # Euler: x . dV/dx = 3 V, so the fluid's push outward has positive work.
    assert ((mesh.nodes - CENTRE) * load).sum() == pytest.approx(3 * BOX, rel=1e-13)
    others = np.setdiff1d(np.arange(len(mesh.nodes)), surface.nodes)
    assert np.abs(load[others]).max() == 0
    face = np.isclose(mesh.nodes[:, 0], 0.75)
    assert load[face, 0].sum() == pytest.approx(1 / 3 * 3 / 5, rel=1e-13)


@kinds
@settings(max_examples=20)
@given(arrays(float, 3, elements=st.floats(-3, 3)), st.integers(0, 2**31))
def test_volume_form_gives_the_volume_of_any_combination(
    kind: Kind, z: np.ndarray, seed: int
) -> None:
    mesh, surface = box(kind)
    columns = np.concatenate(
        [mesh.nodes[None], 0.1 * np.random.default_rng(seed).normal(size=(3, *mesh.nodes.shape))]
    )
    form = volume_form(surface, columns)
    one = np.concatenate([[1.0], z])
    combined = surface.volume(np.tensordot(one, columns, 1))
    scale = (1 + np.abs(z).max()) ** 3
    assert form @ one @ one @ one == pytest.approx(combined, abs=1e-12 * scale)


def test_volume_form_is_symmetric() -> None:
    mesh, surface = box("tet4")
    columns = np.random.default_rng(1).normal(size=(3, *mesh.nodes.shape))
    form = volume_form(surface, columns)
    for axes in ((1, 0, 2), (0, 2, 1), (2, 1, 0)):
        assert form == pytest.approx(form.transpose(axes), abs=1e-14)


@kinds
def test_open_surface_is_refused(kind: Kind) -> None:
    mesh = grid_mesh((5, 4, 6), holes=HOLE, kind=kind)
    facets = {"hole0": mesh.facets["hole0"][1:]}
    with pytest.raises(SceneError, match=r"'box'.*3 edges"):
        cavity_surface(Mesh(mesh.nodes, mesh.cells, kind, facets), "box", "hole0")


def test_surface_turned_inside_out_is_refused() -> None:
    mesh = grid_mesh((5, 4, 6), holes=HOLE)
    facets = {"hole0": mesh.facets["hole0"][:, [0, 2, 1]]}
    with pytest.raises(SceneError, match=r"inside out: volume -1e\+08 mm3"):
        cavity_surface(Mesh(mesh.nodes, mesh.cells, "tet4", facets), "box", "hole0")


def test_one_facet_flipped_is_refused() -> None:
    mesh = grid_mesh((5, 4, 6), holes=HOLE)
    facets = mesh.facets["hole0"].copy()
    facets[3] = facets[3, [0, 2, 1]]
    flipped = Mesh(mesh.nodes, mesh.cells, "tet4", {"hole0": facets})
    with pytest.raises(SceneError, match=r"'box'.*3 edges"):
        cavity_surface(flipped, "box", "hole0")


@pytest.mark.parametrize("facets", [[[0, 1], [1, 2]], [[0, 1], [2, 1], [2, 0]]])
def test_a_line_that_is_open_or_turns_back_bounds_no_cavity(facets: list[list[int]]) -> None:
    def surface(rows: list[list[int]]) -> module.CavitySurface:
        return module.CavitySurface("cyst", np.array(rows), np.arange(3))

    module._require_closed_line(surface([[0, 1], [1, 2], [2, 0]]))
    with pytest.raises(SceneError, match="cavity 'cyst' is open or its facets"):
        module._require_closed_line(surface(facets))
