"""The strain, rate and size that a run covered, of maps that are known."""

from types import SimpleNamespace

import numpy as np
import pytest

from validate.compare.result import domains, hencky
from validate.scene.geometries.box import grid
from validate.scene.mesh import Mesh


@pytest.mark.parametrize("order", [1, 2])
def test_an_affine_map_has_its_strain_in_every_cell(order: int) -> None:
    mesh = grid((0.1, 0.2, 0.3), (1, 2, 2))
    mesh = mesh.quadratic() if order == 2 else mesh
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    F = turn @ np.diag([0.5, 1.2, 1.5])
    found = hencky(mesh, mesh.nodes @ (F - np.eye(3)).T)
    assert found == pytest.approx(np.full(len(mesh.cells), np.log(2)))


def test_a_cell_turned_inside_out_is_no_small_strain() -> None:
    mesh = Mesh(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), np.array([[0, 1, 2]]), "tri3", {})
    assert np.isinf(hencky(mesh, np.array([[0.0, 0.0], [-2.0, 0.0], [0.0, 0.0]]))[0])


def test_a_run_without_fields_has_neither_strain_nor_rate() -> None:
    run = SimpleNamespace(traces={}, u=np.zeros((0, 3, 2)), t=np.zeros(0), at=np.zeros(0, int))
    mesh = Mesh(np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 1.0]]), np.zeros((0, 3), int), "tri3", {})
    method = SimpleNamespace(
        scene=SimpleNamespace(mesh=mesh), runs=[run], registered=[SimpleNamespace(timed=True)]
    )
    (found,) = domains(method, ("log",), ("A",))
    assert (found.strain, found.rate, found.sides) == (None, None, (1.0, 3.0))


@pytest.mark.parametrize(("timed", "rate"), [(True, np.log(2) / 0.5), (False, None)])
def test_the_rate_of_a_stretch_is_its_steepest_step(timed: bool, rate: float | None) -> None:
    """Stretches 1, 2, 1, 1.2 at 0, 1, 1.5, 2.5 s: the fall by log 2 in half a second counts."""
    stretch = SimpleNamespace(y=np.array([1.0, 2.0, 1.0, 1.2]))
    run = SimpleNamespace(traces={"stretch": stretch}, t=np.array([0.0, 1.0, 1.5, 2.5]))
    nothing = Mesh(np.zeros((0, 3)), np.zeros((0, 4), int), "tet4", {})
    method = SimpleNamespace(
        scene=SimpleNamespace(mesh=nothing), runs=[run], registered=[SimpleNamespace(timed=timed)]
    )
    (found,) = domains(method, ("log",), ("A",))
    assert found.strain == pytest.approx(np.log(2), rel=1e-12)
    assert found.rate == (rate if rate is None else pytest.approx(rate, rel=1e-12))
    assert found.sides is None
