"""Masses that hang at a body: a one-element oscillator exactly, a beam's tip, weight, energy."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from validate.fem.critical import Modes
from validate.fem.system import System, build
from validate.scene.geometries.box import box, grid
from validate.scene.material import Material
from validate.scene.places import InBox, Nearest, OnPlane
from validate.scene.scene import Load, Mass, Scene, Support, Weight
from validate.solve.dynamic.implicit import NewtonDynamics
from validate.solve.dynamic.modal import Modal
from validate.solve.dynamic.newmark import Newmark
from validate.solve.explicit.central import CentralDifference
from validate.solve.explicit.linear import ExplicitLinear
from validate.solve.march import march
from validate.solve.types import Scheme

E, L, A, RHO, HUNG = 1e4, 0.1, 0.01, 1000.0, 0.7
BODY = RHO * L * A
ALONG = OnPlane((L, 0.0, 0.0), (1.0, 0.0, 0.0))


def rod(hung: float = HUNG) -> Scene:
    """One brick that can only be stretched: k = E A/L, its end pulled."""
    masses = (Mass("weight", ALONG.edges, hung),) if hung else ()
    supports = (Support("x0", (0,)), Support(InBox((0, 0, 0), (L, 0.1, 0.1)).points, (1, 2)))
    loads = (Load("pull", "x1", (1.0, 0.0, 0.0)),)
    return Scene(
        grid((L, 0.1, 0.1), (1, 1, 1)),
        Material(E, 0.0, rho=RHO),
        supports,
        loads=loads,
        masses=masses,
    )


@pytest.mark.parametrize("hung", [0.0, HUNG])
def test_one_element_and_a_mass_ring_exactly(hung: float) -> None:
    """K u = omega^2 M u for the end that moves as one, omega^2 = k/(m/3 + M)."""
    system = build(rod(hung))
    K, M = (X[system.free][:, system.free].toarray() for X in (system.K, system.M))
    ones = np.ones(len(system.free))
    omega2 = E * A / L / (BODY / 3 + hung)
    assert K @ ones == pytest.approx(omega2 * M @ ones, rel=1e-12)


def test_lumped_masses_and_weight_have_what_hangs() -> None:
    scene = replace(rod(), loads=(Weight("gravity", (0.6, 0.0, 0.8)),))
    system = build(scene)
    ends = scene.mesh.facet_nodes("x1")
    assert system.masses.reshape(-1, 3)[ends].sum(axis=0) == pytest.approx(3 * [BODY / 2 + HUNG])
    fall = system.loads[:, 0].reshape(-1, 3).sum(axis=0)
    assert fall == pytest.approx((BODY + HUNG) * np.array([0.6, 0.0, 0.8]))
    assert system.C.toarray() == pytest.approx(build(rod(0.0)).C.toarray())


def test_lumping_leaves_what_hangs_where_it_hangs() -> None:
    """Quadratic cells scale their diagonal to the body's mass: the hanging one is no part of it."""
    scene = beam(HUNG)
    bare, hung = (build(replace(scene, masses=m)).masses for m in ((), scene.masses))
    more = (hung - bare).reshape(-1, 2)
    tip = scene.mesh.nearest_node(np.array([1.0, 0.025]))
    assert more[tip] == pytest.approx([HUNG, HUNG])
    assert np.abs(np.delete(more, tip, axis=0)).max() < 1e-12


def soft(law: str = "linear") -> System:
    """A held block of quadratic cells, a mass at one node of its top, lighter than the block."""
    return build(
        Scene(
            box((0.1, 0.1, 0.1), (1, 1, 1)),
            Material(1e5, 0.3, law, RHO),  # type: ignore[arg-type]
            (Support("z0", (0, 1, 2)),),
            loads=(Load("push", "z1", (1.0, 0.0, 0.0)),),
            masses=(Mass("weight", Nearest((0.1, 0.1, 0.1)).points, 0.4),),
        )
    )


DT = 2e-4
SCHEMES: Sequence[tuple[Scheme, str]] = (
    (Newmark(dt=DT, mass="lumped"), "linear"),
    (ExplicitLinear(dt=DT), "linear"),
    (NewtonDynamics(dt=DT), "svk"),
    (CentralDifference(dt=DT), "svk"),
)


@pytest.mark.parametrize(("scheme", "law"), SCHEMES, ids=lambda x: type(x).__name__)
def test_every_dynamic_scheme_swings_what_hangs(scheme: Scheme, law: str) -> None:
    """A small force switched on: the field after .02 s is that of the exact modes, lumped."""
    system = soft(law)
    free, f = system.free, 1e-3
    root = np.sqrt(system.masses[free])
    omega2, phi = np.linalg.eigh(system.K[free][:, free].toarray() / np.outer(root, root))
    steps = 100
    share = phi.T @ (f * system.loads[free, 0] / root)
    exact = phi @ (share * (1 - np.cos(np.sqrt(omega2) * steps * DT)) / omega2) / root
    t = DT * np.arange(1, steps + 1)
    inputs = np.full((steps, 1), f)
    if law == "svk":  # rises within its first step
        inputs[0] *= 0.5 if isinstance(scheme, NewtonDynamics) else 1.0
    run = march("run", scheme.prepare(system), t, inputs, np.array([steps - 1]), 0.0)
    found = run.u[0].ravel()[free]
    assert np.abs(found - exact).max() < 0.05 * np.abs(exact).max()
    light = build(replace(system.scene, masses=()))
    other = march("run", scheme.prepare(light), t, inputs, np.array([steps - 1]), 0.0)
    assert np.abs(other.u[0].ravel()[free] - exact).max() > 0.2 * np.abs(exact).max()


def test_energy_is_kept_with_a_mass() -> None:
    """Newmark's average rule keeps kinetic + strain - work to rounding."""
    system = soft()
    stepper = Newmark(dt=DT).prepare(system)
    state, energies = stepper.rest(), []
    for _ in range(60):
        state = stepper.step(state, np.array([0.1]))
        u, v = (np.zeros(len(system.moves)) for _ in range(2))
        u[system.free], v[system.free] = state.inner.u, state.inner.v
        stored = u @ (system.K @ u) / 2 + v @ (system.M @ v) / 2
        energies.append(stored - 0.1 * system.loads[:, 0] @ u)
    assert np.abs(energies).max() < 1e-9 * abs(0.1 * system.loads[:, 0] @ u)


def beam(hung: float) -> Scene:
    """A slender strip in plane stress, 1 m by 5 cm, held at its left end."""
    return Scene(
        box((1.0, 0.05), (20, 2)).quadratic(),
        Material(1e7, 0.3, rho=RHO),
        (Support("x0", (0, 1)),),
        loads=(Load("pull", "x1", (0.0, 1.0)),),
        masses=(Mass("tip", Nearest((1.0, 0.025)).points, hung),),
        plane="stress",
    )


@pytest.mark.parametrize("ratio", [1.0, 5.0])
def test_a_beam_with_a_tip_mass_rings_as_rayleigh_says(ratio: float) -> None:
    """omega^2 = 3 E I/L^3/(M + 33/140 m), from above by some tenths of a per cent."""
    body = RHO * 0.05
    omega = Modes.of(build(beam(ratio * body)), 1).omega[0]
    exact = np.sqrt(3 * 1e7 * 0.05**3 / 12 / (ratio * body + 33 / 140 * body))
    assert omega == pytest.approx(exact, rel=5e-3)


def test_modal_and_newmark_agree_on_it() -> None:
    scene = beam(50.0)
    t, inputs = 0.01 * np.arange(1, 31), np.ones((30, 1))
    runs = [
        march("run", scheme.prepare(build(scene)), t, inputs, np.array([29]), 0.0).u[0]
        for scheme in (Newmark(dt=0.01), Modal(dt=0.01, propagate="average"))
    ]
    assert runs[1] == pytest.approx(runs[0], rel=1e-6, abs=1e-9)
