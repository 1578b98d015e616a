"""Systems and response columns: exact compression, reciprocity, energy, published numbers."""

from dataclasses import fields, replace

import numpy as np
import pytest
from phantoms import COARSE_GRID, grid_mesh, phantom_mesh, phantom_responses, phantom_scene

from validate.errors import SceneError
from validate.fem.system import Responses, build
from validate.scene.geometries.box import box
from validate.scene.geometries.specification import quarter_cylinder
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.scene import Cavity, Dilatation, Drive, Load, Pin, Scene, Support

SYMMETRY = (Support("symmetry_x", (0,)), Support("symmetry_y", (1,)), Support("lower_plate", (2,)))
BONDED = (Support("lower_plate", (0, 1)), Support("upper_plate", (0, 1)))
PRESS = (Drive("press", "upper_plate", (0.0, 0.0, -1.0)),)


def compressed(
    order: int,
    nu: float,
    *,
    bonded: bool,
    cells: tuple[int, int] = (3, 3),
    dilatation: Dilatation = "pointwise",
) -> Responses:
    """A quarter of D 50 mm, h 30 mm, E 100 kPa between plates."""
    mesh = quarter_cylinder(0.05, 0.03, *cells)
    mesh = mesh.quadratic() if order == 2 else mesh
    supports = SYMMETRY + (BONDED if bonded else ())
    scene = Scene(mesh, Material(1e5, nu), supports, (), PRESS, (), dilatation)
    return Responses.of(build(scene))


@pytest.mark.parametrize("nu", [-0.5, 0.0, 0.3, 0.4999, 0.4999999999])
@pytest.mark.parametrize(
    ("order", "dilatation"), [(1, "pointwise"), (1, "nodal_mean"), (2, "pointwise")]
)
def test_compression_between_slipping_plates_is_exact(
    order: int, dilatation: Dilatation, nu: float
) -> None:
    """Force E A d / h and lateral strain nu d / h for any nu; rounding grows as 1/(1 - 2 nu)."""
    r = compressed(order, nu, bonded=False, dilatation=dilatation)
    mesh = r.scene.mesh
    area = mesh.cell_volumes().sum() / 0.03
    within = 1e-13 + 1e-15 / (1 - 2 * nu)
    assert r.reactions[0, 0] == pytest.approx(1e5 * area / 0.03, rel=10 * within)
    x, y, z = mesh.nodes.T / 0.03
    assert r.fields[0] == pytest.approx(np.stack([nu * x, nu * y, -z], axis=1), abs=10 * within)


@pytest.mark.slow
def test_bonded_plates_raise_the_force() -> None:
    """D 50, h 30 mm at nu .4999: 1.40 by FEM, 1.347 by Gent's formula (README of the shared data).

    Quadratic elements come from above: 1.498 (4 x 4), 1.439 (6 x 8); at nu .485 less.
    """

    def factor(nu: float, cells: tuple[int, int]) -> float:
        pair = [compressed(2, nu, bonded=b, cells=cells).reactions[0, 0] for b in (True, False)]
        return float(pair[0] / pair[1])

    coarse, fine = factor(0.4999, (3, 3)), factor(0.4999, (5, 6))
    assert 1.40 < fine < coarse
    assert fine == pytest.approx(1.40, rel=0.05)
    assert 1.347 < factor(0.485, (5, 6)) < 1.40
    assert factor(0.0, (3, 3)) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.slow
def test_bonded_factor_on_a_fine_mesh() -> None:
    pair = [compressed(2, 0.4999, bonded=b, cells=(12, 16)).reactions[0, 0] for b in (True, False)]
    assert pair[0] / pair[1] == pytest.approx(1.40, rel=0.02)


def test_published_slope_of_the_paper_mesh() -> None:
    r = phantom_responses()
    assert 1e9 * r.rest_volumes[0] == pytest.approx(4448.3, abs=0.05)
    assert r.rest_volumes[0] / (3 * r.volumes[0, 0, 0, 2]) == pytest.approx(24508.9, abs=0.05)


def test_reciprocity_of_plate_and_pressure() -> None:
    """Betti: the volume a metre of stage squeezes out is the force a pascal puts on the stage."""
    r = phantom_responses()
    squeezed = 3 * r.volumes[0, 0, 0, 1]
    assert r.reactions[0, 1] == pytest.approx(-squeezed, rel=1e-11)
    assert squeezed < 0 < r.reactions[0, 0]


def test_reciprocity_of_a_driven_cavity_wall() -> None:
    """A plate that is itself wetted: the fluid's push counts in its force."""
    grid = grid_mesh((6, 5, 5), holes=((slice(2, 4), slice(1, 3), slice(1, 3)),))
    hole = grid.facets["hole0"]
    wetted = hole[np.isclose(grid.nodes[hole, 0], 0.8).all(axis=1)]
    mesh = Mesh(grid.nodes, grid.cells, "tet4", {**grid.facets, "piston": wetted})
    scene = Scene(
        mesh,
        Material(1.0, 0.3),
        (Support("x0", (0, 1, 2)),),
        drives=(Drive("piston", "piston", (-1.0, 0.0, 0.0)),),
        cavities=(Cavity("box", "hole0"),),
    )
    r = Responses.of(build(scene))
    squeezed = 3 * r.volumes[0, 0, 0, 1]
    assert len(wetted) == 8
    assert squeezed < 0
    assert r.reactions[0, 1] == pytest.approx(-squeezed, rel=1e-11)


def test_parts_of_a_symmetric_body_add_up() -> None:
    quarter = compressed(1, 0.3, bonded=False).scene
    one, whole = (Responses.of(build(replace(quarter, copies=n))) for n in (1, 4))
    assert whole.reactions == pytest.approx(4 * one.reactions, rel=1e-15)
    assert np.array_equal(whole.fields, one.fields)


def two_drives() -> Scene:
    mesh = phantom_mesh((5, 5, 6))
    supports = (Support("x0", (0,)), Support("y0", (1,)), Support("z0", (2,)))
    drives = (
        Drive("stage", "x1", (-1.0, 0.0, 0.0)),
        Drive("lid", "y1", (0.0, -1.0, 0.0)),
    )
    return Scene(mesh, Material(1e4, 0.4), supports, (), drives, (Cavity("cyst", "cavity"),))


def test_reciprocity_of_two_plates() -> None:
    r = Responses.of(build(two_drives()))
    assert r.drives == 2
    assert r.reactions.shape == (2, 3)
    assert r.reactions[0, 1] == pytest.approx(r.reactions[1, 0], rel=1e-12)
    assert r.reactions[:, 2] == pytest.approx(-3 * r.volumes[0, 0, 0, 1:3], rel=1e-11)


def test_columns_meet_their_supports_and_drives() -> None:
    scene = two_drives()
    r = Responses.of(build(scene))
    stage, lid = (scene.mesh.facet_nodes(n) for n in ("x1", "y1"))
    assert r.fields[0][stage, 0] == pytest.approx(-1.0, abs=0)
    assert r.fields[0][lid, 1] == pytest.approx(0.0, abs=0)
    assert r.fields[1][lid, 1] == pytest.approx(-1.0, abs=0)
    for component, name in enumerate(("x0", "y0", "z0")):
        assert np.abs(r.fields[:, scene.mesh.facet_nodes(name), component]).max() == 0


def test_work_of_the_plate_is_strain_energy() -> None:
    r, K = phantom_responses(COARSE_GRID), build(phantom_scene(phantom_mesh(COARSE_GRID))).K
    u = r.fields[0].ravel()
    assert u @ (K @ u) == pytest.approx(r.reactions[0, 0], rel=1e-12)


def test_work_of_the_pressure_is_strain_energy() -> None:
    """Compliance dV/dP = u_p . K u_p > 0: f_p . u_p, by the volume form."""
    r, K = phantom_responses(COARSE_GRID), build(phantom_scene(phantom_mesh(COARSE_GRID))).K
    u = r.fields[1].ravel()
    assert u @ (K @ u) == pytest.approx(3 * r.volumes[0, 0, 0, 2], rel=1e-11)
    assert u @ (K @ u) > 0


def test_modulus_scales_forces_and_nothing_else() -> None:
    one, million = phantom_responses(COARSE_GRID), phantom_responses(COARSE_GRID, E=1.52e10)
    assert million.fields[0] == pytest.approx(one.fields[0], abs=1e-12)
    assert 1e6 * million.fields[1] == pytest.approx(one.fields[1], rel=1e-9, abs=1e-18)
    assert million.reactions[0, 0] == pytest.approx(1e6 * one.reactions[0, 0], rel=1e-12)
    assert million.reactions[0, 1] == pytest.approx(one.reactions[0, 1], rel=1e-12)


def test_bonded_plates_stiffen_the_phantom() -> None:
    slip, bonded = phantom_responses(), phantom_responses(bonded=True)
    assert bonded.reactions[0, 0] > 1.05 * slip.reactions[0, 0]
    plates = np.concatenate([bonded.scene.mesh.facet_nodes(n) for n in ("x0", "x1")])
    assert np.abs(bonded.fields[:, plates, 1:]).max() == 0


def test_numbering_of_nodes_and_cells_does_not_matter() -> None:
    scene = phantom_scene(phantom_mesh((5, 5, 6)))
    mesh, rng = scene.mesh, np.random.default_rng(0)
    order = rng.permutation(len(mesh.nodes))
    new = np.argsort(order)
    shuffled = type(mesh)(
        mesh.nodes[order],
        rng.permutation(new[mesh.cells]),
        mesh.kind,
        {name: new[f] for name, f in mesh.facets.items()},
    )
    one, other = Responses.of(build(scene)), Responses.of(build(phantom_scene(shuffled)))
    for name in ("reactions", "volumes"):
        a, b = getattr(one, name), getattr(other, name)
        assert b == pytest.approx(a, rel=1e-11, abs=1e-13 * np.abs(a).max())
    assert other.fields[0] == pytest.approx(one.fields[0][order], abs=1e-12)


def test_scene_without_cavity_or_without_drive() -> None:
    r = compressed(1, 0.3, bonded=False)
    assert r.volumes.shape == (0, 2, 2, 2)
    assert r.rest_volumes.shape == (0,)
    scene = phantom_scene(phantom_mesh((5, 5, 6)))
    held = Scene(scene.mesh, scene.material, (Support("x0", (0, 1, 2)),), (), (), scene.cavities)
    only_pressure = Responses.of(build(held))
    assert only_pressure.fields.shape == (1, len(scene.mesh.nodes), 3)
    assert only_pressure.reactions.shape[0] == 0
    assert 3 * only_pressure.volumes[0, 0, 0, 1] > 0


def test_drive_must_follow_an_axis() -> None:
    mesh = grid_mesh((3, 3, 3))
    for direction in ((0.6, 0.8, 0.0), (0.0, 0.0, 0.0)):
        scene = Scene(mesh, Material(1.0, 0.3), (), (), (Drive("push", "z1", direction),))
        with pytest.raises(SceneError, match="drive 'push' must move along one axis"):
            build(scene)


def test_pins_hold_the_nearest_node() -> None:
    mesh = grid_mesh((3, 3, 3))
    scene = Scene(mesh, Material(1.0, 0.3), pins=(Pin((0.52, 0.49, 0.9), (0, 2)),))
    held = np.setdiff1d(np.arange(mesh.nodes.size), build(scene).free)
    at = mesh.nearest_node(np.array([0.5, 0.5, 1.0]))
    assert held.tolist() == [3 * at, 3 * at + 2]


def test_system_is_frozen() -> None:
    system = build(phantom_scene(phantom_mesh((5, 5, 6))))
    assert [f.name for f in fields(system)] == ["scene", "free", "moves", "cavities"]
    with pytest.raises(AttributeError):
        system.free = np.zeros(1)  # type: ignore[misc]


def test_a_body_whose_nodes_are_all_held_is_refused_with_the_elements_it_takes() -> None:
    held = (Support("z0", (0, 1, 2)), Support("z1", (0, 1)))
    stage = Drive("stage", "z1", (0.0, 0.0, -1.0))
    pressed = Scene(box((1.0, 1.0, 1.0), (1, 1, 1)), Material(1e4, 0.3), held, drives=(stage,))
    with pytest.raises(SceneError, match=r"all 24 unknowns of 8 nodes.*least 2 elem"):
        build(pressed)


def test_columns_know_no_loads_and_no_large_strain() -> None:
    scene = Scene(
        box((1.0, 1.0, 1.0), (1, 1, 1)), Material(1.0, 0.3), (Support("z0", (0, 1, 2)),),
        loads=(Load("pull", "z1", (0.0, 0.0, 1.0)),),
    )  # fmt: skip
    with pytest.raises(SceneError, match="response columns support drives"):
        Responses.of(build(scene))
    large = replace(scene, material=Material(1.0, 0.3, "svk"))
    with pytest.raises(SceneError, match="a linear scheme cannot solve the law"):
        Responses.of(build(large))
