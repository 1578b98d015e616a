"""Static Newton: uniaxial truths, energy, locking, the linear limit, contracts of a stepper."""

from dataclasses import FrozenInstanceError, replace
from types import SimpleNamespace

import numpy as np
import pytest
from law_samples import NAMES, sample
from newton_scenes import SIDE, cube, phantom, phantom_system, prepared, pressed
from scipy.optimize import brentq

from validate.errors import SceneError
from validate.fem.laws.law import law_of
from validate.fem.system import build
from validate.scene.material import Material
from validate.scene.scene import Dilatation
from validate.solve.fluid.cavities import ExactPressure, NoFluid
from validate.solve.march import march
from validate.solve.static import newton
from validate.solve.static.newton import NewtonStepper, StaticNewton
from validate.solve.types import State

# private: _corrected: replaced, to bring a case about.

ELEMENTS: list[tuple[int, Dilatation]] = [(1, "pointwise"), (1, "nodal_mean"), (2, "pointwise")]
elements = pytest.mark.parametrize(("order", "dilatation"), ELEMENTS)


def force(state: State) -> float:
    assert state.failure is None
    return state.numbers["stage.force"]


def at(stepper: NewtonStepper, state: State, d: float) -> State:
    return stepper.step(state, np.array([d]))


# Exact truths


@elements
@pytest.mark.parametrize("nu", [0.0, 0.3, 0.49])
def test_saint_venant_kirchhoff_between_slipping_plates(
    nu: float, order: int, dilatation: Dilatation
) -> None:
    """An earlier study: 25.65 N at stretch .9 and 43.20 N at .8, any nu."""
    stepper = prepared(cube("svk", nu, n=3, order=order, dilatation=dilatation))
    first = pressed(stepper, 0.01)
    assert force(first) == pytest.approx(25.65, rel=1e-8)
    assert force(at(stepper, first, 0.02)) == pytest.approx(43.20, rel=1e-8)
    side = SIDE * np.sqrt(1 + nu * (1 - 0.9**2))
    x = stepper.scene.mesh.nodes + stepper.field(first)
    assert np.ptp(x, axis=0) == pytest.approx([side, side, 0.09], rel=1e-8)


def uniaxial(material: Material, stretch: float) -> float:
    """Plate force N of the cube with free sides: the lateral stretch from its own equilibrium."""
    point = law_of(material)

    def stress(side: float) -> np.ndarray:
        return point.stress(np.diag([side, side, stretch]) - np.eye(3))

    side = brentq(lambda s: stress(s)[0, 0], 0.8, 1.8, xtol=1e-15, rtol=1e-14)
    return float(-(SIDE**2) * stress(side)[2, 2])


@elements
@pytest.mark.parametrize("nu", [0.0, 0.3, 0.49])
def test_neo_hooke_between_slipping_plates(nu: float, order: int, dilatation: Dilatation) -> None:
    stepper = prepared(cube("neo_hooke", nu, n=3, order=order, dilatation=dilatation))
    state = stepper.rest()
    for stretch in (0.9, 0.7, 0.5, 1.3):
        state = at(stepper, state, (1 - stretch) * SIDE)
        assert force(state) == pytest.approx(uniaxial(stepper.scene.material, stretch), rel=1e-7)


@pytest.mark.parametrize("name", [n for n in NAMES if n not in ("svk", "neo_hooke")])
def test_every_law_between_slipping_plates(name: str) -> None:
    """The uniaxial curve of the material point, at nu .49 and on quadratic elements."""
    scene = replace(cube("svk", n=3, order=2), material=sample(name, 30e3, 0.49))
    stepper = prepared(scene)
    state = stepper.rest()
    for stretch in (0.8, 0.6, 1.3):
        state = at(stepper, state, (1 - stretch) * SIDE)
        assert force(state) == pytest.approx(uniaxial(scene.material, stretch), rel=1e-7)


def test_a_stretch_beyond_the_stated_ones_is_an_outcome() -> None:
    card = Material.mooney_rivlin(4e3, 1e3, 0.4, stretches=(0.7, 1.2))
    stepper = prepared(replace(cube("svk", n=3), material=card))
    assert at(stepper, stepper.rest(), 0.25 * SIDE).failure is None
    for d, words in ((0.35, "is below 0.700; last good"), (-0.25, "is above 1.200")):
        failed = at(stepper, stepper.rest(), d * SIDE)
        assert failed.failure is not None
        assert failed.failure[0] == "invalid"
        assert words in failed.failure[1]


@elements
def test_incompressible_limit_of_neo_hooke(order: int, dilatation: Dilatation) -> None:
    """sigma = mu (lambda^2 - 1/lambda), so F = A mu (1/lambda^2 - lambda); at nu .4999 to .1 %."""
    stepper = prepared(cube("neo_hooke", 0.4999, n=3, order=order, dilatation=dilatation))
    mu = stepper.scene.material.shear_modulus
    state = stepper.rest()
    for stretch in (0.9, 0.7, 0.5):
        state = at(stepper, state, (1 - stretch) * SIDE)
        assert force(state) == pytest.approx(SIDE**2 * mu * (stretch**-2 - stretch), rel=1e-3)


def test_force_peaks_at_the_end_of_the_law() -> None:
    """F = A E lambda (1 - lambda^2) / 2 is largest at lambda = .577, where the law ends."""
    stepper = prepared(cube("svk", 0.49, n=3))
    depths = np.array([0.0, 0.02, 0.035, 0.039, 0.0422])
    state, forces = stepper.rest(), []
    for d in depths:
        state = at(stepper, state, d)
        forces.append(force(state))
    stretch = 1 - depths / SIDE
    assert forces == pytest.approx(SIDE**2 * 30e3 * stretch * (1 - stretch**2) / 2, abs=1e-6)
    slopes = np.diff(forces) / np.diff(depths)
    assert (slopes > 0).all()
    assert slopes[-1] < 0.05 * slopes[0]


@pytest.mark.slow
def test_work_of_the_plate_is_the_stored_energy() -> None:
    """The fluid keeps its volume, so it takes none; Simpson's rule along the load path."""
    stepper = StaticNewton().prepare(phantom_system())
    assert isinstance(stepper, NewtonStepper)
    depths = np.linspace(0, 0.009, 13)
    state, forces = stepper.rest(), []
    for d in depths:
        state = at(stepper, state, d)
        forces.append(force(state))
    weights = np.array([1, *(5 * [4, 2]), 4, 1]) / 3 * depths[1]
    assert stepper.problem.body.energy(state.inner.u) == pytest.approx(weights @ forces, rel=2e-6)


def test_small_strain_is_the_linear_scheme() -> None:
    """Force, pressure and field of a short stroke; what is left falls with the stroke."""
    system = phantom_system()
    newton = StaticNewton().prepare(system)
    linear = ExactPressure().prepare(build(phantom("linear")))
    left = []
    for d in (1e-5, 1e-6):
        mine = newton.step(newton.rest(), np.array([d]))
        theirs = linear.step(linear.rest(), np.array([d]))
        expected = theirs.numbers["stage.force"]
        field = newton.field(mine) - linear.field(theirs)
        left.append(
            [
                force(mine) / expected - 1,
                mine.numbers["cyst.pressure"] / theirs.numbers["cyst.pressure"] - 1,
                np.abs(field).max() / d,
            ]
        )
        assert np.abs(field).max() < 2e-3 * d
    assert np.abs(left[1]).max() < 1e-4
    assert np.abs(left[1]) == pytest.approx(np.abs(left[0]) / 10, rel=0.1)


def test_mean_dilatation_does_not_lock_at_large_strain() -> None:
    """A bonded cube, 20 % compression, one mesh: what nu .4995 adds to the excess over P2."""
    excess = {}
    for nu in (0.3, 0.4995):
        forces = [
            force(pressed(prepared(cube("neo_hooke", nu, "bonded", order=o, dilatation=d)), 0.02))
            for o, d in ELEMENTS
        ]
        excess[nu] = [f / forces[2] for f in forces]
    assert excess[0.3] == pytest.approx([1.0, 1.0, 1.0], abs=0.08)
    assert excess[0.4995][0] > 8
    assert excess[0.4995][1] < 1.6


# Contracts of a stepper


def test_march_walks_and_traces() -> None:
    stepper = StaticNewton().prepare(phantom_system())
    assert isinstance(stepper, NewtonStepper)
    t = np.arange(5.0)
    drives = np.array([0.0, 0.003, 0.003, 0.006, 0.0])[:, None]
    run = march("newton", stepper, t, drives, np.array([1, 4]), 0.0)
    assert run.finished
    assert {name: trace.unit for name, trace in run.traces.items()} == {
        "updates": "1",
        "stage.displacement": "m",
        "stage.force": "N",
        "cyst.pressure": "Pa",
        "cyst.volume_ratio": "1",
        "tangent.negative_pivots": "1",
        "newton.factorisations": "1",
    }
    y = {name: trace.y for name, trace in run.traces.items()}
    assert y["stage.displacement"].tolist() == drives[:, 0].tolist()
    assert y["stage.force"][0] == y["cyst.pressure"][0] == y["updates"][0] == 0
    assert y["stage.force"][3] > 1.9 * y["stage.force"][1] > 0
    assert y["cyst.pressure"][3] > 1.9 * y["cyst.pressure"][1] > 0
    assert abs(y["stage.force"][4]) < 1e-8 * y["stage.force"][3]
    assert y["cyst.volume_ratio"] == pytest.approx(1.0, abs=1e-10)
    moved = run.u[0][stepper.scene.mesh.facet_nodes("x1"), 0]
    assert moved == pytest.approx(-0.003, abs=1e-15)
    assert np.abs(run.u[1]).max() < 1e-10


def test_hold_costs_nothing() -> None:
    stepper = prepared(cube("neo_hooke"))
    state = pressed(stepper, 0.01)
    held = at(stepper, state, 0.01)
    assert state.updates > 0
    assert held.updates == 0
    assert held.numbers["newton.factorisations"] == 0
    assert held.inner.u is state.inner.u
    assert force(held) == force(state)
    rest = at(stepper, stepper.rest(), 0.0)
    assert rest.updates == 0
    assert not stepper.field(rest).any()


def test_factorisations_are_kept_and_change_nothing() -> None:
    depths = np.linspace(0, 0.02, 41)[1:]
    totals, last = {}, {}
    for contraction in (0.2, 0.0):
        stepper = prepared(cube("neo_hooke", 0.45), StaticNewton(contraction=contraction))
        state, total = stepper.rest(), 0.0
        for d in depths:
            state = at(stepper, state, d)
            total += state.numbers["newton.factorisations"]
        totals[contraction], last[contraction] = total, force(state)
    assert totals[0.2] <= 20  # the share of the body's size that `watch` names
    assert totals[0.0] >= 80
    assert last[0.2] == pytest.approx(last[0.0], rel=1e-7)


def test_where_the_body_lies_changes_nothing() -> None:
    """A tangent is taken anew after a share of the body's size, wherever it lies."""
    made = []
    for away in (0.0, 10.0):
        scene = cube("neo_hooke", 0.45, n=2)
        mesh = replace(scene.mesh, nodes=scene.mesh.nodes + np.array([away, 0.0, 0.0]))
        state = (stepper := prepared(replace(scene, body=mesh))).rest()
        total = 0.0
        for d in np.linspace(0, 0.02, 21)[1:]:
            state = at(stepper, state, d)
            total += state.numbers["newton.factorisations"]
        made.append(total)
    assert made[0] == made[1] > 1


def test_a_step_depends_on_its_state_only() -> None:
    stepper = prepared(cube("neo_hooke", 0.45, "bonded"))
    early = pressed(stepper, 0.005)
    once = at(stepper, early, 0.01)
    at(stepper, once, 0.03)
    again = at(stepper, early, 0.01)
    afresh = pressed(stepper, 0.01)
    assert again.inner.u == pytest.approx(once.inner.u, abs=1e-9 * SIDE)
    assert afresh.inner.u == pytest.approx(once.inner.u, abs=1e-9 * SIDE)


def test_symmetry_copies_count_in_the_force() -> None:
    scene = cube("neo_hooke")
    one, four = (force(pressed(prepared(replace(scene, copies=c)), 0.01)) for c in (1, 4))
    assert four == pytest.approx(4 * one, rel=1e-12)


def test_empty_cavity_has_no_pressure_and_another_volume() -> None:
    stepper = StaticNewton(fluid="none").prepare(phantom_system())
    assert isinstance(stepper, NewtonStepper)
    state = pressed(stepper, 0.003, 0.009)
    linear = NoFluid().prepare(build(phantom("linear")))
    expected = linear.step(linear.rest(), np.array([0.009])).numbers
    assert state.failure is None
    assert not state.inner.pressures.any()
    ratio = expected["cyst.volume_ratio"]
    assert state.numbers["cyst.volume_ratio"] == pytest.approx(ratio, abs=0.05)
    assert state.numbers["cyst.volume_ratio"] < 0.98


def test_settings_and_states_are_frozen() -> None:
    stepper = prepared(cube("svk"))
    for thing in (stepper.settings, stepper, stepper.rest()):
        with pytest.raises(FrozenInstanceError):
            thing.k = None  # type: ignore[misc, union-attr]
    state = pressed(stepper, 0.01)
    with pytest.raises(ValueError, match="read-only"):
        stepper.field(state)[0] = 0
    with pytest.raises(TypeError):
        state.numbers["stage.force"] = 0.0  # type: ignore[index]


def test_what_cannot_begin_is_refused() -> None:
    scene = cube("svk")
    with pytest.raises(SceneError, match="StaticNewton cannot solve the law"):
        StaticNewton().prepare(build(replace(scene, material=Material(1e3, 0.3))))
    with pytest.raises(SceneError, match="the body can move rigidly"):
        StaticNewton().prepare(build(replace(scene, supports=scene.supports[:2])))
    with pytest.raises(SceneError, match="without drive, load and cavity"):
        StaticNewton().prepare(build(replace(scene, drives=())))
    with pytest.raises(SceneError, match="ratio -1: expected"):
        StaticNewton(volume_ratio=-1.0)
    with pytest.raises(SceneError, match="0 iterations, 6 cuts"):
        StaticNewton(max_iterations=0)


def test_phantom_scene_of_both_laws_prepares() -> None:
    for law in ("svk", "neo_hooke"):
        stepper = prepared(phantom(law, 1, "pointwise"))  # type: ignore[arg-type]
        assert pressed(stepper, 0.002).failure is None


def test_a_stiffness_that_is_not_positive_at_rest_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = SimpleNamespace(factor=SimpleNamespace(negative_pivots=3))
    problem = SimpleNamespace(rest_volumes=(), balance=lambda *_: None, tangent=lambda _: found)
    monkeypatch.setattr(newton, "equilibrium", lambda *_: problem)
    with pytest.raises(SceneError, match="3 negative pivots"):
        prepared(cube("svk", n=2))


def test_a_tangent_that_vanishes_ends_a_step_by_its_words(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def vanished(*_: object) -> None:
        raise SceneError("a pivot of 0")

    stepper = prepared(cube("svk", n=2))
    monkeypatch.setattr(NewtonStepper, "_corrected", vanished)
    after = stepper.step(stepper.rest(), np.array([0.01 * SIDE]))
    assert after.failure is not None
    assert after.failure[0] == "not_converged"
    assert "a pivot of 0" in after.failure[1]
