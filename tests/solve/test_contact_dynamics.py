"""Contact in time: a struck bar, a block that drops and slides; contact never adds energy."""

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
from validate.fem.system import System
from validate.scene.box import box, grid
from validate.scene.scene import LawName
from validate.solve.contact import ContactNewton
from validate.solve.types import Scheme, State

STRIKE = 0.1  # m/s, of the plate
SIDE = LENGTH / CELLS
DT = 0.5 * SIDE / SPEED
SCHEMES: tuple[tuple[Scheme, LawName, float], ...] = (
    (ContactNewton(rule="average", dt=DT), "linear", 0.03),
    (ContactNewton(rule="backward_euler", dt=DT / 2), "linear", 0.08),
    (ContactNewton(rule="average", dt=DT), "neo_hooke", 0.03),
)


@cache
def struck(scheme: Scheme, law: LawName, dt: float) -> tuple[System, list[State], Floats]:
    mesh = (grid if law == "linear" else box)((SIDE, SIDE, LENGTH), (1, 1, CELLS))
    system = bar(mesh, law)
    t = dt * np.arange(1, int(3 * LENGTH / SPEED / dt))
    return system, walked(scheme, system, STRIKE * t[:, None]), t


def step_of(scheme: Scheme) -> float:
    return float(scheme.dt)  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("scheme", "law", "off"), SCHEMES, ids=lambda x: getattr(x, "rule", str(x))
)
def test_a_struck_bar_answers_as_a_wave_does(scheme: Scheme, law: LawName, off: float) -> None:
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
    velocity = states[-1].inner.v.reshape(-1, 3)[:, 2]
    momentum = float(system.masses.reshape(-1, 3)[:, 2] @ velocity)
    assert momentum == pytest.approx(impulse, rel=off + 0.02)
    assert force.sum() * step_of(scheme) == pytest.approx(momentum, rel=1e-6)
    assert traced(states, "plate.penetration").max() < 1e-12


@pytest.mark.parametrize(
    ("scheme", "law", "off"), SCHEMES, ids=lambda x: getattr(x, "rule", str(x))
)
def test_a_strike_gives_the_bar_no_more_than_the_plates_work(
    scheme: Scheme, law: LawName, off: float
) -> None:
    """Strain and kinetic energy less work of the plate never rises, from step to step."""
    _, states, _ = struck(scheme, law, step_of(scheme))
    stored = traced(states, "energy.strain") + traced(states, "energy.kinetic")
    work = traced(states, "plate.work")
    # At large strain the trapezoidal rule itself keeps energy to its order only.
    rounding = 1e-10 if law == "linear" else 1e-5
    assert np.diff(stored - work).max() < rounding * work[-1]
    assert stored[-1] > (1 - 2 * off) * work[-1]


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
