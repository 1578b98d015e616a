"""A needle on a body with a fluid pocket: contact, pressure, hand force, energy."""

import itertools
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from phantoms import COARSE_GRID, phantom_mesh

from experiments.fluid_phantom.square_hole import square_with_hole
from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.system import build
from validate.scene.contact import Needle
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.mesh import Mesh, boundary_facets
from validate.scene.scene import Cavity, Drive, Scene, Support
from validate.solve.haptic.needle import NeedleLoop, NeedleStepper, Surface
from validate.solve.march import march
from validate.solve.types import State

# private: _system: called alone, case by case.

DOWN = (0.0, -1.0)
TIP = (0.0031, 0.001)  # 1 mm over the block, between nodes


@cache
def block() -> Mesh:
    """The block of section 3.3 on a coarse mesh, its upper side named."""
    mesh = square_with_hole(0.05, 0.01, 10)
    outside = boundary_facets(mesh.cells, 2)
    top = outside[np.abs(mesh.nodes[outside][:, :, 1]).max(axis=1) < 1e-12]
    return Mesh(mesh.nodes, mesh.cells, mesh.kind, {**mesh.facets, "top": top})


def scene(tip: tuple[float, float] = TIP, *, dry: bool = False) -> Scene:
    return Scene(
        block(), Material(34e3, 0.35), (Support("bottom", (0, 1)),),
        cavities=() if dry else (Cavity("pocket", "cavity"),),
        tools=(Needle("needle", "top", tip, DOWN),),
    )  # fmt: skip


STRONG = NeedleLoop(limit=1e6)


def prepared(loop: NeedleLoop = STRONG, made: Scene | None = None) -> NeedleStepper:
    stepper = loop.prepare(build(made or scene()))
    assert isinstance(stepper, NeedleStepper)
    return stepper


def walked(stepper: NeedleStepper, path: Floats) -> list[State]:
    """States along displacements (n, 2) m of the tip."""
    state, found = stepper.rest(), []
    for at in path:
        state = stepper.step(state, at)
        found.append(state)
    return found


def pushed(depth: float, n: int = 40, aside: float = 0.0) -> Floats:
    """From rest straight down until `depth` m below the surface."""
    down = np.linspace(0, 1, n)[:, None]
    return np.asarray(down * [aside, -(TIP[1] + depth)])


def force(state: State) -> Floats:
    return np.array([state.numbers["needle.force.x"], state.numbers["needle.force.y"]])


# --- contact --------------------------------------------------------------------------------------


def test_nothing_is_felt_outside_and_the_force_begins_at_zero() -> None:
    states = walked(prepared(), pushed(0.004))
    touching = [s.numbers["needle.contact"] for s in states]
    first = touching.index(1.0)
    assert touching == [0.0] * first + [1.0] * (len(states) - first)
    assert not any(force(s).any() for s in states[: first + 1])
    up = [force(s)[1] for s in states[first + 1 :]]
    assert all(a < b for a, b in itertools.pairwise(up))
    assert states[first].numbers["needle.changed"] == 1.0
    assert states[first + 1].numbers["needle.changed"] == 0.0


@pytest.mark.parametrize("at", ["point", "node"])
def test_the_touched_point_follows_the_tip(at: str) -> None:
    stepper = prepared(NeedleLoop(at=at, grip=None))  # type: ignore[arg-type]
    state = walked(stepper, pushed(0.004, aside=0.001))[-1]
    touch = state.inner.touch
    nodes = stepper.small.nodes[touch.entry.nodes]
    u = stepper.field(state)[nodes]
    shares = touch.entry.shares
    moved = shares @ u if at == "point" else u[int(np.argmax(shares))]
    assert moved == pytest.approx(state.inner.tip - touch.anchor, abs=1e-13)


def test_the_field_holds_equilibrium_and_the_volume() -> None:
    """K u is the pressure's load and the force at the needle; the volume is that at rest."""
    stepper = prepared()
    state = walked(stepper, pushed(0.004))[-1]
    system = stepper.small._system
    u = stepper.field(state)
    pass

    pocket = system.cavities[0]
    left = system.K @ u.ravel() - state.inner.P * pocket.pressure_load(block().nodes).ravel()
    nodes = stepper.small.nodes[state.inner.touch.entry.nodes]
    others = np.setdiff1d(system.free, (2 * nodes[:, None] + [0, 1]).ravel())
    assert np.abs(left[others]).max() < 1e-10 * np.abs(left).max()
    total = np.array([left[2 * nodes + c].sum() for c in (0, 1)])
    reaction = -state.inner.forces @ state.inner.touch.axes
    assert -total == pytest.approx(reaction, rel=1e-9)
    assert pocket.volume(block().nodes + u) == pytest.approx(
        pocket.volume(block().nodes), rel=1e-12
    )


def test_a_body_without_grip_lets_go_and_takes_hold_deeper() -> None:
    """In, out again, in: no pull without grip, and no contact before the tip is deeper."""
    down = pushed(0.003, 31)
    states = walked(prepared(), np.vstack([down, down[::-1], down]))
    assert min(force(s)[1] for s in states) >= 0
    touching = np.array([s.numbers["needle.contact"] for s in states])
    assert np.abs(np.diff(touching)).sum() == 3  # took hold, let go, took hold
    assert force(states[-1])[1] == pytest.approx(force(states[30])[1], rel=0.02)


def test_inside_after_letting_go_it_takes_hold_where_it_goes_deeper() -> None:
    """Let go by a step sideways less than out of the surface: no crossing shows the way in."""
    stepper = prepared()
    path = np.array([[0, -0.0009], [0, -0.0015], [0, -0.003], [0, -0.0014], [0, -0.0013],
                     [0, -0.002], [0, -0.0035]])  # fmt: skip
    touching = [s.numbers["needle.contact"] for s in walked(stepper, path)]
    assert touching == [0, 1, 1, 0, 0, 1, 1]


def test_an_inserted_needle_pulls() -> None:
    down = pushed(0.002, 21)
    up = pushed(-0.001, 5)[::-1][:1] + [0.0, 0.0]
    state = walked(prepared(NeedleLoop(grip=None)), np.vstack([down, down[::-1][:-2], up]))[-1]
    assert state.numbers["needle.contact"] == 1.0
    assert force(state)[1] < 0


def test_a_grip_breaks_at_its_force() -> None:
    """Pulled out of a body that holds 2 N (per metre) at most."""
    loop = NeedleLoop(grip=2.0)
    down = pushed(0.002, 21)
    out = np.column_stack([np.zeros(400), np.linspace(-0.003, 0.004, 400)])
    states = walked(prepared(loop), np.vstack([down, out]))
    pulls = [-force(s)[1] for s in states]
    assert 1.5 < max(pulls) <= 2.0
    assert states[-1].numbers["needle.contact"] == 0.0


def test_a_path_beside_the_body_touches_nothing() -> None:
    states = walked(prepared(), np.array([[0.03, 0.0], [0.03, -0.03], [0.03, 0.0]]))
    assert not any(s.numbers["needle.contact"] for s in states)


def test_only_along_the_axis_the_surface_slides() -> None:
    sideways = pushed(0.002, aside=0.001)
    along_axis = walked(prepared(NeedleLoop(imposes="axis", grip=None)), sideways)[-1]
    held = walked(prepared(NeedleLoop(grip=None)), sideways)[-1]
    assert abs(force(along_axis)[0]) < 1e-12
    assert abs(force(held)[0]) > 1e-3


# --- pressure -------------------------------------------------------------------------------------


def test_the_exact_pressure_keeps_the_volume() -> None:
    states = walked(prepared(), pushed(0.006))
    assert max(abs(s.numbers["pocket.volume_ratio"] - 1) for s in states) < 1e-13
    assert states[-1].numbers["pocket.pressure"] > 0


def test_the_papers_law_stays_within_its_tolerance_in_one_update() -> None:
    """Section 5.2: within .1 % with no more than one iteration, 512 Hz, at moderate speed."""
    loop = NeedleLoop(update="proportional", force="reaction")
    t = np.arange(512) / 512
    path = np.column_stack([np.zeros(512), -0.001 - 0.0025 * (1 - np.cos(2 * np.pi * t))])
    states = walked(prepared(loop), path)
    assert max(abs(s.numbers["pocket.volume_ratio"] - 1) for s in states) <= 1e-3
    assert max(s.updates for s in states) == 1
    assert sum(s.updates for s in states) > 5


def test_a_gain_far_too_large_is_an_outcome() -> None:
    stepper = prepared(NeedleLoop(update="proportional", gain=1e9, most=20))
    run = march("needle", stepper, np.arange(40.0), pushed(0.006), np.array([39]), 0.0)
    assert run.outcome.state == "not_converged"
    assert "gain too large" in run.outcome.why


def test_a_dry_body_has_no_pocket() -> None:
    stepper = prepared(made=scene(dry=True))
    states = walked(stepper, pushed(0.004))
    wet = walked(prepared(), pushed(0.004))[-1]
    assert set(states[-1].numbers) == set(stepper.units)
    assert 0 < force(states[-1])[1] < force(wet)[1]
    assert stepper.field(states[-1]).shape == block().nodes.shape


# --- energy ---------------------------------------------------------------------------------------


def _loop_energy(which: str, n: int) -> float:
    """Work J/m that a closed path of n ticks took, trapezoidal; the contact lasts throughout."""
    stepper = prepared(NeedleLoop(grip=None, force=which, limit=1e6))  # type: ignore[arg-type]
    turn = 2 * np.pi * np.arange(n + 1) / n
    circle = np.column_stack([0.002 * np.sin(turn), -0.006 - 0.002 * np.cos(turn)])
    states = walked(stepper, np.vstack([pushed(0.0005, 5), [[0, -0.008]], circle]))[6:]
    F, x = np.array([force(s) for s in states]), circle
    assert states[0].numbers["needle.energy"] == pytest.approx(
        states[-1].numbers["needle.energy"], rel=1e-12
    )
    return float(-((F[1:] + F[:-1]) / 2 * np.diff(x, axis=0)).sum())


def test_a_closed_path_gives_back_what_it_took() -> None:
    """The consistent force is a gradient: what is left is the trapezoidal rule's, to a circle
    exponentially small; the reaction on normals that do not turn is none."""
    stored = walked(prepared(NeedleLoop(grip=None)), pushed(0.008))[-1].numbers["needle.energy"]
    assert abs(_loop_energy("consistent", 64)) < 1e-10 * stored
    assert abs(_loop_energy("reaction", 64)) > 1e-6 * stored


def test_the_consistent_force_is_the_slope_of_the_energy() -> None:
    stepper, h = prepared(NeedleLoop(grip=None, limit=1e6)), 1e-6
    state = walked(stepper, pushed(0.005, aside=0.001))[-1]
    at = state.inner.tip - np.array(TIP)
    for c in (0, 1):
        step = h * np.eye(2)[c]
        up, down = (stepper.step(state, at + s * step).numbers["needle.energy"] for s in (1, -1))
        assert -force(state)[c] == pytest.approx((up - down) / (2 * h), rel=1e-6)


@pytest.mark.slow
@settings(max_examples=15)
@given(st.lists(st.tuples(st.floats(-0.004, 0.004), st.floats(-0.008, 0.002)), min_size=3,
                max_size=8))  # fmt: skip
def test_the_hand_never_gets_more_than_it_gave(corners: list[tuple[float, float]]) -> None:
    """Along any path, contacts lost and taken again: work taken so far is never below zero but for
    the trapezoidal rule."""
    stops = np.array([(0.0, 0.0), *corners, (0.0, 0.0)])
    legs = [np.linspace(a, b, 120)[:-1] for a, b in itertools.pairwise(stops)]
    path = np.vstack([*legs, stops[-1:]])
    states = walked(_wet(), path)
    F = np.array([force(s) for s in states])
    taken = np.concatenate([[0], -np.cumsum(((F[1:] + F[:-1]) / 2 * np.diff(path, axis=0)).sum(1))])
    stored = np.array([s.numbers["needle.energy"] for s in states])
    scale = max(stored.max(), 1e-9)
    assert (taken >= -2e-2 * scale).all()
    assert (stored >= -1e-12 * scale).all()


@cache
def _wet() -> NeedleStepper:
    return prepared()


def test_no_force_beyond_the_limit() -> None:
    states = walked(prepared(NeedleLoop(limit=5.0)), pushed(0.004))
    sizes = [float(np.linalg.norm(force(s))) for s in states]
    assert max(sizes) == pytest.approx(5.0)
    assert sum(s.numbers["needle.clipped"] for s in states) > 1
    free = walked(prepared(), pushed(0.004))
    assert not any(s.numbers["needle.clipped"] for s in free)


# --- three dimensions, marching, refusals ---------------------------------------------------------


def test_in_space_too() -> None:
    """On the phantom's upper side, 3 mm deep: volume kept, tip followed, energy balanced."""
    mesh = phantom_mesh(COARSE_GRID)
    made = Scene(
        mesh, Material(15.2e3, 0.485), (Support("y0", (0, 1, 2)),),
        cavities=(Cavity("pocket", "cavity"),),
        tools=(Needle("needle", "y1", (0.031, 0.046, 0.036), (0.0, -1.0, 0.0)),),
    )  # fmt: skip
    stepper = NeedleLoop(grip=None).prepare(build(made))
    assert isinstance(stepper, NeedleStepper)
    state, h = stepper.rest(), 1e-6
    for y in np.linspace(0, -0.004, 12):
        state = stepper.step(state, np.array([0.2 * y, y, 0.1 * y]))
    assert state.numbers["pocket.volume_ratio"] == pytest.approx(1, abs=1e-13)
    at = state.inner.tip - np.array(made.tools[0].tip)
    for c, axis in enumerate("xyz"):
        ends = (at + s * h * np.eye(3)[c] for s in (1, -1))
        up, down = (stepper.step(state, e).numbers["needle.energy"] for e in ends)
        assert -state.numbers[f"needle.force.{axis}"] == pytest.approx(
            (up - down) / (2 * h), rel=1e-5, abs=1e-6
        )


def test_a_run_traces_the_path() -> None:
    path = pushed(0.004)
    run = march("needle", prepared(), np.arange(40) / 512, path, np.array([0, 39]), 0.0)
    assert run.outcome.state == "finished"
    assert run.traces["needle.y"].y == pytest.approx(path[:, 1])
    assert run.traces["needle.y"].unit == "m"
    assert run.u[1].max() > 0


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda: scene((0.0, -0.005)), "starts inside the body"),
        (lambda: replace(scene(), tools=()), "0 needles"),
        (
            lambda: replace(scene(), drives=(Drive("d", "top", (0.0, -1.0)),)),
            "drives together with",
        ),
        (
            lambda: replace(scene(), tools=(Needle("n", "bottom", TIP, DOWN),)),
            "all 10 facets that it may touch are held",
        ),
    ],
)
def test_scenes_without_sense_are_refused(made, words: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(SceneError, match=words):
        NeedleLoop().prepare(build(made()))


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda: Needle("n", "top", TIP, (0.0, -2.0)), "axis of length 2"),
        (lambda: Needle("n", "top", (np.nan, 0.0), DOWN), "finite"),
        (lambda: replace(scene(), tools=scene().tools * 2), "2 needles: expected one"),
        (lambda: scene((0.0, 0.0, 0.1)), "in a scene of 2 dimensions"),  # type: ignore[arg-type]
        (lambda: NeedleLoop(gain=-5.0), "a negative gain diverges"),
        (lambda: NeedleLoop(limit=0.0), "force limit 0 N"),
        (lambda: NeedleLoop(grip=-1.0), "grip -1 N"),
    ],
)
def test_settings_without_sense_are_refused(made, words: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(SceneError, match=words):
        made()


# --- where a path enters --------------------------------------------------------------------------


@pytest.mark.slow
@settings(max_examples=60)
@given(st.floats(0.05, 0.95), st.floats(0.05, 0.95), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_a_path_enters_a_box_where_geometry_says(u: float, v: float, a: float, b: float) -> None:
    """Down through the upper face of a unit cube, from obliquely above."""
    mesh = box((1.0, 1.0, 1.0), (3, 3, 3))
    surface = Surface(boundary_facets(mesh.cells, 3), 3)
    at = np.array([u, v, 1.0])
    start, end = at + 0.01 * np.array([a, b, 1.0]), at - 0.01 * np.array([a, b, 1.0])
    entry = surface.entered(mesh.nodes, start, end)
    assert entry is not None
    assert entry.shares @ mesh.nodes[entry.nodes] == pytest.approx(at, abs=1e-12)
    assert entry.normal == pytest.approx([0, 0, 1])
    assert surface.entered(mesh.nodes, end, start) is None  # out of the body is no way in


def test_the_first_of_two_crossings_counts() -> None:
    mesh = block()
    surface = Surface(boundary_facets(mesh.cells, 2), 2)
    entry = surface.entered(mesh.nodes, np.array([0.001, 0.01]), np.array([0.001, -0.06]))
    assert entry is not None
    assert entry.normal == pytest.approx([0, 1])
    assert entry.shares @ mesh.nodes[entry.nodes] == pytest.approx([0.001, 0.0], abs=1e-15)
