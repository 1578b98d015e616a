"""Modal superposition: equal to Newmark, exact in time, exact in statics, whole clusters."""

from dataclasses import replace
from types import SimpleNamespace
from typing import get_args

import numpy as np
import pytest
from field_oracles import frequency_range
from inertial_scenes import TOTAL, cube, driven, exact, small

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.critical import Modes
from validate.fem.system import System, build
from validate.scene.geometries.box import box, centroids
from validate.scene.material import Material, Region
from validate.scene.mesh import Mesh
from validate.scene.scene import Load, Scene, Support
from validate.solve.dynamic.modal import Modal, exact_walk
from validate.solve.dynamic.newmark import Newmark
from validate.solve.dynamic.newmark_rule import RuleName
from validate.solve.march import march
from validate.solve.static.quasi_static import QuasiStatic
from validate.solve.types import Run, Scheme


def run(scheme: Scheme, system: System, inputs: Floats, dt: float = 0.002) -> Run:
    t = dt * np.arange(1, len(inputs) + 1)
    return march("m", scheme.prepare(system), t, inputs, np.arange(len(t)), 0.0)


@pytest.mark.parametrize("rule", get_args(RuleName))
def test_all_modes_by_a_rule_are_newmark(rule: RuleName) -> None:
    """To 1e-10, the force of the drive too, which has shares of damping and inertia."""
    inputs = np.stack([0.001 * np.sin(np.arange(40) / 5), np.cos(np.arange(40) / 9)], axis=1)
    one = run(Newmark(0.002, rule, "zero"), driven(), inputs)
    two = run(Modal(0.002, None, rule, a0="zero"), driven(), inputs)
    assert np.abs(one.u - two.u).max() < 1e-10 * np.abs(one.u).max()
    forces = one.traces["press.force"].y, two.traces["press.force"].y
    assert forces[1] == pytest.approx(forces[0], abs=1e-10 * np.abs(forces[0]).max())


def test_all_525_modes_of_paper_001s_block_are_newmark() -> None:
    system, load = cube(), np.full((100, 1), TOTAL)
    one, two = (run(s, system, load) for s in (Newmark(), Modal(propagate="average")))
    assert len(system.free) == 525
    assert np.abs(one.u - two.u).max() < 1e-10 * np.abs(one.u).max()


@pytest.mark.parametrize("dt", [1e-4, 2e-3, 0.1])
@pytest.mark.parametrize("damping", [0.0, 0.0005, 0.00227, 0.1])
def test_a_load_that_is_switched_on_is_followed_exactly(damping: float, dt: float) -> None:
    """From undamped to overdamped, whatever the step: against the exponential of the system."""
    system = small(0.0, damping)
    unit = system.loads[system.free]
    got = run(Modal(dt), system, np.ones((5, 1)), dt).u[-1].ravel()[system.free]
    truth = exact(system, unit, np.zeros((1, 1)), np.ones(1), 5 * dt)[: len(system.free)]
    assert np.abs(got - truth).max() < 1e-9 * np.abs(truth).max()
    held = run(Modal(dt, propagate="constant"), system, np.ones((5, 1)), dt).u[-1]
    assert held.ravel()[system.free] == pytest.approx(got, abs=1e-9 * np.abs(got).max())


def test_critical_damping_has_its_own_formula() -> None:
    """alpha_1 = 2/w makes two roots one in that mode."""
    omega = float(Modes.of(small(0.0, 0.0)).omega[3])
    test_a_load_that_is_switched_on_is_followed_exactly(2 / omega, 0.01)
    test_a_load_that_is_switched_on_is_followed_exactly(2 / omega * (1 + 1e-9), 0.01)


@pytest.mark.parametrize("dt", [1e-3, 0.05])
def test_a_ramp_is_followed_exactly(dt: float) -> None:
    system = small()
    ramp = dt * np.arange(1, 6)[:, None]
    got = run(Modal(dt, a0="zero"), system, ramp, dt).u[-1].ravel()[system.free]
    forces = system.loads[system.free] @ np.array([[1.0, 0.0]])
    grow = np.array([[0.0, 1.0], [0.0, 0.0]])
    truth = exact(system, forces, grow, np.array([0.0, 1.0]), 5 * dt)[: len(system.free)]
    assert np.abs(got - truth).max() < 1e-9 * np.abs(truth).max()


@pytest.mark.parametrize("damping", [0.0, 0.1])
def test_stiff_modes_need_no_small_steps(damping: float) -> None:
    """Frequencies over two decades, dampings to 1e8 1/s: one step of .1 s or fifty."""
    system = cube(damping, (2, 2, 3))
    fine = run(Modal(0.002), system, np.full((50, 1), TOTAL)).u[-1]
    coarse = run(Modal(0.1), system, np.full((1, 1), TOTAL), 0.1).u[-1]
    assert np.abs(fine - coarse).max() < 1e-9 * np.abs(fine).max()


def test_creep_under_heavy_damping_keeps_its_digits() -> None:
    """alpha_1 = 1e4 s: u = u_static (1 - exp(-t/alpha_1)), two roots 13 decades apart and more."""
    system, load = cube(1e4, (2, 2, 3)), np.full((1, 1), TOTAL)
    u = run(QuasiStatic(), system, load).u[-1] * -np.expm1(-0.1 / 1e4)
    for propagate, within in (("constant", 1e-8), ("linear", 1e-5)):
        crept = run(Modal(0.1, propagate=propagate), system, load, 0.1).u[-1]  # type: ignore[arg-type]
        assert np.abs(crept - u).max() < within * np.abs(u).max()


def test_static_correction_ends_in_statics() -> None:
    """Three modes of 36: exact statics with the correction, an error of percents without."""
    inputs = np.tile([0.002, 5.0], (600, 1))
    static = run(QuasiStatic(), driven(), inputs[:1])
    corrected = run(Modal(0.02, 3), driven(), inputs, 0.02)
    plain = run(Modal(0.02, 3, static_correction=False), driven(), inputs, 0.02)
    scale = np.abs(static.u).max()
    assert np.abs(corrected.u[-1] - static.u[0]).max() < 1e-10 * scale
    assert np.abs(plain.u[-1] - static.u[0]).max() > 0.01 * scale
    force = corrected.traces["press.force"].y[-1]
    assert force == pytest.approx(static.traces["press.force"].y[0], rel=1e-9)


def twins() -> System:
    """Two equal blocks that do not touch: every frequency is there twice."""
    one = box((0.1, 0.1, 0.1), (1, 1, 1))
    n = len(one.nodes)
    both = Mesh(
        np.vstack([one.nodes, one.nodes + [0.3, 0, 0]]),
        np.vstack([one.cells, one.cells + n]),
        "tet4",
        {name: np.vstack([f, f + n]) for name, f in one.facets.items()},
    )
    return build(
        Scene(
            both,
            Material(1e5, 0.3, rho=1000.0, stiffness_damping=0.001),
            (Support("z0", (0, 1, 2)),),
            loads=(Load("push", "z1", (1.0, 0.0, 0.0)),),
        )
    )


def test_clusters_are_taken_whole() -> None:
    system = twins()
    for asked, given in ((1, 2), (2, 2), (3, 4), (5, 6)):
        modes = Modes.of(system, asked)
        assert len(modes.omega) == given
        assert modes.omega[::2] == pytest.approx(modes.omega[1::2], rel=1e-10)
    # Half of a cluster would move one twin and not the other.
    u = run(Modal(modes=1, static_correction=False), system, np.ones((9, 1))).u[-1]
    assert u[:8] == pytest.approx(u[8:], abs=1e-12)


@pytest.mark.parametrize("order", ["all", "some"])
def test_modes_are_orthonormal_and_solve_their_equation(order: str) -> None:
    """All of a small system; the lowest of one too large for a dense solution."""
    if order == "all":
        system, count = driven(), None
    else:
        mesh = box((0.1, 0.1, 0.1), (8, 8, 8))
        material = Material(1e4, 0.3, rho=1000.0, mass_damping=3.0, stiffness_damping=0.01)
        system, count = build(Scene(mesh, material, (Support("z0", (0, 1, 2)),))), 6
    modes, free = Modes.of(system, count), system.free
    K, M = (X[free][:, free] for X in (system.K, system.M))
    assert modes.shapes.T @ (M @ modes.shapes) == pytest.approx(np.eye(len(modes.omega)), abs=1e-9)
    residual = K @ modes.shapes - (M @ modes.shapes) * modes.omega**2
    assert np.abs(residual).max() < 1e-8 * np.abs(K @ modes.shapes).max()
    alpha, beta = system.scene.material.mass_damping, system.scene.material.stiffness_damping
    assert modes.damping == pytest.approx(alpha + beta * modes.omega**2, rel=1e-8)
    assert modes.omega[0] == pytest.approx(frequency_range(system)[0], rel=1e-9)
    assert (np.diff(modes.omega) >= 0).all()


def test_damping_that_couples_modes_is_refused() -> None:
    scene = driven().scene
    cells = np.flatnonzero(centroids(scene.mesh)[:, 0] > 0.05)
    wet = replace(scene.material, stiffness_damping=0.1)
    system = build(replace(scene, regions=(Region("wet", cells, wet),)))
    with pytest.raises(SceneError, match="the damping couples the modes"):
        Modal().prepare(system)
    stiff = replace(scene.material, E=5e5)
    Modal().prepare(build(replace(scene, regions=(Region("stiff", cells, stiff),), loads=())))


@pytest.mark.parametrize(
    ("count", "words"), [(0, "0 modes: expected at least 1"), (13, "13 modes of 12")]
)
def test_a_count_of_modes_that_is_none_is_refused(count: int, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        Modal(modes=count).prepare(small())


@pytest.mark.parametrize("force", ["constant", "linear"])
def test_an_exact_step_ends_with_the_rates_of_the_damped_motion(force: str) -> None:
    """q'' + 0.6 q' + 4.09 q = 2 swings at 2 rad/s: q = q_s + Re(C e^(s t)), s = -0.3 + 2i."""
    c, w2, f, q0, v0, h = 0.6, 4.09, 2.0, 1.0, 0.5, 0.7
    s, still = -0.3 + 2j, f / w2
    C = (q0 - still) - 1j * (v0 + 0.3 * (q0 - still)) / 2
    walk = exact_walk(
        SimpleNamespace(damping=np.array([c]), omega=np.sqrt([w2])),
        h,
        force,  # type: ignore[arg-type]
    )
    one = np.ones(1)
    q, v, a = walk.step(q0 * one, v0 * one, 0 * one, f * one, f * one)
    expected = [(C * s**n * np.exp(s * h)).real for n in range(3)]
    found = [q[0] - still, v[0], a[0]]
    assert found == pytest.approx(expected, rel=1e-12)
