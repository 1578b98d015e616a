"""Foundations and membranes on facets: exact energies of simple motions."""

import numpy as np
import pytest
from phantoms import grid_mesh

from validate.errors import SceneError
from validate.fem.assembly.assemble import foundation_stiffness, membrane_stiffness, stiffness
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.scene import Foundation, Membrane, Scene

LATEX = Material(1.2e6, 0.45)


@pytest.fixture(params=[1, 2])
def mesh(request: pytest.FixtureRequest) -> Mesh:
    flat = grid_mesh((3, 3, 4), (0.02, 0.03, 0.04))
    return flat if request.param == 1 else flat.quadratic()


def energy(K: object, u: np.ndarray) -> float:
    return float(0.5 * u.ravel() @ (K @ u.ravel()))  # type: ignore[operator]


def test_a_foundation_holds_a_translation_with_its_stiffness_times_area(mesh: Mesh) -> None:
    K = foundation_stiffness(mesh, Foundation("x0", (1, 2), 1e6))
    area = 0.03 * 0.04
    for component, held in ((0, 0.0), (1, 1.0), (2, 1.0)):
        u = np.zeros_like(mesh.nodes)
        u[:, component] = 1e-3
        assert energy(K, u) == pytest.approx(held * 0.5 * 1e6 * area * 1e-6, abs=1e-15)


def test_a_membrane_stores_the_plane_stress_energy_of_a_uniform_strain(mesh: Mesh) -> None:
    K = membrane_stiffness(mesh, Membrane("x0", 1e-4, LATEX))
    strain = np.array([[0.0, 0.0, 0.0], [0.0, 2e-3, 0.5e-3], [0.0, 0.5e-3, -1e-3]])
    u = mesh.nodes @ strain
    E, nu, area = LATEX.E, LATEX.nu, 0.03 * 0.04
    ey, ez, eyz = strain[1, 1], strain[2, 2], strain[1, 2]
    density = E / (1 - nu**2) / 2 * (ey**2 + ez**2 + 2 * nu * ey * ez + 2 * (1 - nu) * eyz**2)
    assert energy(K, u) == pytest.approx(1e-4 * area * density, rel=1e-12)


def test_a_membrane_feels_no_rigid_motion_and_no_bending(mesh: Mesh) -> None:
    K = membrane_stiffness(mesh, Membrane("x0", 1e-4, LATEX))
    spin = np.cross(np.array([0.3, -0.2, 0.5]), mesh.nodes)
    for u in (np.ones_like(mesh.nodes), spin):
        assert np.abs(K @ u.ravel()).max() < 1e-12 * abs(K).max()
    bulge = np.zeros_like(mesh.nodes)
    bulge[:, 0] = mesh.nodes[:, 1] ** 2  # out of the plane: no first-order strain
    assert energy(K, bulge) == pytest.approx(0.0, abs=1e-20)


def test_the_scene_adds_them_and_both_are_symmetric(mesh: Mesh) -> None:
    plain = Scene(mesh, Material(1e4, 0.4))
    parts = (Foundation("x0", (1,), 1e5),), (Membrane("x1", 1e-4, LATEX),)
    held = Scene(mesh, Material(1e4, 0.4), foundations=parts[0], membranes=parts[1])
    added = stiffness(held) - stiffness(plain)
    assert abs(added).max() > 0
    assert abs(added - added.T).max() < 1e-9 * abs(added).max()


def test_wrong_values_are_refused() -> None:
    with pytest.raises(SceneError, match="membrane thickness -1"):
        Membrane("x0", -1.0, LATEX)
    with pytest.raises(SceneError, match="foundation stiffness -1"):
        Foundation("x0", (1,), -1.0)
    with pytest.raises(SceneError, match="no facets 'nowhere'"):
        Scene(
            grid_mesh((2, 2, 2), (1.0, 1.0, 1.0)),
            LATEX,
            foundations=(Foundation("nowhere", (0,), 1.0),),
        )
