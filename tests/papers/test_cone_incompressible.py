"""Paper 003's cone at its printed nu = .5: the limit of the same cells, and who refuses it."""

from dataclasses import replace

import numpy as np
import pytest

from validate.errors import SceneError
from validate.fem.hyperelastic import Body
from validate.fem.system import build as assembled
from validate.papers.ekf_nfem.cone import ConeMesh, ConeModel, PressedCone, ShearCard, build
from validate.recording.types import Recording, Source
from validate.scene.scene import Scene
from validate.solve.newton import StaticNewton

EMPTY = Recording("none", Source("none", "", 0, ""), 0)


def quarter(nu: float, element: str = "p2_mixed") -> Scene:
    parameters = replace(PressedCone(), material=ShearCard(nu=nu), mesh=ConeMesh(2, 3))
    return build(EMPTY, parameters, ConeModel(True, element, "neo_hooke"))  # type: ignore[arg-type]


def test_its_force_is_the_limit_and_every_cell_keeps_its_volume() -> None:
    """Pressed by 1.2 mm, about 15 N."""
    forces = []
    for nu in (0.4999, 0.49999, 0.5):
        scene = quarter(nu)
        stepper = StaticNewton("none", tolerance=1e-11).prepare(assembled(scene))
        state = stepper.step(stepper.rest(), np.array([1.2e-3]))
        assert state.failure is None
        forces.append(state.numbers["plate.force"])
    off = np.abs(np.array(forces[:2]) - forces[2])
    assert off[0] / off[1] == pytest.approx(10, rel=0.02)
    body, u = Body(scene), stepper.field(state).ravel()
    volumes = (body.weights * body.jacobians(u)).sum(axis=1) / body.weights.sum(axis=1)
    assert volumes == pytest.approx(1.0, abs=1e-8)


@pytest.mark.parametrize("element", ["p1", "p1_mean", "p2"])
def test_other_elements_name_the_method_to_choose(element: str) -> None:
    with pytest.raises(SceneError, match=rf"nu = 0.5 with element '{element}'.*plate_mixed"):
        quarter(0.5, element)
