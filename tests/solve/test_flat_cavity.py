"""Newton on a 2-D body with a fluid-filled hole: the derivative of its load, and its area kept."""

import numpy as np
import pytest

from validate.fem.cavity import cavity_surface, volume_hessian
from validate.fem.system import build
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.mesh import Mesh, boundary_facets
from validate.scene.scene import Cavity, Drive, Scene, Support
from validate.solve.static.newton import StaticNewton


def holed(order: int) -> Mesh:
    """A square of 6 x 6 with a hole of 2 x 2 cells in its middle."""
    mesh = box((0.06, 0.06), (6, 6))
    middles = mesh.nodes[mesh.corners].mean(axis=1)
    inside = (np.abs(middles - 0.03) < 0.01).all(axis=1)
    cells = mesh.cells[~inside]
    outside = boundary_facets(cells, 2)
    at = mesh.nodes[outside].mean(axis=1)
    hole = outside[(np.abs(at - 0.03) < 0.0101).all(axis=1)]
    kept = np.unique(cells)
    number = np.full(len(mesh.nodes), -1)
    number[kept] = np.arange(len(kept))
    facets = {"y0": number[mesh.facets["y0"]], "y1": number[mesh.facets["y1"]],
              "hole": number[hole]}  # fmt: skip
    whole = Mesh(mesh.nodes[kept], number[cells], "tri3", facets)
    return whole.quadratic() if order == 2 else whole


@pytest.mark.parametrize("order", [1, 2])
def test_the_hessian_of_an_area_is_the_derivative_of_its_load(order: int) -> None:
    mesh = holed(order)
    surface = cavity_surface(mesh, "hole", "hole")
    rng = np.random.default_rng(1)
    x = mesh.nodes + 1e-3 * rng.normal(size=mesh.nodes.shape)
    way = rng.normal(size=mesh.nodes.shape)
    h = 1e-6
    ends = [surface.pressure_load(x + s * h * way).ravel() for s in (1, -1)]
    assert volume_hessian(surface, x) @ way.ravel() == pytest.approx(
        (ends[0] - ends[1]) / (2 * h), rel=1e-6, abs=1e-9
    )


@pytest.mark.parametrize("order", [1, 2])
def test_a_squeezed_hole_keeps_its_area(order: int) -> None:
    mesh = holed(order)
    scene = Scene(
        mesh, Material(1e4, 0.3, "neo_hooke"), (Support("y0", (0, 1)),),
        drives=(Drive("press", "y1", (0.0, -1.0)),), cavities=(Cavity("hole", "hole"),),
    )  # fmt: skip
    stepper = StaticNewton().prepare(build(scene))
    state = stepper.step(stepper.rest(), np.array([0.006]))
    assert state.failure is None
    surface = cavity_surface(mesh, "hole", "hole")
    moved = mesh.nodes + stepper.field(state)
    assert surface.volume(moved) == pytest.approx(surface.volume(mesh.nodes), rel=1e-6)
    pressures = [v for k, v in state.numbers.items() if "pressure" in k]
    assert pressures
    assert pressures[0] > 0
