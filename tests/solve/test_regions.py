"""Asynchronous regions: exact truths first, then orders of error, stability and refusals."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from beside import beside
from touched import AREA, DAMPING, DENSITY, LENGTH, bar, block, pad_of

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.system import build
from validate.scene.scene import Scene
from validate.solve.march import run_scheme
from validate.solve.regions.body import PrimarySize, RegionBody, layers_from, ratios, split
from validate.solve.regions.march import Motion, Piece, Zone, carried, spectral_radius
from validate.solve.regions.scheme import AsyncRegions, RegionStepper
from validate.solve.types import State

CELLS, E, H, KS = 12, 5e3, 1e-3, 1000.0
K_BAR = E * AREA / LENGTH
LIMIT = 0.01 * K_BAR * KS / (K_BAR + KS)  # N at 1 cm
WHOLE = AsyncRegions(H, layers=(), rates=(), pad=pad_of(CELLS), reach=5e-3)
NEAR = replace(WHOLE, layers=(4,), rates=(50.0,))


def stepper_of(settings: AsyncRegions, scene: Scene | None = None) -> RegionStepper:
    found = settings.prepare(build(bar(E, CELLS) if scene is None else scene))
    assert isinstance(found, RegionStepper)
    return found


def walked(settings: AsyncRegions, pushed: Floats, scene: Scene | None = None) -> list[State]:
    """States after every tick of a probe that is pushed by (nt,) m along -x."""
    stepper = stepper_of(settings, scene)
    states, d = [stepper.rest()], len(stepper.tool.tip)
    for depth in pushed:
        states.append(stepper.step(states[-1], np.array([-depth, *[0.0] * (d - 1)])))
        if states[-1].failure:
            break
    return states[1:]


def force(settings: AsyncRegions, pushed: Floats, scene: Scene | None = None) -> Floats:
    return np.array([s.numbers["probe.force.x"] for s in walked(settings, pushed, scene)])


def swing(seconds: float, hz: float = 1.0) -> Floats:
    t = H * np.arange(1, round(seconds / H) + 1)
    return np.asarray(0.01 * np.sin(2 * np.pi * hz * t))


def by_hand(pushed: Floats, rule: str = "semi_implicit", h: float = H) -> Floats:
    """Eqs 3, 5 and 6 for the whole bar as dense 1-D elements, nothing shared with the scheme."""
    side = LENGTH / CELLS
    k = E * AREA / side
    K = k * (2 * np.eye(CELLS) - np.eye(CELLS, k=1) - np.eye(CELLS, k=-1))
    K[-1, -1] = k
    m = np.full(CELLS, DENSITY * AREA * side)
    m[-1] /= 2
    u = before = np.zeros(CELLS)
    out = []
    for x in pushed:
        f = np.zeros(CELLS)
        f[-1] = KS * (x - u[-1])
        if rule == "semi_implicit":
            left = np.diag(m / h**2 + DAMPING * m / (2 * h)) + K
            right = f + m / h**2 * (2 * u - before) + DAMPING * m / (2 * h) * before
            new = np.linalg.solve(left, right)
        elif rule == "explicit":
            ch = DAMPING * h
            new = u + (2 - ch) / (2 + ch) * (u - before) - 2 * h**2 / (m * (2 + ch)) * (K @ u - f)
        else:
            v = (u - before) / h + h * (f - K @ u - DAMPING * (u - before) / h * m) / m
            new = u + h * v
        u, before = new, u
        out.append(KS * (x - u[-1]))
    return np.array(out)


# --- exact truths ---------------------------------------------------------------------------------


@pytest.mark.parametrize("rule", ["semi_implicit", "explicit", "euler"])
def test_one_region_is_the_plain_scheme(rule: Any) -> None:
    pushed = swing(0.3)
    ours = force(replace(WHOLE, solvers=(rule,)), pushed)
    assert ours == pytest.approx(by_hand(pushed, rule), abs=1e-9)
    assert np.abs(ours).max() > 1.0


def test_a_region_of_all_layers_is_the_whole_body_bit_for_bit_and_says_so() -> None:
    pushed = swing(0.2)
    most = replace(NEAR, layers=(CELLS,))
    assert np.array_equal(force(most, pushed), force(WHOLE, pushed))
    stepper = stepper_of(most)
    said = stepper.notices(stepper.step(stepper.rest(), np.zeros(2)))
    assert said == ("1 of 2 regions lie beyond the body's 12 layers and are omitted",)


def test_equal_rates_without_delay_are_the_one_solve() -> None:
    """Explicit regions see each other at the step's begin; implicit ones are solved jointly."""
    pushed = swing(0.3)
    equal = replace(NEAR, rates=(1000.0,))
    for solver in ("explicit", "euler"):
        apart = force(replace(equal, border="hold", solvers=(solver,)), pushed)
        assert apart == pytest.approx(by_hand(pushed, solver), abs=1e-9)
    joint = force(replace(equal, border="joint"), pushed)
    assert joint == pytest.approx(by_hand(pushed), abs=1e-9)
    late = force(replace(equal, border="hold"), pushed)
    assert np.abs(late - by_hand(pushed)).max() > 1e-3  # a tick late is not the whole solve


@pytest.mark.slow
@pytest.mark.parametrize("border", ["delayed", "hold", "joint"])
@pytest.mark.parametrize("far", ["semi_implicit", "static"])
def test_the_static_limit_is_exact(border: Any, far: Any) -> None:
    ramp = np.minimum(np.arange(1, 4001) / 500, 1.0) * 0.01
    settings = replace(NEAR, border=border, solvers=("semi_implicit", far))
    assert force(settings, ramp)[-1] == pytest.approx(LIMIT, rel=1e-6)


@pytest.mark.slow
def test_three_regions_of_three_solvers_settle_at_the_static_limit() -> None:
    ramp = np.minimum(np.arange(1, 6001) / 500, 1.0) * 0.01
    settings = replace(
        NEAR, layers=(3, 3), rates=(500.0, 50.0),
        solvers=("explicit", "semi_implicit", "static"),
    )  # fmt: skip
    assert force(settings, ramp)[-1] == pytest.approx(LIMIT, rel=1e-6)


def test_the_whole_solve_has_the_impedance_of_the_continuous_bar() -> None:
    """Published values of an independent reconstruction; then ours by a finer bar."""
    exact = 0.01 * beside("async_line", "twin").impedance(bar(E, 40), KS, np.array([0.1, 0.5, 1.0]))
    assert exact == pytest.approx([1.66631, 1.65771, 1.63060], abs=5e-6)
    cells = 40
    settings = replace(WHOLE, pad=pad_of(cells))
    ours = force(settings, swing(3.0), bar(E, cells))[2000:]
    assert ours.max() == pytest.approx(exact[2], rel=2e-3)


def test_without_a_spring_there_is_no_force() -> None:
    assert not force(replace(NEAR, spring=0.0), swing(0.1)).any()


# --- orders and stability -------------------------------------------------------------------------


@pytest.mark.slow
def test_the_error_of_borders_is_of_first_order_in_the_slow_period() -> None:
    pushed = swing(2.0)
    whole = force(WHOLE, pushed)
    fast = [replace(NEAR, layers=(6,), rates=(1000.0 / n,)) for n in (2, 4, 8)]
    off = [float(np.sqrt(np.mean((force(s, pushed) - whole)[1000:] ** 2))) for s in fast]
    assert np.log2(np.divide(off[1:], off[:-1])) == pytest.approx([1.0, 1.0], abs=0.35)


@pytest.mark.slow
def test_overlap_cuts_the_error() -> None:
    pushed = swing(2.0)
    whole = force(WHOLE, pushed)
    off = [np.abs(force(replace(NEAR, overlap=n), pushed) - whole)[1000:].max() for n in (0, 2, 4)]
    assert off[0] > 2 * off[1] > 2 * off[2]


def _radius(settings: AsyncRegions) -> float:
    """Over a common period, with the spring whose probe stands still."""
    stepper = stepper_of(settings)
    state = stepper.step(stepper.rest(), np.zeros(2))
    held, regions = state.inner.held, state.inner.regions
    ends = np.flatnonzero(np.isin(stepper.body.body.node, held.pad))

    def pull(visible: Floats) -> Floats:
        f = np.zeros_like(visible)
        f[ends] = -settings.spring * visible[ends].mean(axis=0) / len(ends)
        return f

    return spectral_radius(regions.coupled, pull)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "stable"),
    [
        ({}, True),
        ({"spring": 3000.0, "layers": (), "rates": ()}, True),
        ({"spring": 200e3, "layers": (), "rates": ()}, False),
        ({"spring": 200e3}, False),
        ({"solvers": ("explicit",), "rates": (500.0,)}, False),  # each below its critical step
        ({"solvers": ("explicit",), "rates": (1000.0,), "border": "hold"}, True),
        ({"solvers": ("explicit", "semi_implicit"), "rates": (500.0,)}, True),
        ({"solvers": ("explicit",), "rates": (100.0,), "beyond_limit": "run"}, False),
        ({"border": "hold", "rates": (5.0,)}, True),
    ],
)
def test_the_spectral_radius_predicts_divergence(changes: dict[str, Any], stable: bool) -> None:
    settings = replace(NEAR, **changes)
    assert (_radius(settings) <= 1 + 1e-9) is stable
    kick = np.zeros(4000)
    kick[:20] = 1e-3
    last = walked(settings, kick)[-1]
    assert (last.failure is None) is stable
    if last.failure:
        assert last.failure[0] == "diverged"


def test_an_explicit_region_beyond_its_critical_step_is_refused_with_both_numbers() -> None:
    """l sqrt(rho/E) = 1.118 ms at 5 kPa, 0.5 ms at 25 kPa on the paper's bar."""
    cells = 40
    settings = replace(WHOLE, solvers=("explicit",), pad=pad_of(cells))
    assert walked(settings, np.zeros(2), bar(5e3, cells))[-1].failure is None
    (state,) = walked(settings, np.zeros(2), bar(25e3, cells))
    assert state.failure is not None
    assert state.failure[0] == "refused"
    assert "0.001 s takes 2 times its critical step of 0.0005" in state.failure[1]


# --- regions that change --------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("adapt", "border"), [("linear", "delayed"), ("saturating", "hold"), ("threshold", "delayed")]
)
def test_a_primary_region_that_follows_the_deformation_keeps_the_static_limit(
    adapt: Any, border: Any
) -> None:
    up = np.minimum(np.arange(1, 5001) / 2000, 1.0) * 0.01
    settings = replace(NEAR, layers=(2,), adapt=adapt, border=border, most=8, slope=4.0, moved=3e-3)
    states = walked(settings, up)
    layers = [s.numbers["probe.layers"] for s in states]
    assert layers[0] == 2
    assert 2 < layers[-1] <= 8
    assert states[-1].numbers["probe.force.x"] == pytest.approx(LIMIT, rel=1e-6)


@pytest.mark.slow
def test_a_change_of_regions_at_rest_under_load_moves_nothing() -> None:
    settings = replace(NEAR, layers=(3,), adapt="linear", most=9)
    states = walked(settings, np.minimum(np.arange(1, 6001) / 500, 1.0) * 0.01)
    stepper = stepper_of(settings)
    inner = states[-1].inner
    other = stepper.plan.regions(inner.held.pad, 7)
    motion = carried(inner.regions.coupled, inner.motion, other.coupled)
    f = stepper.probe.nodal(inner.held, np.array(stepper.tool.tip) - [0.01, 0.0], motion.visible)
    still = motion.visible
    for _ in range(200):
        motion = other.coupled.tick(motion, f)
    assert motion.visible == pytest.approx(still, abs=1e-9)


def test_sizes_by_hand() -> None:
    """Deformation of 3 layers' length, slope 2: six layers; saturating begins with that slope."""
    layer, moved = np.arange(10), np.linspace(1e-3, 0.0, 10)
    size = PrimarySize("linear", 2, 8, 2.0, 5e-4, 2e-3)
    assert size.layers(6e-3, moved, layer) == 6
    assert size.layers(1.0, moved, layer) == 8
    assert size.layers(0.0, moved, layer) == 2
    assert replace(size, name="saturating").layers(1.0, moved, layer) == 8
    assert replace(size, name="saturating").layers(6e-3, moved, layer) == 6  # 2 + 6 (1 - 1/e)
    assert replace(size, name="threshold").layers(0.0, moved, layer) == 5  # layers 0 to 4
    assert replace(size, name="fixed").layers(1.0, moved, layer) == 2


def test_a_contact_that_moves_keeps_its_force_and_takes_its_regions_along() -> None:
    scene = block(E, 6, 2)
    stepper = stepper_of(AsyncRegions(H, (2,), (50.0,), reach=5e-3, slides=True), scene)
    state, moves = stepper.rest(), 0
    for k in range(400):
        shift = np.array([-0.005 * min(k / 100, 1.0), 0.03 * max(k - 100, 0) / 300])
        old, tip = state.inner, np.array(stepper.tool.tip) + shift
        state = stepper.step(state, shift)
        if state.inner.held.node == old.held.node:
            continue
        moves += 1
        u = old.motion.visible
        before = stepper.probe.force(old.held, tip, u)
        assert stepper.probe.force(state.inner.held, tip, u) == pytest.approx(before, abs=1e-12)
        assert state.numbers["probe.changed"] == 1.0
        primary = state.inner.regions.coupled.zones[0]
        assert stepper.body.unknowns(np.array([state.inner.held.node]))[0] in primary.own
    assert moves >= 1


def test_a_probe_takes_hold_within_its_reach_only_and_may_let_go() -> None:
    scene = bar(E, CELLS)
    tool = replace(scene.tools[0], tip=(LENGTH + 0.02, LENGTH / CELLS / 2))
    far = replace(scene, tools=(tool,))
    states = walked(replace(NEAR, grip=0.1), np.linspace(0.0, 0.025, 100), far)
    touched = [s.numbers["probe.contact"] for s in states]
    assert touched[0] == 0.0
    assert touched[-1] == 1.0
    back = np.concatenate([np.linspace(0, 0.025, 100), np.linspace(0.025, 0.0, 100)])
    assert walked(replace(NEAR, grip=0.1), back, far)[-1].numbers["probe.contact"] == 0.0


# --- refused or rounded, in words -----------------------------------------------------------------


def test_rates_that_do_not_divide_the_primary_one_are_rounded_in_words() -> None:
    assert ratios((500.0, 50.0), 1e-3) == ((2, 20), ())
    assert ratios((1e-3,), 1e-3)[1] == ("0.001 Hz is solved every 1000 s, never in a shorter run",)
    assert ratios((300.0,), 1e-3) == (
        (3,),
        ("300 Hz does not divide 1000 Hz: solved every 3 ticks, at 333.3 Hz",),
    )
    stepper = stepper_of(replace(NEAR, rates=(300.0,)))
    assert "300 Hz does not divide" in stepper.notices(stepper.rest())[0]


def test_what_is_rounded_or_left_out_is_said_by_the_run_once() -> None:
    settings = replace(NEAR, layers=(4, CELLS), rates=(300.0, 50.0))
    t, still = H * np.arange(1, 6), np.zeros((5, 2))
    run = run_scheme("r", settings, bar(E, CELLS), t, still, np.array([4]))
    assert run.said == (
        "300 Hz does not divide 1000 Hz: solved every 3 ticks, at 333.3 Hz",
        "1 of 3 regions lie beyond the body's 12 layers and are omitted",
    )
    assert run_scheme("r", NEAR, bar(E, CELLS), t, still, np.array([4])).said == ()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"rates": (2000.0,)}, "2000 Hz with a primary one at 1000 Hz"),
        ({"rates": (0.0,)}, "0 Hz with"),
        ({"rates": ()}, "1 layer counts and 0 rates"),
        ({"solvers": ("static",) * 3}, "3 solvers for 2 regions"),
        ({"layers": (5, 0), "rates": (50.0, 5.0)}, "expected at least 1 for each region"),
        ({"adapt": "linear", "most": 3}, "4 layers that grows to 3 at most"),
        ({"dt": 0.0}, "tick of 0 s"),
        ({"overlap": -1}, "overlap -1"),
        ({"border": "joint", "overlap": 1}, "remove the overlap"),
        ({"border": "joint", "solvers": ("explicit",)}, "remove the overlap and explicit solvers"),
        ({"grip": -1.0}, "grip -1 N"),
    ],
)
def test_settings_that_make_no_regions_are_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        replace(NEAR, **changes)


def test_empty_regions_and_parted_bodies_are_refused_and_parted_regions_said() -> None:
    graph = stepper_of(WHOLE).body.graph
    end = np.array([graph.shape[0] - 1])
    layer = layers_from(graph, end)
    with pytest.raises(SceneError, match="expected at least 1 for each region"):
        split(layer, (0,), graph)
    middle = layers_from(graph, np.array([5]))
    assert (
        "region 2 is 2 parts that are connected only through other regions"
        in split(middle, (2,), graph).words
    )
    parted = graph.copy().tolil()
    parted[5, :] = 0
    parted[:, 5] = 0
    with pytest.raises(SceneError, match="not connected to the contact"):
        layers_from(parted.tocsr(), end)


def test_damping_by_stiffness_is_refused() -> None:
    scene = bar(E, CELLS)
    with pytest.raises(SceneError, match="remove stiffness_damping, or use Newmark"):
        stepper_of(NEAR, replace(scene, material=replace(scene.material, stiffness_damping=0.1)))


@pytest.mark.slow
@pytest.mark.parametrize("dimension", [2, 3])
def test_regions_of_a_block_settle_where_the_whole_body_does(dimension: int) -> None:
    scene = block(E, 4, dimension)
    ramp = np.minimum(np.arange(1, 2001) / 500, 1.0) * 0.005
    whole = force(AsyncRegions(H, (), ()), ramp, scene)[-1]
    near = force(AsyncRegions(H, (2, 1), (500.0, 250.0), overlap=1), ramp, scene)[-1]
    assert near == pytest.approx(whole, rel=1e-3)
    assert whole > 0


@pytest.mark.parametrize(("least", "most"), [(0, 3), (4, 3), (-1, -1)])
def test_layers_of_a_region_rise_from_one(least: int, most: int) -> None:
    with pytest.raises(SceneError, match=rf"of {least} to {most} layers: .* 1"):
        PrimarySize("linear", least, most, 1.0, 1e-3, 1e-3)


def test_touched_bodies_have_the_damping_of_their_nodes_only() -> None:
    material = SimpleNamespace(stiffness_damping=0.1)
    system = SimpleNamespace(scene=SimpleNamespace(materials=(material,)), free=np.arange(3))
    with pytest.raises(SceneError, match=r"nodal damping, C = alpha M"):
        RegionBody.of(system)  # type: ignore[arg-type]


def zone(wide: list[int], own: list[int], ratio: int) -> Zone:
    places = np.searchsorted(wide, own)
    return Zone(np.array(wide), np.array(own), places, ratio, "newmark", None, None)  # type: ignore[arg-type]


def test_a_node_that_changes_regions_keeps_its_place_and_velocity_by_hand() -> None:
    """Node 2 goes 8 mm in a period of four ticks: 2 mm a tick in the region of every tick."""
    old = SimpleNamespace(zones=(zone([0, 1, 2], [0, 1], 1), zone([1, 2, 3], [2, 3], 4)))
    new = SimpleNamespace(zones=(zone([0, 1, 2], [0, 1, 2], 1), zone([2, 3], [3], 4)))
    visible = np.array([1.0, 2.0, 30.0, 40.0])
    pieces = (
        Piece(np.array([1.0, 2.0, 7.0]), np.array([0.5, 1.0, 6.0]), visible[:2], visible),
        Piece(np.array([9.0, 28.0, 38.0]), np.array([8.0, 20.0, 46.0]), visible[2:], visible),
    )
    found = carried(old, Motion(5, pieces, visible), new)  # type: ignore[arg-type]
    first, second = found.pieces
    assert first.u.tolist() == [1.0, 2.0, 7.0]  # histories that the region had
    assert first.before.tolist() == [0.5, 1.0, 6.0]
    assert first.start.tolist() == [1.0, 2.0, 30.0]  # what it takes over stands where it is shown
    assert second.u.tolist() == [28.0, 38.0]
    narrow = SimpleNamespace(zones=(zone([0, 1], [0, 1], 1), zone([1, 2, 3], [2, 3], 4)))
    taken = carried(narrow, Motion(5, (_first_two(pieces[0]), pieces[1]), visible), new)  # type: ignore[arg-type]
    assert taken.pieces[0].u.tolist() == [1.0, 2.0, 30.0]
    assert taken.pieces[0].before.tolist() == [0.5, 1.0, 30.0 - 2.0]
    slower = SimpleNamespace(zones=(zone([0, 1, 2], [0, 1, 2], 2), zone([2, 3], [3], 4)))
    other = carried(narrow, Motion(5, (_first_two(pieces[0]), pieces[1]), visible), slower)  # type: ignore[arg-type]
    assert other.pieces[0].before.tolist() == [1.0 - 2 * 0.5, 2.0 - 2 * 1.0, 30.0 - 2 * 2.0]


def _first_two(piece: Piece) -> Piece:
    return replace(piece, u=piece.u[:2], before=piece.before[:2])
