"""Contact in time: a struck bar, a block that drops and slides; contact never adds energy."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from contact_scenes import (
    CELLS,
    DENSITY,
    LENGTH,
    SPEED,
    bar,
    on_a_slope,
    traced,
    walked,
)

from validate.arrays import Floats
from validate.fem.system import System, build
from validate.scene.box import box, grid
from validate.scene.contact import RigidContact, RigidSphere
from validate.scene.material import LawName, Material
from validate.scene.scene import Scene, Support
from validate.solve.central import CentralDifference
from validate.solve.contact import ContactNewton
from validate.solve.types import Scheme, State

STRIKE = 0.1  # m/s, of the plate
SIDE = LENGTH / CELLS
DT = 0.5 * SIDE / SPEED
# Scheme, law, how far off its force may be, and its own error in energy, of the work done.
SCHEMES: tuple[tuple[Scheme, LawName, float, float], ...] = (
    (ContactNewton(rule="average", dt=DT), "linear", 0.03, 1e-10),
    (ContactNewton(rule="backward_euler", dt=DT / 2), "linear", 0.08, 1e-10),
    (ContactNewton(rule="average", dt=DT), "neo_hooke", 0.03, 1e-5),
    (CentralDifference(dt=DT, substeps=2, watch=1), "neo_hooke", 0.03, 1e-4),
)
EVERY = pytest.mark.parametrize(
    ("scheme", "law", "off", "own"), SCHEMES, ids=["average", "euler", "large", "explicit"]
)


@cache
def struck(scheme: Scheme, law: LawName, dt: float) -> tuple[System, list[State], Floats]:
    mesh = (grid if law == "linear" else box)((SIDE, SIDE, LENGTH), (1, 1, CELLS))
    system = bar(mesh, law)
    t = dt * np.arange(1, int(3 * LENGTH / SPEED / dt))
    return system, walked(scheme, system, STRIKE * t[:, None]), t


def velocity(scheme: Scheme, state: State) -> Floats:
    """(N,) m/s, of central difference half a step before."""
    if isinstance(scheme, CentralDifference):
        return np.asarray(state.inner.motion["d"] / scheme.step)
    return np.asarray(state.inner.v)


def step_of(scheme: Scheme) -> float:
    return float(scheme.dt)  # type: ignore[attr-defined]


@pytest.mark.slow
@EVERY
def test_a_struck_bar_answers_as_a_wave_does(
    scheme: Scheme, law: LawName, off: float, own: float
) -> None:
    """F = rho c A V until the wave is back at 2 L/c, then the bar flies off with 2 V.

    What is short of it is the normal motion of the nodes that hit, and the rule's own damping.
    """
    system, states, t = struck(scheme, law, step_of(scheme))
    force, back = traced(states, "plate.force"), 2 * LENGTH / SPEED
    inside = (t > 0.1 * back) & (t < 0.9 * back)
    exact = DENSITY * SPEED * SIDE**2 * STRIKE
    assert force[inside].mean() == pytest.approx(exact, rel=off)
    assert t[force > 0].max() == pytest.approx(back, rel=0.05)
    impulse = 2 * DENSITY * LENGTH * SIDE**2 * STRIKE
    momentum = float((system.masses * velocity(scheme, states[-1])).reshape(-1, 3)[:, 2].sum())
    assert momentum == pytest.approx(impulse, rel=off + 0.02)
    assert force.sum() * step_of(scheme) == pytest.approx(momentum, rel=1e-6)
    assert traced(states, "plate.penetration").max() < 1e-12


@pytest.mark.slow
@EVERY
def test_a_strike_gives_the_bar_no_more_than_the_plates_work(
    scheme: Scheme, law: LawName, off: float, own: float
) -> None:
    """Strain and kinetic energy less work of the plate never rises, from step to step."""
    _, states, _ = struck(scheme, law, step_of(scheme))
    stored = traced(states, "energy.strain") + traced(states, "energy.kinetic")
    work = traced(states, "plate.work")
    # At large strain the rules themselves keep energy to their order only.
    assert np.diff(stored - work).max() < own * work[-1]
    assert stored[-1] > (1 - 2 * off) * work[-1]


@pytest.mark.slow
def test_a_dropped_block_never_gains_energy() -> None:
    """It bounces on a rough slope: strain + kinetic + weight's energy only fall, to rounding."""
    system = on_a_slope(grid((0.1, 0.1, 0.1), (2, 2, 2)), 0.3, 0.4, gap=0.002)
    g = 9.81
    states = walked(ContactNewton(rule="average", dt=0.002), system, np.full((60, 1), g))
    height = np.array([g * float(system.loads[:, 0] @ s.inner.u) for s in states])
    energy = traced(states, "energy.strain") + traced(states, "energy.kinetic") - height
    scale = traced(states, "energy.kinetic").max()
    assert np.diff(energy[1:]).max() < 1e-9 * scale
    assert energy[-1] < -0.01 * scale
    touching = traced(states, "floor.touching") > 0
    assert np.diff(touching.astype(int)).min() < 0 < touching.sum()  # it comes off again


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [0.9, 1.1])
def test_a_block_slides_from_the_angle_of_friction_on(ratio: float) -> None:
    """Below it stays where it is; beyond it falls with g (sin - mu cos)."""
    mu, g, dt = 0.3, 9.81, 0.01
    angle = np.arctan(ratio * mu)
    system = on_a_slope(grid((0.1, 0.1, 0.05), (2, 2, 1)), angle, mu)
    t = dt * np.arange(1, 61)
    inputs = g * np.minimum(t / 0.2, 1.0)[:, None]
    states = walked(ContactNewton(rule="backward_euler", dt=dt), system, inputs)
    speed = np.array([s.inner.v.reshape(-1, 3)[:, 0].mean() for s in states])
    pull = g * (np.sin(angle) - mu * np.cos(angle))
    if ratio < 1:
        assert np.abs(speed[-10:]).max() < 1e-5
    else:
        assert np.diff(speed)[-20:].mean() / dt == pytest.approx(pull, rel=1e-3)
        rubs = traced(states, "floor.friction") / traced(states, "floor.force")
        assert rubs[-20:] == pytest.approx(np.full(20, mu), rel=1e-6)


def test_explicit_contact_gives_the_body_no_more_than_the_tool_gave() -> None:
    """What contact does to a struck bar is at most the plate's work, at every step, to rounding."""
    _, states, _ = struck(*SCHEMES[-1][:2], DT)
    given = traced(states, "energy.external") - traced(states, "plate.work")
    assert np.diff(given).max() < 1e-12 * traced(states, "plate.work")[-1]


def test_explicit_drops_lose_what_contact_takes() -> None:
    """A block that bounces on a rough slope: contact's work on it never rises."""
    mesh, g, dt = box((0.1, 0.1, 0.1), (2, 2, 2)), 9.81, 5e-4
    scene = on_a_slope(mesh, 0.3, 0.4, gap=0.002).scene
    system = build(replace(scene, material=replace(scene.material, law="svk")))
    scheme = CentralDifference(dt=dt, watch=1)
    states = walked(scheme, system, np.full((200, 1), g))
    half = np.array([s.inner.motion["u"] - s.inner.motion["d"] / 2 for s in states])
    contact = traced(states, "energy.external") - g * half @ system.loads[:, 0]
    scale = traced(states, "energy.kinetic").max()
    assert np.diff(contact).max() < 1e-10 * scale
    assert contact[-1] < -0.01 * scale
    touching = traced(states, "floor.touching") > 0
    assert np.diff(touching.astype(int)).min() < 0 < touching.sum()
    assert traced(states, "floor.penetration").max() < 1e-12


@pytest.mark.parametrize("ratio", [0.9, 1.1])
def test_explicit_steps_slide_from_the_same_angle_on(ratio: float) -> None:
    mu, g, dt = 0.3, 9.81, 5e-4
    angle = np.arctan(ratio * mu)
    scene = on_a_slope(box((0.1, 0.1, 0.05), (2, 2, 1)), angle, mu).scene
    damped = replace(scene.material, law="neo_hooke", mass_damping=20.0)
    t = dt * np.arange(1, 801)
    inputs = g * np.minimum(t / 0.2, 1.0)[:, None]
    states = walked(CentralDifference(dt=dt), build(replace(scene, material=damped)), inputs)
    speed = np.array([velocity(CentralDifference(dt=dt), s)[::3].mean() for s in states[-100:]])
    # Under mass damping it tends to g (sin - mu cos)/alpha.
    steady = g * (np.sin(angle) - mu * np.cos(angle)) / 20.0
    if ratio < 1:
        assert np.abs(speed).max() < 0.01 * abs(steady)
    else:
        assert speed.mean() == pytest.approx(steady, rel=0.05)


def test_a_rough_ball_over_a_closed_path_gets_back_less_than_it_gave() -> None:
    """Pressed in and drawn out again, explicitly: it has done work, and the body has no more."""
    ball = RigidSphere((0.05, 0.05, 0.15), 0.05)
    tool = RigidContact("ball", "z1", ball, (0.6, 0.0, -0.8), 0.3)
    scene = Scene(
        box((0.1, 0.1, 0.1), (4, 4, 4)),
        Material(1e4, 0.3, "neo_hooke", 1000.0),
        (Support("z0", (0, 1, 2)),),
        contacts=(tool,),
    )
    t = np.linspace(0.0, 1.0, 301)[1:, None]
    path = 0.02 * np.sin(np.pi * t) ** 2 - 0.03 * t**4  # away from the body in the end
    states = walked(CentralDifference(dt=5e-4, substeps=2, watch=1), build(scene), path)
    work = traced(states, "ball.work")
    stored = traced(states, "energy.strain") + traced(states, "energy.kinetic")
    assert traced(states, "ball.touching")[-1] == 0
    assert 0 < stored[-1] < work[-1] < work.max()
    assert (stored - work).max() < 1e-3 * work.max()
