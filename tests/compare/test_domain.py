"""The strain, rate and size that a run covered, of maps that are known."""

import numpy as np
import pytest

from validate.compare.domain import hencky
from validate.scene.box import grid
from validate.scene.mesh import Mesh, quadratic


@pytest.mark.parametrize("order", [1, 2])
def test_an_affine_map_has_its_strain_in_every_cell(order: int) -> None:
    mesh = grid((0.1, 0.2, 0.3), (1, 2, 2))
    mesh = quadratic(mesh) if order == 2 else mesh
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    F = turn @ np.diag([0.5, 1.2, 1.5])
    found = hencky(mesh, mesh.nodes @ (F - np.eye(3)).T)
    assert found == pytest.approx(np.full(len(mesh.cells), np.log(2)))


def test_a_cell_turned_inside_out_is_no_small_strain() -> None:
    mesh = Mesh(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), np.array([[0, 1, 2]]), "tri3", {})
    assert np.isinf(hencky(mesh, np.array([[0.0, 0.0], [-2.0, 0.0], [0.0, 0.0]]))[0])
