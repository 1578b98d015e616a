"""Viscoelastic bodies in time: the curve of the material point, and a swing that dies away."""

from dataclasses import replace

import numpy as np
import pytest
from explicit_scenes import pressed, pulled, ran, rise
from law_samples import SPLIT

from validate.arrays import Floats
from validate.errors import SceneError
from validate.estimate.extended.node_ekf import NodeEKF
from validate.fem.assembly.assemble import stiffness
from validate.fem.critical import CriticalStep
from validate.fem.large_strain.hyperelastic import Body
from validate.fem.laws.law import stiffened
from validate.fem.laws.plane_stress import response
from validate.fem.laws.viscoelasticity import cell_branches
from validate.fem.system import System, build
from validate.scene.geometries.box import grid
from validate.scene.material import Prony, Region
from validate.scene.meshless import MaterialPoint
from validate.scene.scene import Dilatation, Support
from validate.solve.dynamic.implicit import NewtonDynamics
from validate.solve.explicit.central import CentralDifference, CentralStepper
from validate.solve.handles import require_handled
from validate.solve.march import march
from validate.solve.static.newton import StaticNewton
from validate.solve.types import Scheme

# private: _increment_energy: called alone, case by case.

SERIES = Prony((0.8, 0.4), (0.05, 1.0))
SIDE = 0.1


def relaxing(system: System, series: Prony = SERIES, rho: float | None = None) -> System:
    material = system.scene.material
    return build(
        replace(
            system.scene,
            material=replace(material, prony=series, rho=material.rho if rho is None else rho),
        )
    )


CASES: list[tuple[str, Dilatation]] = [
    ("neo_hooke", "nodal_mean"),
    ("yeoh", "mixed"),
    ("ogden", "pointwise"),
]


@pytest.mark.parametrize(("law", "dilatation"), CASES)
def test_a_light_body_follows_the_material_point(law: str, dilatation: Dilatation) -> None:
    """Uniaxial compression in 25 steps: no inertia to speak of, the same recursion, one curve."""
    scene = pressed(law).scene
    mesh = scene.mesh.quadratic() if dilatation == "mixed" else scene.mesh
    system = relaxing(build(replace(scene, body=mesh, dilatation=dilatation)), rho=1e-6)
    dt, depths = 0.02, rise(25, 0.02)
    scheme = NewtonDynamics(dt, "backward_euler", "consistent")
    force = ran(scheme, system, depths, dt).traces["plate.force"].y
    stretch = 1 - np.concatenate([[0.0], depths]) / SIDE
    point = MaterialPoint(system.scene.material, "uniaxial")
    exact = -(SIDE**2) * response(point, stretch, dt * np.arange(26))["nominal_stress"]
    assert force == pytest.approx(exact[1:], rel=1e-6, abs=1e-6 * exact.max())


def test_statics_are_the_limit_that_the_series_says() -> None:
    forces = {}
    for limit in ("relaxed", "instantaneous"):
        system = relaxing(pressed("yeoh"), replace(SERIES, statics=limit))
        exact = MaterialPoint(system.scene.material, "uniaxial")
        stress = response(exact, np.array([0.8]))["nominal_stress"][0]
        found = ran(StaticNewton(), system, np.array([0.01, 0.02]), 0.01).traces["plate.force"].y
        assert found[-1] == pytest.approx(-(SIDE**2) * stress, rel=1e-7)
        forces[limit] = found[-1]
    assert forces["instantaneous"] / forces["relaxed"] == pytest.approx(2.2, rel=0.1)


@pytest.mark.parametrize(
    "scheme",
    [NewtonDynamics(1e-3), pytest.param(CentralDifference(1e-3), marks=pytest.mark.slow)],
)
def test_a_step_is_the_same_whoever_stepped_before(scheme: Scheme) -> None:
    """What branches remember is in the state, not in the scheme."""
    stepper = scheme.prepare(relaxing(pressed("neo_hooke")))
    first = stepper.step(stepper.rest(), np.array([0.0005]))
    once = stepper.step(first, np.array([0.001]))
    stepper.step(once, np.array([0.002]))
    again = stepper.step(first, np.array([0.001]))
    assert once.failure is None
    assert np.array_equal(stepper.field(again), stepper.field(once))
    assert again.numbers == once.numbers


def swing(system: System, series: Prony) -> tuple[complex, Floats]:
    """s 1/s of the mode that the load excites most, for which s^2 M + K + K_iso sum g s tau/(1 +
    s tau) is singular, and what a field (free,) m has of it."""
    scene, free, masses = system.scene, system.free, system.masses[system.free]
    K = stiffness(scene).toarray()[np.ix_(free, free)]
    more = stiffened(scene.material, 2.0)
    Ki = stiffness(replace(scene, material=more)).toarray()[np.ix_(free, free)] - K
    K, Ki = (A / np.sqrt(np.outer(masses, masses)) for A in (K, Ki))
    squares, modes = np.linalg.eigh(K)
    at = np.argmax((modes.T @ (system.loads[free, 0] / np.sqrt(masses))) ** 2 / squares**2)
    s, mode = 1j * np.sqrt(squares[at]), modes[:, at] + 0j
    for _ in range(30):
        lag = sum(g * s * tau / (1 + s * tau) for g, tau in zip(series.g, series.tau, strict=True))
        found, vectors = np.linalg.eig(-(K + lag * Ki))
        same = np.argmax(np.abs(mode @ vectors) / np.linalg.norm(vectors, axis=0))
        s, mode = np.sqrt(found[same] + 0j), vectors[:, same]
        s = s if s.imag > 0 else -s
    return complex(s), np.asarray(modes[:, at] * np.sqrt(masses))


RING = Prony((0.3,), (0.02,))


def ring_down(scheme: Scheme, dt: float, n: int) -> tuple[complex, complex]:
    """Predicted and seen s of a cube on slip planes whose small load is dropped."""
    supports = tuple(Support(f"{axis}0", (i,)) for i, axis in enumerate("xyz"))
    system = relaxing(build(replace(pulled("neo_hooke", 1).scene, supports=supports)), RING)
    (exact, mode), up, t = swing(system, RING), n // 4, dt * np.arange(1, n + 1)
    load = np.concatenate([rise(up, 0.01), np.zeros(n - up)])[:, None]
    run = march("ring", scheme.prepare(system), t, load, np.arange(n), 0.0)
    late = run.u.reshape(n, -1)[up + n // 8 :, system.free] @ mode
    # A pair of exponentials: x'' = a x' + b x at instants a quarter of a period apart.
    k = int(np.pi / 2 / exact.imag / dt)
    A = np.stack([late[k:-k], late[: -2 * k]], axis=1)
    (a, b), *_ = np.linalg.lstsq(A, late[2 * k :], rcond=None)
    roots = np.roots([1, -a, -b])
    return exact, complex(np.log(roots[np.argmax(roots.imag)]) / (k * dt))


@pytest.mark.slow
@pytest.mark.parametrize("scheme", [NewtonDynamics(1e-3), CentralDifference(1e-3)])
def test_a_swing_dies_away_as_the_loss_factor_says(scheme: Scheme) -> None:
    exact, seen = ring_down(scheme, 1e-3, 400)
    assert seen.imag == pytest.approx(exact.imag, rel=0.005)
    assert seen.real == pytest.approx(exact.real, rel=0.02)
    assert exact.real < -0.02 * exact.imag


@pytest.mark.parametrize(
    "law",
    ["neo_hooke", *(pytest.param(n, marks=pytest.mark.slow) for n in SPLIT[2:])],
)
def test_explicit_forces_are_those_of_the_numpy_body(law: str) -> None:
    """Steps of a body with two regions, its memory followed beside it: to rounding."""
    whole = relaxing(pulled(law, 2)).scene
    other = replace(whole.material, prony=Prony((0.5,), (0.3,)))
    scene = replace(whole, regions=(Region("other", np.arange(10, 30), other),))
    system, dt = build(scene), 1e-3
    stepper = CentralDifference(dt).prepare(system)
    body, branches = Body(scene), cell_branches(scene)
    assert branches is not None
    memory, state = branches.at_rest(body.weights.shape), stepper.rest()
    for force in (30.0, 60.0, 60.0, 60.0):
        state = stepper.step(state, np.array([force]))
        assert state.failure is None
        u = stepper.field(state).ravel()
        exact = body.after(branches, memory, dt).force(u)
        memory = branches.advanced(memory, body.isochoric(u), dt)
        found = state.inner.motion["r"]
        assert np.abs(found - exact).max() < 1e-13 * body.unit_force
    assert np.abs(found - body.force(u)).max() > 0.1 * np.abs(exact).max()


@pytest.mark.slow
def test_explicit_steps_converge_to_implicit_ones_with_order_two() -> None:
    system, T = relaxing(pulled("neo_hooke", 2), Prony((0.8,), (0.01,))), 0.02
    exact = ran(NewtonDynamics(T / 160), system, rise(160, 15.0), T / 160).u[0]
    errors = []
    for n in (10, 20):
        run = ran(CentralDifference(T / n), system, rise(n, 15.0), T / n)
        assert run.finished
        errors.append(float(np.abs(run.u[0] - exact).max()))
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.25)


def test_the_critical_step_is_that_of_the_instantaneous_moduli() -> None:
    soft = pulled("neo_hooke", 2)
    hard = replace(soft.scene, material=stiffened(soft.scene.material, SERIES.instant))
    limits = [
        CentralDifference().prepare(system).rest().numbers["critical_step"]
        for system in (relaxing(soft), build(hard))
    ]
    assert limits[0] == pytest.approx(limits[1], rel=1e-12)
    assert CriticalStep.of(relaxing(soft)) == CriticalStep.of(build(hard))
    slow = relaxing(soft, Prony(SERIES.g, (1.0, 2.0)))
    for share, ending in ((0.95, "finished"), (1.2, "diverged")):
        dt = share * limits[0]
        scheme = CentralDifference(dt, beyond_limit="run", margin=0.0)
        assert ran(scheme, slow, np.full(600, 0.1), dt).outcome.state == ending


def test_what_an_increment_holds_is_of_the_relaxed_body() -> None:
    """The look at divergence compares with energies of the relaxed law, so its d K d/8 is, too."""
    system, dt = relaxing(pressed("neo_hooke"), Prony((5.0,), (10.0,))), 5e-4
    stepper = CentralDifference(dt).prepare(system)
    assert isinstance(stepper, CentralStepper)
    state = stepper.rest()
    for depth in (0.001, 0.002, 0.003):
        state = stepper.step(state, np.array([depth]))
    motion, body = state.inner.motion, Body(system.scene)
    u, d = motion["u"], motion["d"]
    exact = float(d @ (body.force(u) - body.force(u - d))) / 8
    assert stepper._increment_energy(motion, 0.5, np.inf) == pytest.approx(exact, rel=1e-9)


def test_what_explicit_branches_do_not_have_is_refused() -> None:
    system = relaxing(pulled("neo_hooke", 2))
    with pytest.raises(SceneError, match="2 threads: a viscoelastic body"):
        CentralDifference(threads=2).prepare(system)
    bricks = grid((SIDE, SIDE, SIDE), (2, 2, 2))
    with pytest.raises(SceneError, match="explicit hexahedra do not support"):
        CentralDifference().prepare(build(replace(system.scene, body=bricks, dilatation="mixed")))


def test_schemes_that_remember_nothing_refuse_a_series() -> None:
    system = relaxing(pulled("neo_hooke", 2))
    with pytest.raises(SceneError, match="NodeEKF does not support a Prony"):
        require_handled(system.scene, NodeEKF())
    assert NewtonDynamics.handles.covers(system.scene)
