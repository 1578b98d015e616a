"""A surface that moves as it was measured: Laplace's equation, and elasticity beside it."""

from functools import reduce
from operator import or_

import numpy as np
import pytest

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.system import build
from validate.scene.geometries.box import grid
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.places import Labelled, nodes_of
from validate.scene.scene import Drive, DriveShape, Scene
from validate.solve.march import run_scheme
from validate.solve.static.newton import StaticNewton
from validate.solve.static.quasi_static import QuasiStatic
from validate.solve.static.without_mechanics import Harmonic

ALL = reduce(or_, [Labelled(f"{a}{e}") for a in "xyz" for e in (0, 1)]).faces
MESH = grid((1.0, 2.0, 1.5), (2, 2, 2)).quadratic()
ONE = np.array([1.0])


def scene(mesh: Mesh, u: Floats, law: str = "linear") -> Scene:
    faces = Drive("faces", ALL, (0.0, 0.0, 1.0), shape=DriveShape(u[nodes_of(mesh, ALL)]))
    return Scene(mesh, Material(1e3, 0.4, law), drives=(faces,))  # type: ignore[arg-type]


def harmonic_field(x: Floats) -> Floats:
    return np.stack([x[:, 0] ** 2 - x[:, 2] ** 2, x[:, 0] * x[:, 1], 3 * x[:, 2]], axis=1)


def test_a_harmonic_field_is_found_inside_and_scales_with_its_input() -> None:
    u = harmonic_field(MESH.nodes)
    for amount in (1.0, -0.01):
        run = run_scheme("m", Harmonic(), scene(MESH, u), ONE, np.array([[amount]]), np.array([0]))
        assert run.u[0] == pytest.approx(amount * u, abs=1e-9)


@pytest.mark.parametrize("law", ["linear", "neo_hooke"])
def test_a_body_whose_faces_move_affinely_does_so_inside(law: str) -> None:
    H = np.array([[0.02, 0.01, 0], [0, -0.03, 0.02], [0.01, 0, 0.04]])
    u = MESH.nodes @ H.T
    settings = QuasiStatic() if law == "linear" else StaticNewton("none")
    run = run_scheme("m", settings, scene(MESH, u, law), ONE, np.array([[1.0]]), np.array([0]))
    assert run.finished
    assert run.u[0] == pytest.approx(u, abs=1e-8)


def test_a_shape_of_other_nodes_is_refused() -> None:
    short = Drive("faces", ALL, (0.0, 0.0, 1.0), shape=DriveShape(np.ones((3, 3))))
    with pytest.raises(SceneError, match=r"\(3, 3\) for 294 unknowns"):
        build(Scene(MESH, Material(1e3, 0.4), drives=(short,)))


def test_two_shapes_are_told_apart_by_their_text() -> None:
    u = np.zeros((2000, 3))
    other = u.copy()
    other[1000, 1] = 1e-9
    assert repr(DriveShape(u)) == repr(DriveShape(u.copy())) != repr(DriveShape(other))
