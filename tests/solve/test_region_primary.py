"""A primary region of its own law: the linear run, the law's own statics, one Prony branch."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import sparse
from touched import AREA, LENGTH, bar, block, pad_of

from experiments.async_line.runs import pushed
from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.large_strain.hyperelastic import Body
from validate.fem.system import build
from validate.scene.material import Prony
from validate.scene.scene import Scene
from validate.solve.regions.body import PrimarySize
from validate.solve.regions.primary import PrimarySolver, UnsettledError
from validate.solve.regions.scheme import AsyncRegions
from validate.solve.types import State

# private: _corrected, _settled: called alone, case by case.

E, H, KS, CELLS = 5e3, 1e-3, 1000.0, 6
ONE = Prony((0.8,), (0.02,))
NEAR = AsyncRegions(H, (2,), (100.0,))
ALL = AsyncRegions(H, (), ())
SLOW = replace(ALL, dt=4e-3)  # settles within 150 ticks, damped


def last(scene: Scene, settings: AsyncRegions, path: Floats) -> State:
    """The state after a probe has gone along -x by path (nt,) m."""
    stepper = settings.prepare(build(scene))
    state = stepper.rest()
    for x in path:
        state = stepper.step(state, np.array([-x, *[0.0] * (scene.mesh.dimension - 1)]))
        assert state.failure is None, state.failure
    return state


def held(most: float, ticks: int = 150) -> Floats:
    """Pushed within a tenth of the time and held."""
    return np.asarray(most * np.minimum(np.arange(1, ticks + 1) / (0.1 * ticks), 1.0))


def damped(scene: Scene) -> Scene:
    """Settles within some hundred ticks."""
    return replace(scene, material=replace(scene.material, mass_damping=80.0))


def strained(cells: int) -> Scene:
    """The paper's bar; with nu = 0 and its sides held plane strain is plane stress."""
    return replace(bar(E, cells), plane="strain")


# --- large strain ---------------------------------------------------------------------------------


@pytest.mark.parametrize("law", ["neo_hooke", "svk"])
@pytest.mark.parametrize("solver", ["semi_implicit", "explicit", "euler"])
def test_at_small_strain_it_is_the_linear_run(law: Any, solver: Any) -> None:
    scene, path = block(E, 4, 2), 1e-7 * np.sin(np.arange(1, 81) / 15)
    linear = replace(NEAR, dt=5e-4, rates=(200.0,), solvers=(solver, "semi_implicit"))
    expected = pushed(scene, linear, path).force
    ours = pushed(scene, replace(linear, law=law), path).force
    assert ours == pytest.approx(expected, abs=1e-4 * np.abs(expected).max())
    deep = 1e5 * path
    change = pushed(scene, replace(linear, law=law), deep).force - 1e5 * expected
    assert np.abs(change).max() > 1e-3 * np.abs(1e5 * expected).max()


@pytest.mark.slow
@pytest.mark.parametrize("dimension", [2, 3])
def test_at_rest_the_whole_body_is_in_the_laws_own_equilibrium(dimension: int) -> None:
    """The forces of the whole hyperelastic body are the spring's, and nothing else."""
    scene = damped(block(E, 2, dimension, nu=0.3))
    system, settings = build(scene), replace(SLOW, law="neo_hooke")
    state = last(scene, settings, held(0.01))
    stepper = settings.prepare(system)
    body = Body(replace(scene, material=scene.material.of_law("neo_hooke")))
    tip = np.array(scene.tools[0].tip) - [0.01, *[0.0] * (dimension - 1)]
    inside = body.force(stepper.field(state).ravel())[system.free]
    spring = stepper.probe.nodal(state.inner.held, tip, state.inner.motion.visible)  # type: ignore[attr-defined]
    assert inside == pytest.approx(spring, abs=1e-5 * np.abs(spring).max())
    linear = last(scene, SLOW, held(0.01)).numbers["probe.force.x"]
    assert abs(state.numbers["probe.force.x"] / linear - 1) > 1e-3


def test_all_layers_are_the_whole_body_bit_for_bit() -> None:
    scene, path = block(E, 2, 2), 0.01 * np.sin(np.arange(1, 101) / 30)
    own = {"law": "neo_hooke", "solvers": ("explicit",)}
    many = replace(NEAR, layers=(9,), **own)  # type: ignore[arg-type]
    assert np.array_equal(
        pushed(scene, many, path).force,
        pushed(scene, replace(ALL, **own), path).force,  # type: ignore[arg-type]
    )


@pytest.mark.slow
def test_a_region_that_grows_keeps_the_static_limit_of_its_last_size() -> None:
    scene = damped(block(E, 4, 2))
    near = replace(SLOW, law="neo_hooke", layers=(1,), rates=(125.0,))
    grown = replace(near, adapt="linear", slope=8.0, most=3)
    state = last(scene, grown, held(0.01))
    layers = int(state.numbers["probe.layers"])
    assert layers == 3
    fixed = last(scene, replace(near, layers=(layers,)), held(0.01))
    assert state.numbers["probe.force.x"] == pytest.approx(fixed.numbers["probe.force.x"], rel=2e-4)
    other = last(scene, replace(near, layers=(2,)), held(0.01))
    assert abs(state.numbers["probe.force.x"] / other.numbers["probe.force.x"] - 1) > 2e-3


# --- what relaxes ---------------------------------------------------------------------------------


def relaxing(u: Floats) -> Floats:
    """What the stress of a bar (nu = 0) is over E at the ticks' ends, its strain u (nt,) growing
    linearly within each: a third of its stiffness is of the volume, two thirds relax. The
    convolution of u's rate with the kernel of the branch, in closed form."""
    g, tau = ONE.g[0], ONE.tau[0]
    t, rates = H * np.arange(len(u) + 1), np.diff(u, prepend=0.0) / H
    ages = np.maximum(t[1:, None] - t, 0.0)
    kernel = tau * (np.exp(-ages[:, 1:] / tau) - np.exp(-ages[:, :-1] / tau))
    return np.asarray(u + 2 / 3 * g * kernel @ rates)


@pytest.mark.parametrize("solver", ["static", "semi_implicit"])
def test_a_bar_relaxes_as_its_branch_does(solver: Any) -> None:
    """A body without mass carries what the spring gave it in every tick; with its mass the bar
    settles so while it is pushed slowly."""
    scene, ks = strained(CELLS), 20.0
    path = held(0.01, 400)
    settings = AsyncRegions(H, (), (), solvers=(solver,), spring=ks, prony=ONE, pad=pad_of(CELLS))
    if solver == "semi_implicit":
        scene = replace(scene, material=replace(scene.material, rho=1e-3))
    end = path - pushed(scene, settings, path).force / ks
    given = ks * (path - np.append(0.0, end[:-1]))
    told = E * AREA / LENGTH * relaxing(end)
    assert given == pytest.approx(told, abs=(1e-9 if solver == "static" else 1e-3) * told.max())
    relaxed = E * AREA / LENGTH * end
    assert np.abs(told / relaxed - 1).max() > 0.3


@pytest.mark.parametrize("law", ["linear", pytest.param("neo_hooke", marks=pytest.mark.slow)])
def test_a_block_relaxes_to_what_it_is_without_a_branch(law: Any) -> None:
    scene = damped(block(E, 2, 3, nu=0.3))
    without = last(scene, replace(SLOW, law=law), held(2e-3))
    relaxed = last(scene, replace(SLOW, law=law, prony=ONE), held(2e-3))
    assert relaxed.numbers["probe.force.x"] == pytest.approx(
        without.numbers["probe.force.x"], rel=1e-4
    )
    early = held(2e-3)[:16]
    assert (
        last(scene, replace(SLOW, law=law, prony=ONE), early).numbers["probe.force.x"]
        > 1.02 * last(scene, replace(SLOW, law=law), early).numbers["probe.force.x"]
    )


def test_both_laws_relax_alike_at_small_strain() -> None:
    scene, path = block(E, 2, 3, nu=0.3), held(1e-7, 60)
    linear, large = (
        pushed(scene, replace(ALL, law=law, prony=ONE), path).force
        for law in ("linear", "neo_hooke")
    )
    assert large == pytest.approx(linear, abs=1e-5 * linear.max())


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["explicit", "euler"])
def test_explicit_steps_relax_to_the_same_limit(solver: Any) -> None:
    scene = damped(strained(CELLS))
    settings = replace(ALL, dt=5e-4, prony=ONE, pad=pad_of(CELLS))
    implicit = last(scene, settings, held(0.01, 1000)).numbers["probe.force.x"]
    explicit = last(scene, replace(settings, solvers=(solver,)), held(0.01, 1000))
    assert explicit.numbers["probe.force.x"] == pytest.approx(implicit, rel=1e-5)


def test_the_critical_step_is_that_of_the_taut_region() -> None:
    """1.118 ms of the relaxed bar of 40 nodes falls by the root of 1 + 2/3 g."""
    scene = strained(40)
    settings = replace(ALL, dt=1.1e-3, solvers=("explicit",), pad=pad_of(40))
    assert last(scene, settings, np.zeros(2)).failure is None
    stepper = replace(settings, prony=ONE).prepare(build(scene))
    failure = stepper.step(stepper.rest(), np.zeros(2)).failure
    assert failure is not None
    assert failure[0] == "refused"
    assert f"{1.118e-3 / np.sqrt(1 + 2 / 3 * 0.8):.3g}" in failure[1]


# --- what cannot hold -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"law": "neo_hooke", "overlap": 1}, "use neither joint borders nor overlap"),
        ({"prony": ONE, "border": "joint"}, "use neither joint borders nor overlap"),
        ({"prony": ONE, "slides": True}, "cannot move"),
        ({"prony": ONE, "adapt": "linear"}, "cannot move"),
    ],
)
def test_settings_that_cannot_hold_are_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        replace(NEAR, **changes)


@pytest.mark.parametrize(
    ("scene", "changes", "words"),
    [
        (
            bar(E, 4),
            {"prony": ONE},
            "in plane stress volumetric and isochoric stiffness cannot be separated",
        ),
        (block(E, 2, 2), {"prony": ONE, "law": "neo_hooke"}, "is for bodies in 3-D"),
        (block(E, 2, 3), {"prony": ONE, "law": "svk"}, "has no isochoric part that can relax"),
        (replace(block(E, 2, 3), dilatation="nodal_mean"), {"law": "svk"}, "nodal mean dilatation"),
    ],
)
def test_scenes_that_cannot_hold_are_refused(
    scene: Scene, changes: dict[str, Any], words: str
) -> None:
    with pytest.raises(SceneError, match=words):
        replace(NEAR, **changes).prepare(build(scene))


def test_a_region_that_is_turned_over_ends_with_its_reason() -> None:
    scene = block(E, 2, 3)
    found = pushed(scene, replace(ALL, law="svk", spring=1e4), np.linspace(0.0, 0.2, 60))
    assert len(found.force) < 60
    assert "step" in found.words[-1]


def test_a_region_without_a_whole_cell_stays_linear_and_says_so() -> None:
    scene, path = block(E, 4, 2), 0.01 * np.sin(np.arange(1, 51) / 20)
    one = replace(NEAR, layers=(1,))
    found = pushed(scene, replace(one, law="neo_hooke"), path)
    assert found.words == ("a primary region of 1 layers has no complete cell and stays linear",)
    assert np.array_equal(found.force, pushed(scene, one, path).force)


def test_a_law_of_its_own_has_no_spectral_radius() -> None:
    with pytest.raises(SceneError, match="has no spectral radius"):
        replace(NEAR, law="neo_hooke").prepare(build(block(E, 2, 2))).growth()


@pytest.mark.parametrize(("slope", "moved"), [(0.0, 1e-3), (1.0, 0.0), (-1.0, 1e-3)])
def test_a_region_that_never_grows_is_refused(slope: float, moved: float) -> None:
    with pytest.raises(SceneError, match=f"slope {slope:g} and threshold {moved:g} m of the prim"):
        PrimarySize("linear", 1, 3, slope, moved, 1e-3)


def test_a_region_without_balance_or_upright_cells_is_unsettled() -> None:
    """A law whose force jumps with its sign has no balance; one that is inverted has no step."""
    one = sparse.csr_array(np.eye(1))
    jump = SimpleNamespace(
        force=lambda u: np.where(u > 0.3, 9.0, -9.0), tangent=lambda u: 0 * one,
        inverted=lambda u: False,
    )  # fmt: skip
    law = SimpleNamespace(rounding=0.0, after=lambda *_: jump)
    base = SimpleNamespace(inertia=np.ones(1), damping=np.zeros(1), next=lambda u, b, f: u)
    solver = PrimarySolver(base, law, 1e-3, one, np.zeros(1, int), np.zeros((1, 3)))
    with pytest.raises(UnsettledError, match=r"primary region after \d+ Newton"):
        solver._settled(base, np.zeros(1), np.zeros(1), np.zeros(1), jump)
    over = SimpleNamespace(force=lambda u: 0 * u, inverted=lambda u: True)
    turned = replace(solver, law=SimpleNamespace(after=lambda *_: over))
    with pytest.raises(UnsettledError, match="the primary region has inverted cells"):
        turned.walk(np.zeros(1), np.zeros(1), np.zeros(1), None)
    with pytest.raises(UnsettledError, match=r"inverts cells even at 1/\d+"):
        solver._corrected(np.zeros(1), np.ones(1), over)
