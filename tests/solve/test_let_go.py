"""A beam that is let go: modes about rest and the march are one where motion is small."""

from dataclasses import replace

import numpy as np
import pytest

from validate.errors import SceneError
from validate.fem.system import build
from validate.scene.geometries.box import grid
from validate.scene.material import Material, Prony, Region
from validate.scene.places import OnPlane
from validate.scene.scene import Mass, Probe, Scene, Support, Weight
from validate.solve.dynamic.implicit import NewtonDynamics
from validate.solve.dynamic.release import LetGo
from validate.solve.dynamic.viscous_modes import ViscousModes
from validate.solve.march import march, run_scheme
from validate.solve.static.newton import StaticNewton
from validate.solve.types import Run

RELAXING = Prony((0.25, 0.05), (0.02, 0.5))
SCENE = Scene(
    grid((0.06, 0.03, 0.03), (2, 1, 1)),
    Material(264e3, 0.49, "neo_hooke", 1070.0, prony=RELAXING),
    (Support("x0", (0, 1, 2)),),
    loads=(Weight("gravity", (0.0, 0.0, -1.0)),),
    masses=(Mass("load", OnPlane((0.06, 0, 0), (1.0, 0, 0)).faces, 0.01),),
    probes=(Probe("tip", (0.06, 0.015, 0.015)),),
    dilatation="mixed",
)
DT = 0.002
T = DT * np.arange(1, 61)


def inputs(g: float, t: np.ndarray = T) -> np.ndarray:
    return np.full((len(t), 1), g)


def marched(scene: Scene, g: float, dt: float = DT) -> Run:
    settings = NewtonDynamics(dt, mass="consistent", tolerance=1e-7)
    t = dt * np.arange(1, round(T[-1] / dt) + 1)
    stepper = replace(settings.prepare(build(scene)), held=np.array([g]))
    return march("m", stepper, t, inputs(g, t), np.array([len(t) - 1]), 0.0)


def modal(scene: Scene, g: float, t: np.ndarray = T) -> Run:
    return run_scheme("r", ViscousModes(24), scene, t, inputs(g, t), np.array([len(t) - 1]))


@pytest.mark.slow
def test_small_vibrations_are_those_of_the_large_strain_march() -> None:
    """What is left is the march's own error of order two."""
    errors = []
    for dt in (DT, DT / 2):
        z = modal(SCENE, 0.1).traces["tip.z"].y
        y = marched(SCENE, 0.1, dt).traces["tip.z"].y[round(DT / dt) - 1 :: round(DT / dt)]
        errors.append(float(np.abs(y - z).max() / np.ptp(z)))
    assert errors[0] < 0.02
    assert errors[1] < 0.4 * errors[0]


def test_a_load_that_is_held_from_the_start_moves_twice_as_far_in_the_first_step() -> None:
    """a t^2 / 2, where a load that comes with the step is half of it in the mean."""
    dt = 1e-5
    late = NewtonDynamics(dt, mass="consistent").prepare(build(SCENE))
    fell = [
        march("m", one, np.array([dt]), np.array([[9.8]]), np.array([0]), 0.0).traces["tip.z"].y[0]
        for one in (late, replace(late, held=np.array([9.8])))
    ]
    assert fell[1] / fell[0] == pytest.approx(2.0, rel=1e-3)


def test_the_body_ends_in_its_relaxed_equilibrium() -> None:
    late = np.array([0.5, 20.0])
    run = run_scheme("r", ViscousModes(8), SCENE, late, inputs(9.8, late), np.array([1]))
    static = StaticNewton("none").prepare(build(SCENE))
    still = march("s", static, late[:1], inputs(9.8, late[:1]), np.array([0]), 0.0)
    assert run.u[0] == pytest.approx(still.u[0], abs=1e-9)
    assert run.traces["gravity.acceleration"].y.tolist() == [9.8, 9.8]


def test_a_series_changes_what_follows_though_the_body_is_remembered() -> None:
    stiff = modal(SCENE, 0.1).traces["tip.z"].y
    bare = replace(SCENE, material=replace(SCENE.material, prony=Prony()))
    free = modal(bare, 0.1).traces["tip.z"].y
    assert free.min() < 1.2 * stiff.min()  # undamped, it swings farther
    heavy = replace(bare, material=replace(bare.material, rho=5000.0))
    assert modal(heavy, 0.1).traces["tip.z"].y.min() < 1.5 * free.min()  # another body is another


@pytest.mark.slow
def test_let_go_is_the_march_and_then_the_equilibrium() -> None:
    t = np.append(T[:20], 3.0)
    run = run_scheme("l", LetGo(DT), SCENE, t, inputs(9.8, t), np.array([20]))
    assert run.finished
    assert run.t.tolist() == t.tolist()
    own = marched(SCENE, 9.8)
    assert run.traces["tip.z"].y[:20] == pytest.approx(own.traces["tip.z"].y[:20], abs=1e-12)
    static = StaticNewton("none").prepare(build(SCENE))
    still = march("s", static, t[:1], inputs(9.8, t[:1]), np.array([0]), 0.0)
    assert run.u[0] == pytest.approx(still.u[0], abs=1e-8)


def test_what_they_cannot_do_is_refused() -> None:
    with pytest.raises(SceneError, match="ViscousModes needs constant loads"):
        run_scheme("r", ViscousModes(), SCENE, T, inputs(9.8) * T[:, None], np.array([0]))
    stiff = Region("half", np.array([0]), replace(SCENE.material, E=1e6))
    with pytest.raises(SceneError, match="needs one material"):
        modal(replace(SCENE, regions=(stiff,)), 9.8)
    with pytest.raises(SceneError, match=r"steps of dt = 0\.004 s"):
        run_scheme("l", LetGo(2 * DT), SCENE, T, inputs(9.8), np.array([0]))
    with pytest.raises(SceneError, match="0 modes: expected at least 1"):
        ViscousModes(0)
