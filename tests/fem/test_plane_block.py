"""The plane block of paper 000, Fig. 4: counts, slope, gain and pressures computed apart."""

import numpy as np
import pytest

from experiments.fluid_phantom.square_hole import square_with_hole
from validate.errors import SceneError
from validate.fem.cavity import cavity_surface
from validate.fem.system import Responses, build
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.scene import Cavity, Drive, Scene, Support
from validate.solve.fluid.pressure_curve import pressure_at_volume, tuned_gain


def block(n: int, order: int = 1) -> Responses:
    mesh = square_with_hole(0.05, 0.01, n)
    held = (Support("bottom", (0, 1)),)
    cavity = (Cavity("hole", "cavity"),)
    made = mesh if order == 1 else mesh.quadratic()
    return Responses.of(build(Scene(made, Material(34e3, 0.35), held, cavities=cavity)))


def slope(r: Responses) -> float:
    return float(r.rest_volumes[0] / (3 * r.volumes[0, 0, 0, 1]))


def test_the_block_of_the_note() -> None:
    """An earlier study, Block, a = 10 mm, N = 50."""
    r = block(50)
    mesh = r.scene.mesh
    assert (len(mesh.nodes), len(mesh.facets["cavity"])) == (2520, 40)
    assert r.rest_volumes[0] == pytest.approx(1e-4, rel=1e-12)
    assert 1 / slope(r) == pytest.approx(1.017051e-4, rel=1e-6)
    assert slope(r) == pytest.approx(9832.3, abs=0.06)
    assert tuned_gain(r) == pytest.approx(9857.3, abs=0.06)
    pressures = pressure_at_volume(r, np.array([0.7, 1.3]))
    assert pressures == pytest.approx([-3095.85, 2827.77], abs=0.01)


@pytest.mark.parametrize(("n", "theirs"), [(10, 12758.9), (20, 10760.1), (100, 9557.8)])
def test_the_slope_converges_slowly_to_the_notes_values(n: int, theirs: float) -> None:
    assert slope(block(n)) == pytest.approx(theirs, abs=0.06)


def test_the_quadratic_slope_of_the_note() -> None:
    assert slope(block(50, order=2)) == pytest.approx(9446.8, abs=0.06)


@pytest.mark.parametrize("order", [1, 2])
def test_the_load_is_the_derivative_of_the_area(order: int) -> None:
    mesh = square_with_hole(0.05, 0.01, 10)
    mesh = mesh if order == 1 else mesh.quadratic()
    surface = cavity_surface(mesh, "hole", "cavity")
    rng = np.random.default_rng(1)
    x = mesh.nodes + 1e-4 * rng.standard_normal(mesh.nodes.shape)
    way = rng.standard_normal(x.shape)
    h = 1e-6
    difference = (surface.volume(x + h * way) - surface.volume(x - h * way)) / (2 * h)
    load = surface.pressure_load(x)
    assert float((load * way).sum()) == pytest.approx(difference, rel=1e-9)
    assert np.abs(load.sum(axis=0)).max() < 1e-15


def test_uniaxial_plane_strain_is_exact() -> None:
    """A square pressed between slipping plates: F = E/(1 - nu^2) d, per metre of thickness."""
    nodes = np.array([[0.0, 0.0], [1, 0], [1, 1], [0, 1]]) * 0.1
    facets = {"low": [[0, 1]], "high": [[2, 3]], "left": [[3, 0]]}
    mesh = Mesh(nodes, np.array([[0, 1, 2], [0, 2, 3]]), "tri3",
                {k: np.array(v) for k, v in facets.items()})  # fmt: skip
    held = (Support("low", (1,)), Support("left", (0,)))
    drive = (Drive("stage", "high", (0.0, -1.0)),)
    r = Responses.of(build(Scene(mesh, Material(2e4, 0.3), held, drives=drive)))
    assert r.reactions[0, 0] == pytest.approx(2e4 / (1 - 0.3**2), rel=1e-12)


def test_holes_that_do_not_fit_are_refused() -> None:
    for hole, n in ((0.011, 50), (0.05, 50), (0.01, 25 * 2 + 5 - 4)):
        with pytest.raises(SceneError, match="a hole of"):
            square_with_hole(0.05, hole, n)
