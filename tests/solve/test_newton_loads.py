"""Static Newton under dead loads: balance, nu near .5 from rest to the whole load, failures."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from explicit_scenes import pulled, ran
from law_samples import NAMES, sample

from validate.errors import SceneError
from validate.fem.large_strain.hyperelastic import Body
from validate.fem.system import System, build
from validate.scene.geometries.box import box, grid
from validate.scene.material import LawName, Material, Region
from validate.scene.scene import Dilatation, Drive, Load, Scene, Support, Weight
from validate.solve.dynamic.implicit import NewtonDynamics
from validate.solve.march import march
from validate.solve.static.newton import StaticNewton
from validate.solve.types import State

SIZE, G = (0.1, 0.03, 0.03), 9.80709


@cache
def beam(
    kind: str, dilatation: Dilatation, nu: float = 0.499, law: LawName = "neo_hooke"
) -> System:
    """The silicone beam, clamped at x0, under its own weight and a load at its end."""
    mesh = grid(SIZE, (6, 2, 2)) if kind == "hex8" else grid(SIZE, (3, 2, 2))
    mesh = box(SIZE, (4, 2, 2)) if kind.startswith("tet") else mesh
    scene = Scene(
        mesh if kind in ("hex8", "tet4") else mesh.quadratic(),
        Material(263_824.0, nu, law, 1070.0),
        (Support("x0", (0, 1, 2)),),
        loads=(Weight("gravity", (0.0, 0.0, -1.0)), Load("tip", "x1", (0.0, 0.0, -1.0))),
        dilatation=dilatation,
    )
    return build(scene)


def loaded(system: System, *inputs: float, **settings: float) -> tuple[State, float]:
    """The state under the inputs, in one step from rest, and the end's mean motion along z mm."""
    stepper = StaticNewton(**settings).prepare(system)  # type: ignore[arg-type]
    state = stepper.step(stepper.rest(), np.array(inputs))
    return state, 1e3 * float(stepper.field(state)[system.scene.mesh.facet_nodes("x1"), 2].mean())


def test_a_load_is_in_balance_and_steps_do_not_matter() -> None:
    system = pulled("neo_hooke")
    run = ran(StaticNewton(), system, np.array([20.0, 40.0]), 0.01)
    assert run.finished
    residual = Body(system.scene).force(run.u[0].ravel()) - 40.0 * system.loads[:, 0]
    assert np.abs(residual[system.free]).max() < 1e-8
    assert run.u[0][:, 0].max() > 0.01
    assert run.u[0] == pytest.approx(loaded_field(system, 40.0), abs=1e-10)


def loaded_field(system: System, *inputs: float) -> np.ndarray:
    stepper = StaticNewton().prepare(system)
    return stepper.field(stepper.step(stepper.rest(), np.array(inputs)))


CASES: list[tuple[str, Dilatation]] = [
    ("hex8", "mixed"), ("hex27", "mixed"), ("tet10", "mixed"), ("tet10", "pointwise"),
    ("tet4", "nodal_mean"),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("nu", [0.499, 0.4999])
@pytest.mark.parametrize(("kind", "dilatation"), CASES)
def test_every_element_takes_the_whole_load_in_one_step(
    kind: str, dilatation: Dilatation, nu: float
) -> None:
    """Gravity, and ten times it with 5 N at the end: what Newton on the displacements' residual
    did not reach at 1/100 of it. Without a cut a few dozen iterations are allowed, not needed."""
    system = beam(kind, dilatation, nu)
    state, moved = loaded(system, G, 0.0, max_cuts=0)
    assert state.failure is None
    assert state.updates <= 12
    far, further = loaded(system, 10 * G, 5.0, max_cuts=3)
    assert far.failure is None
    assert further < -50 < 5 * moved
    assert Body(system.scene).inverted(far.inner.u) is None


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_every_law_hangs_alike_where_strains_are_small(name: str) -> None:
    """The split forms in mixed cells, the coupled ones in quadratic tetrahedra."""
    law = replace(sample(name, 263_824.0, 0.499), rho=1070.0)
    split = law.coefficients.volumetric == "split"
    system = beam("hex8", "mixed") if split else beam("tet10", "pointwise")
    ours = loaded(build(replace(system.scene, material=law)), G, 0.0)[1]
    theirs = loaded(system, G, 0.0)[1]
    assert ours == pytest.approx(theirs, rel=0.02)
    assert (ours != theirs) == (name != "neo_hooke")


def test_drives_and_loads_act_together() -> None:
    """A plate holds the end at z = 0: its force is the beam's end reaction, 3/8 of the weight."""
    scene = beam("hex27", "mixed").scene
    scene = replace(scene, drives=(Drive("plate", "x1", (0.0, 0.0, -1.0)),), loads=scene.loads[:1])
    state, moved = loaded(build(scene), 0.0, G)
    weight = 1070 * G * float(np.prod(SIZE))
    assert moved == pytest.approx(0.0, abs=1e-12)
    assert state.numbers["plate.force"] == pytest.approx(-3 / 8 * weight, rel=0.02)


def test_a_stiff_and_heavy_half_hangs_as_its_materials_say() -> None:
    """Two densities, moduli and laws: the outer half stiffer by ten and twice as heavy."""
    scene = beam("hex8", "mixed").scene
    outer = np.flatnonzero(scene.mesh.nodes[scene.mesh.cells, 0].mean(axis=1) > 0.05)
    heavy = Material(2_638_240.0, 0.45, "svk", 2140.0)
    whole = replace(scene, regions=(Region("outer", outer, heavy),))
    light = replace(whole, regions=(Region("outer", outer, replace(heavy, rho=1070.0)),))
    moved = [loaded(build(s), G, 0.0)[1] for s in (whole, scene, light)]
    assert moved[0] < moved[1] < moved[2] < 0
    # Half the mass, at three quarters of the length: the clamp's moment rises to 7/4.
    assert moved[0] / moved[2] == pytest.approx(7 / 4, rel=0.06)


@pytest.mark.slow
def test_what_finds_no_equilibrium_names_the_load_and_what_helps() -> None:
    """The cube folds under 44 N, however large the step that leads beyond."""
    for whole in (-50.0, -100.0, -300.0):
        run = ran(StaticNewton(), pulled(cells=2), np.array([0.0, whole]), 0.01)
        assert (run.outcome.state, run.outcome.step) == ("not_converged", 1)
        reached = re.search(r"beyond (-\d+\.?\d*) N \((\d+\.?\d*) % of", run.outcome.why)
        assert reached is not None
        newton, share = map(float, reached.groups())
        assert newton == pytest.approx(share / 100 * whole, rel=0.01)
        assert -44.5 < newton < -40
    state, _ = loaded(beam("hex8", "mixed"), G, 0.0, max_iterations=1, max_cuts=1)
    assert state.failure is not None
    assert state.failure[1].endswith(
        "last good load 0 m/s^2, 0 N (0 % of the step); take more cuts or smaller steps"
    )


def test_a_loose_body_is_refused() -> None:
    with pytest.raises(SceneError, match="not positive definite"):
        StaticNewton().prepare(build(replace(pulled().scene, supports=())))


@pytest.mark.slow
@pytest.mark.parametrize("dt", [0.002, 0.01])
def test_a_swing_near_nu_one_half_takes_steps_of_ten_milliseconds(dt: float) -> None:
    """The first half swing of 62 ms goes twice as deep as the beam hangs at rest."""
    system = beam("hex8", "mixed")
    steps = round(0.06 / dt)
    t, inputs = dt * np.arange(1, steps + 1), np.tile([G, 0.0], (steps, 1))
    stepper = NewtonDynamics(dt, max_iterations=6).prepare(system)
    run = march("swing", stepper, t, inputs, np.array([steps - 1]), 0.0)
    assert run.finished, run.outcome.why
    deepest = 1e3 * run.u[0][system.scene.mesh.facet_nodes("x1"), 2].mean()
    assert deepest == pytest.approx(2 * loaded(system, G, 0.0)[1], rel=0.1)


def test_a_swing_ten_times_as_hard_takes_a_few_iterations_a_step() -> None:
    """With the pressures of the displacements themselves it ends in the third step."""
    stepper = NewtonDynamics(0.01, max_iterations=6).prepare(beam("hex8", "mixed", 0.4999))
    t, inputs = 0.01 * np.arange(1, 4), np.tile([10 * G, 0.0], (3, 1))
    assert march("swing", stepper, t, inputs, np.array([2]), 0.0).finished


def test_a_column_does_not_stand_beyond_the_load_of_euler() -> None:
    """Straight it stays in balance, but pi^2 E I/(4 L^2) = 20.6 mN is where it ceases to be stable;
    two cells of hex8 across are a tenth and more too stiff in bending."""
    scene = Scene(
        grid((0.1, 0.01, 0.01), (10, 2, 2)),
        Material(1e5, 0.499, "neo_hooke"),
        (Support("x0", (0, 1, 2)),),
        loads=(Load("press", "x1", (-1.0, 0.0, 0.0)),),
        dilatation="mixed",
    )
    run = ran(StaticNewton(), build(scene), np.array([0.05]), 1.0)
    assert run.outcome.state == "not_converged"
    reached = re.search(r"beyond (\d+\.\d+) N .* the equilibrium is unstable", run.outcome.why)
    assert reached is not None
    assert 0.0195 < float(reached.group(1)) < 0.028
