"""Dynamics at large strain from a static equilibrium: at small strain it is linear dynamics."""

from dataclasses import replace

import numpy as np
import pytest

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.system import build
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.scene import Load, Scene, Support, Weight
from validate.solve.dynamic.implicit import FromEquilibrium
from validate.solve.dynamic.newmark import Newmark
from validate.solve.march import run_scheme
from validate.solve.static.newton import StaticNewton
from validate.solve.types import Scheme

DT, STEPS = 2e-3, 60
BAR = Scene(
    box((0.06, 0.02, 0.02), (4, 1, 1)),
    Material(30e3, 0.3, "neo_hooke", 1000.0, stiffness_damping=1e-3),
    (Support("x0", (0, 1, 2)),),
    loads=(Load("load", "x1", (0.0, 0.0, -1.0)), Weight("gravity", (0.0, 0.0, -1.0))),
)
LINEAR = replace(BAR, material=replace(BAR.material, law="linear"))


def moved(scheme: Scheme, scene: Scene, inputs: Floats) -> Floats:
    """Fields (nt, n, 3) m at all steps."""
    t = DT * np.arange(1, len(inputs) + 1)
    run = run_scheme("", scheme, scene, t, inputs, np.arange(len(t)))
    assert run.finished, run.outcome
    return run.u


def constant(force: float) -> Floats:
    return np.tile([force, 0.0], (STEPS, 1))


@pytest.mark.parametrize("preload", [(), (1e-5, 0.0), (0.0, 1e-3)])
def test_small_motions_are_linear_whatever_the_body_rests_under(preload: tuple[float, ...]) -> None:
    """Let go or pushed: both start with the load in full."""
    inputs = constant(-1e-5)
    u = moved(FromEquilibrium(DT, preload=preload), BAR, inputs)
    v = moved(Newmark(DT), LINEAR, inputs)
    assert np.abs(u - v).max() < 1e-3 * np.abs(v).max()


def test_a_load_that_rises_starts_without_acceleration() -> None:
    ramp = np.outer(np.linspace(1 / STEPS, 1, STEPS), (1e-5, 0.0))
    u = moved(FromEquilibrium(DT, a0="zero"), BAR, ramp)
    v = moved(Newmark(DT, a0="zero"), LINEAR, ramp)
    assert np.abs(u - v).max() < 1e-3 * np.abs(v).max()


def test_what_is_let_go_comes_to_rest_undeformed() -> None:
    """From a bend of a third of its length, by heavy damping."""
    damped = replace(BAR, material=replace(BAR.material, stiffness_damping=0.05))
    held = 0.2
    u = moved(FromEquilibrium(20 * DT, preload=(held, 0.0)), damped, constant(-held))
    static = StaticNewton("none").prepare(build(BAR))
    bent = static.field(static.step(static.rest(), np.array([held, 0.0])))
    assert np.abs(bent).max() > 0.01
    np.testing.assert_allclose(u[-1], -bent, atol=0.02 * np.abs(bent).max())


def test_a_preload_of_other_inputs_is_refused() -> None:
    with pytest.raises(SceneError, match=r"3 numbers.*2 inputs"):
        FromEquilibrium(DT, preload=(1.0, 2.0, 3.0)).prepare(build(BAR))


def test_an_equilibrium_that_is_not_found_is_named() -> None:
    t = DT * np.arange(1, 4)
    inputs = np.zeros((3, 2))
    run = run_scheme("", FromEquilibrium(DT, preload=(-1e4, 0.0)), BAR, t, inputs, np.arange(3))
    assert not run.finished
    assert run.outcome.why.startswith("at rest: ")
