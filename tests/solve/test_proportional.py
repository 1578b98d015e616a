"""One solution serves all moduli, exactly: against the inner scheme at every one of them."""

from dataclasses import replace

import numpy as np
import pytest
from law_samples import sample

from validate.errors import SceneError
from validate.scene.geometries.box import box
from validate.scene.laws import Coefficients
from validate.scene.material import Material, Region
from validate.scene.scene import Drive, Load, Scene, Support
from validate.solve.march import run_scheme
from validate.solve.static.newton import StaticNewton
from validate.solve.static.proportional import Proportional
from validate.solve.static.quasi_static import QuasiStatic

T, INPUTS, AT = np.array([1.0, 2.0]), np.array([[0.002], [0.005]]), np.array([1])
NEWTON = StaticNewton("none")


def strip(material: Material) -> Scene:
    return Scene(
        box((0.03, 0.02), (3, 2)),
        material,
        (Support("x0", (0, 1)),),
        drives=(Drive("pull", "x1", (1.0, 0.0)),),
        plane="stress",
    )


@pytest.mark.parametrize("name", ["linear", "svk", "yeoh", "ogden"])
def test_forces_and_fields_are_those_of_the_inner_scheme(name: str) -> None:
    for E in (3.0, 4e5):
        linear = name == "linear"
        material = Material(E, 0.4) if linear else sample(name, E, 0.4)
        inner = QuasiStatic() if linear else NEWTON
        ours, theirs = (
            run_scheme("", s, strip(material), T, INPUTS, AT) for s in (Proportional(inner), inner)
        )
        assert ours.finished
        force = theirs.traces["pull.force"].y
        assert ours.traces["pull.force"].y == pytest.approx(force, rel=1e-7)
        assert np.abs(ours.u - theirs.u).max() < 1e-10
        assert ours.traces["pull.displacement"].y.tolist() == INPUTS[:, 0].tolist()


def test_coefficients_of_another_ratio_are_another_body() -> None:
    """What is kept must not be taken for what it is not."""
    forces = [
        run_scheme("", Proportional(NEWTON), strip(m), T, INPUTS, AT).traces["pull.force"].y[-1]
        for C20 in (0.0, 0.3, 1.0)
        for m in [Material(1.0, 0.4, "yeoh", coefficients=Coefficients(C20=C20))]
    ]
    assert forces[0] < forces[1] < forces[2]


def test_what_pushes_back_by_itself_is_refused() -> None:
    scene = strip(sample("neo_hooke", 10.0, 0.4))
    loaded = replace(scene, loads=(Load("weight", "y1", (0.0, -1.0)),))
    stiff = replace(
        scene, regions=(Region("stiff", np.array([0]), sample("neo_hooke", 20.0, 0.4)),)
    )
    for one in (loaded, stiff):
        with pytest.raises(SceneError, match="drives alone"):
            Proportional(NEWTON).solve(one, T, INPUTS)
