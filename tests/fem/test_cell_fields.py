"""Strain and stress of cells: exact in affine fields."""

import numpy as np
import pytest

from validate.fem.assembly.cell_fields import cell_fields
from validate.scene.geometries.box import grid
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.scene import Scene

E, NU = 3e4, 0.3
LAM, MU = E * NU / ((1 + NU) * (1 - 2 * NU)), E / (2 * (1 + NU))


def body(kind: str, law: str) -> Scene:
    bricks = grid((0.1, 0.2, 0.3), (1, 2, 2))
    linear = Mesh(bricks.nodes, bricks.simplices, "tet4")
    mesh = {"tet4": linear, "tet10": linear.quadratic(), "hex8": bricks}[kind]
    return Scene(mesh, Material(E, NU, law=law))  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", ["tet4", "tet10", "hex8"])
def test_hooke_in_an_affine_field(kind: str) -> None:
    G = np.array([[1e-3, 2e-3, 0], [0, -2e-3, 1e-3], [3e-3, 0, 1e-3]])
    scene = body(kind, "linear")
    got = cell_fields(scene, scene.mesh.nodes @ G.T)
    eps = (G + G.T) / 2
    sigma = LAM * np.trace(eps) * np.eye(3) + 2 * MU * eps
    assert np.abs(got.strain - eps).max() < 1e-15
    assert got.stress is not None
    assert np.abs(got.stress - sigma).max() < 1e-9 * np.abs(sigma).max()


@pytest.mark.parametrize("kind", ["tet4", "hex8"])
def test_saint_venant_kirchhoff_stretched_and_turned(kind: str) -> None:
    """Cauchy stress turns with the body; E does not."""
    U = np.diag([1.2, 0.9, 1.0])
    c, s = np.cos(0.7), np.sin(0.7)
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    F = R @ U
    scene = body(kind, "svk")
    got = cell_fields(scene, scene.mesh.nodes @ (F - np.eye(3)).T)
    strain = (U @ U - np.eye(3)) / 2
    S = LAM * np.trace(strain) * np.eye(3) + 2 * MU * strain
    sigma = F @ S @ F.T / np.linalg.det(F)
    assert np.abs(got.strain - strain).max() < 1e-14
    assert got.stress is not None
    assert np.abs(got.stress - sigma).max() < 1e-9 * np.abs(sigma).max()


def test_von_mises_of_uniaxial_stress_is_that_stress_and_of_pressure_none() -> None:
    scene = body("tet4", "linear")
    eps = np.diag([1e-3, -NU * 1e-3, -NU * 1e-3])
    one = cell_fields(scene, scene.mesh.nodes @ eps).von_mises
    assert one is not None
    assert one == pytest.approx(E * 1e-3)
    none = cell_fields(scene, 1e-3 * scene.mesh.nodes).von_mises
    assert none is not None
    assert np.abs(none).max() < 1e-10 * E
