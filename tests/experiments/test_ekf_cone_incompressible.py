"""Paper 003's cone at its printed nu = .5: the limit of the same cells, and who refuses it."""

import numpy as np
import pytest
from beside import experiment

from validate.errors import SceneError
from validate.fem.large_strain.hyperelastic import Body
from validate.fem.system import build as assembled
from validate.parameters import with_given
from validate.pipeline.experiment.tree import Built
from validate.scene.scene import Scene
from validate.solve.static.newton import StaticNewton


def quarter(nu: float, method: str = "plate_mixed") -> Scene:
    cone = experiment("ekf_cone")
    tree = with_given(cone.parameters, {"material.nu": nu, "body.cells": (2, 3)})
    return Built()(None, tree, cone.methods[method].scene)


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


@pytest.mark.parametrize("method", ["plate_p1", "plate_mean", "plate_p2"])
def test_other_elements_say_which_can(method: str) -> None:
    with pytest.raises(SceneError, match=r"nu = 0.5 in tet.*use mixed cells"):
        quarter(0.5, method)
