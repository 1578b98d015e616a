"""A probe at 1 kHz on a slower body: static truth, energy, schedules, contact, refusals."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.system import System, build
from validate.scene.contact import Needle
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.scene import Drive, Scene, Support
from validate.solve.explicit.central import CentralDifference
from validate.solve.haptic.loop import HapticLoop, HapticStepper, Hold
from validate.solve.types import State

# private: _aim, _holding: called alone, case by case.

L, H = 0.1, 1e-3
TIP = (L / 3, L / 3, 0.1005)
HAND = HapticLoop(every=1, late=0, pad=0.034, grip=None)
SLOW = replace(HAND, every=10, late=10)


def body(damping: float = 20.0, **changes: Any) -> Scene:
    scene = Scene(
        box((L, L, L), (3, 3, 3)),
        Material(10e3, 0.4, "svk", 1000.0, damping),
        (Support("z0", (0, 1, 2)),),
        tools=(Needle("tool", "z1", TIP, (0.0, 0.0, -1.0)),),
    )
    return replace(scene, **changes)


@cache
def system(damping: float = 20.0) -> System:
    return build(body(damping))


def stepper(settings: HapticLoop, damping: float = 20.0) -> HapticStepper:
    found = settings.prepare(system(damping))
    assert isinstance(found, HapticStepper)
    return found


def walked(settings: HapticLoop, depth: Floats, damping: float = 20.0) -> list[State]:
    """States after every tick of a probe that is pushed by (nt,) m along -z."""
    one = stepper(settings, damping)
    states = [one.rest()]
    for y in depth:
        states.append(one.step(states[-1], np.array([0.0, 0.0, -y])))
        assert states[-1].failure is None, states[-1].failure
    return states[1:]


def up(states: list[State]) -> Floats:
    return np.array([s.numbers["tool.force.z"] for s in states])


def push(depth: float, ticks: int) -> Floats:
    """Down and up again, smooth, in so many ticks."""
    return np.asarray(depth * np.sin(np.pi * np.arange(1, ticks + 1) / ticks) ** 2)


# --- the body under the spring --------------------------------------------------------------------


def test_a_small_push_that_has_died_down_is_that_of_the_springs_in_a_row() -> None:
    """Of a linear body: the probe's spring, then the compliance of its pad, by one solve with K."""
    depth = 1e-5
    states = walked(replace(HAND, damping="mass"), np.full(1500, depth), damping=60.0)
    made, held = stepper(HAND).system, states[-1].inner.body.held
    free = made.free
    mean = np.zeros((made.K.shape[0], 3))
    for c in range(3):
        mean[3 * np.array(held.pad) + c, c] = 1 / len(held.pad)
    K = made.K[free][:, free].toarray()
    compliance = np.eye(3) / HAND.spring + mean[free].T @ np.linalg.solve(K, mean[free])
    found = [states[-1].numbers[f"tool.force.{a}"] for a in "xyz"]
    assert len(held.pad) > 1
    assert found == pytest.approx(np.linalg.solve(compliance, [0.0, 0.0, depth]), rel=1e-3)


def test_without_damping_the_hand_puts_in_what_spring_and_body_hold() -> None:
    """Work by the trapezoidal rule of fine ticks, against strain, kinetic energy and stretch."""
    fine = replace(HAND, dt=1e-4, watch=1)
    depth = push(0.01, 6000)[:1500]  # still on its way down
    states = walked(fine, depth, damping=0.0)
    F, x = np.append(0.0, up(states)), np.append(0.0, depth)
    put = float((F[1:] + F[:-1]) @ np.diff(x)) / 2
    last = states[-1]
    one, u = stepper(fine, 0.0), last.inner.body.state.inner.motion["u"]
    strain = one.body.untouched.body.look(u).energy
    kinetic = last.numbers["energy.kinetic"]
    assert put > 1e-4
    assert strain + kinetic + last.numbers["tool.stretch"] == pytest.approx(put, rel=2e-3)


def test_a_probe_that_answers_every_tick_is_central_difference_with_a_spring() -> None:
    """The same step written out: the force of the spring on the pad, added to the body's own."""
    one = stepper(HAND)
    state, depth = one.rest(), push(0.01, 100)
    for y in depth[:40]:
        state = one.step(state, np.array([0.0, 0.0, -y]))
    held = state.inner.body.held
    bare = replace(one.system, scene=body(tools=()))
    rule = CentralDifference(H, one.substeps, margin=0.0).prepare(bare).rule  # type: ignore[attr-defined]
    u = d = np.zeros(81 + 111)
    before, pad = 0.0, 3 * np.array(held.pad)[:, None] + np.arange(3)
    for y in depth[:40]:
        for s in range(one.substeps):
            f = -one.body.untouched.body.force(u)
            deep = -(before + (y - before) * s / one.substeps)
            hung = u[pad].mean(axis=0)
            f[pad] += HAND.spring / len(pad) * (np.array([0.0, 0.0, deep]) - hung)
            d = rule.keep * d + rule.gain * f
            u = u + d
        before = y
    assert one.field(state).ravel() == pytest.approx(u, abs=1e-12)
    assert np.abs(u).max() > 1e-3


# --- readings, answers, extrapolation -------------------------------------------------------------


@pytest.mark.parametrize("name", ["hold", "linear", "quadratic"])
@pytest.mark.parametrize("late", [0, 4, 10])
def test_what_is_given_is_the_polynomial_of_the_answers(name: Any, late: int) -> None:
    """The body itself is not asked: its own forces at readings, extrapolated apart."""
    depth = push(0.01, 160)
    slow = replace(SLOW, late=late, extrapolation=name)
    states = walked(slow, depth)
    answers = {s.inner.answers[-1].k: s.inner.answers[-1].force for s in states}
    read = np.zeros((161, 3))
    for k, force in answers.items():
        read[k] = force
    wanted = HapticLoop(every=10, late=late, extrapolation=name).between_answers(read)[1:, 2]
    assert up(states) == pytest.approx(wanted, abs=1e-12)
    jumps = np.array([s.numbers["tool.jump"] for s in states])
    answered = np.array([s.numbers["tool.answered"] for s in states])
    assert np.flatnonzero(answered).tolist() == [k - 1 + late for k in range(10, 161 - late, 10)]
    assert np.abs(jumps[answered == 0]).max() == 0.0
    assert jumps.max() > 0


def test_a_straight_push_is_read_as_well_every_tenth_tick_as_every_one() -> None:
    """The probe goes straight between readings: on a straight path both bodies are one."""
    depth = 0.006 * np.arange(1, 121) / 120
    each = up(walked(HAND, depth))
    some = up(walked(replace(SLOW, late=0), depth))
    assert some[9::10] == pytest.approx(each[9::10], rel=1e-9)
    assert np.abs(some - each).max() > 1e-6


def test_a_place_that_is_extrapolated_under_a_stiff_spring_gives_the_same_at_readings() -> None:
    depth = push(0.01, 120)
    slow = replace(SLOW, late=0)
    force, place = (up(walked(replace(slow, extrapolates=w), depth)) for w in ("force", "place"))
    assert place[9::10] == pytest.approx(force[9::10], abs=1e-9)
    assert np.abs(place - force).max() > 1e-4


def test_a_body_in_the_background_gives_the_same_numbers() -> None:
    depth = push(0.01, 120)
    apart = walked(replace(SLOW, background=True), depth)
    assert np.array_equal(up(apart), up(walked(SLOW, depth)))


def test_the_loop_is_a_function_of_its_state() -> None:
    """A state may be stepped again: the same tick comes out."""
    one, depth = stepper(SLOW), push(0.01, 120)
    states = [one.rest()]
    for y in depth:
        states.append(one.step(states[-1], np.array([0.0, 0.0, -y])))
    for k in (3, 20, 29, 30, 31):
        again = one.step(states[k], np.array([0.0, 0.0, -depth[k]]))
        assert again.numbers == states[k + 1].numbers


# --- contact --------------------------------------------------------------------------------------


def test_contact_begins_within_reach_without_a_jump_and_ends_without_a_pull() -> None:
    far = body(tools=(replace(body().tools[0], tip=(L / 3, L / 3, 0.11)),))
    one = replace(SLOW, grip=0.0, extrapolation="quadratic").prepare(build(far))
    state, found = one.rest(), []
    for y in push(0.02, 400):
        state = one.step(state, np.array([0.0, 0.0, -y]))
        found.append((state.numbers["tool.contact"], state.numbers["tool.force.z"]))
        # An answer from before the contact changed does not count.
        if state.numbers["tool.changed"]:
            assert len(state.inner.answers) == 1
    touching, force = np.array(found).T
    first = int(np.argmax(touching))
    assert touching[0] == touching[-1] == 0.0
    assert force[:first].max() == force[first] == 0.0
    assert force.max() > 1
    assert force.min() >= 0.0  # an extrapolated fall does not pull the hand back in
    glued = walked(replace(SLOW, grip=None), np.append(push(0.01, 200), -0.002 * np.ones(40)))
    assert up(glued)[-1] < -0.1


def test_a_probe_that_takes_hold_of_a_bent_body_feels_nothing_at_first() -> None:
    """The spring hangs at the mean of its pad, which is not where the node itself is."""
    probe = stepper(HAND).body.probe
    u = 1e-4 * np.random.default_rng(1).standard_normal(probe.body.places.size)
    held = probe.follow(None, np.array(TIP), u)
    assert held is not None
    assert probe.force(held, np.array(TIP), u) == pytest.approx(0.0, abs=1e-12)


def test_a_change_of_hold_leaves_the_body_with_the_forces_of_its_new_spring() -> None:
    """Held, let go and held again while it moves: r is the force at u, and work jumps as energy."""
    one = stepper(replace(HAND, grip=0.0, reach=0.02))
    state, changes = one.rest(), 0
    path = np.concatenate([push(0.01, 60), -0.012 * np.ones(3), push(0.01, 60)])
    for y in path:
        last, state = state, one.step(state, np.array([0.0, 0.0, -y]))
        read = state.inner.body
        motion, body = read.state.inner.motion, one.body._holding(read.held).body
        assert motion["r"] == pytest.approx(body.force(motion["u"]), abs=1e-9)
        before, old = last.inner.body.state.inner, last.inner.body.held
        if (old is None) != (read.held is None):
            changes += 1
            energies = [
                one.body._holding(h).body.look(motion["u"]).energy for h in (old, read.held)
            ]
            own = one.body._holding(old).step(last.inner.body.state, _aimed(one, old, y))
            jump = read.state.inner.work - own.inner.work
            assert jump == pytest.approx(energies[1] - energies[0], abs=1e-12)
            assert before.motion is not motion
    assert changes >= 2


def _aimed(one: HapticStepper, held: Hold | None, y: float) -> Floats:
    tip = np.array([TIP[0], TIP[1], TIP[2] - y])
    return np.zeros(3) if held is None else one.body._aim(held, tip)


def test_no_force_beyond_the_limit_is_given() -> None:
    states = walked(replace(HAND, limit=1.0), push(0.01, 200))
    clipped = np.array([s.numbers["tool.clipped"] for s in states])
    sizes = [np.linalg.norm([s.numbers[f"tool.force.{a}"] for a in "xyz"]) for s in states]
    assert max(sizes) == pytest.approx(1.0, rel=1e-12)
    assert 0 < clipped.sum() < len(states)


def test_a_touch_to_warm_up_is_forgotten() -> None:
    one = stepper(SLOW)
    before = one.rest().numbers
    one.warm()
    assert one.rest().numbers == before
    assert len(one.body.kept) == 1


def test_a_body_that_fails_ends_the_run_with_its_reason() -> None:
    one = stepper(replace(SLOW, spring=2e4, watch=1))
    state, k = one.rest(), 0
    while state.failure is None and k < 400:
        k += 1
        state = one.step(state, np.array([0.0, 0.0, -1e-3 * k]))
    assert state.failure is not None
    assert state.failure[0] in ("invalid", "diverged", "refused")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: HapticLoop(dt=0.0), "tick of 0 s"),
        (lambda: HapticLoop(every=3, late=4), "no later than the next reading"),
        (lambda: HapticLoop(margin=1.0), "margin 1"),
        (lambda: HapticLoop(spring=0.0), "spring 0 N/m"),
        (lambda: HapticLoop(limit=-1.0), "force limit -1 N"),
        (lambda: HapticLoop(grip=-1.0), "grip -1 N"),
        (lambda: HAND.prepare(build(body(tools=()))), "0 probes"),
        (
            lambda: HAND.prepare(build(body(drives=(Drive("d", "x0", (1.0, 0.0, 0.0)),)))),
            "1 drives",
        ),
        (
            lambda: HAND.prepare(build(body(supports=(Support("z1", (2,)),)))),
            "all 16 nodes that it may touch are held",
        ),
    ],
)
def test_what_cannot_be_done_is_refused(make: Any, words: str) -> None:
    with pytest.raises((SceneError, Exception), match=words):
        make()
