"""States on a grid of loads: exact there, fourth order between, failures kept."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from phantoms import COARSE_GRID, phantom_mesh, phantom_scene

from validate.errors import SceneError
from validate.fem.system import System, build
from validate.scene.scene import Scene
from validate.solve.static.load_table import Tabulated
from validate.solve.static.newton import StaticNewton
from validate.solve.types import State


@dataclass(frozen=True)
class Curved:
    """A made-up scheme: u = sin(40 q), force q^3, which ends at a load."""

    end: float = np.inf
    calls: list[float] = field(default_factory=list)
    scene: Scene | None = None

    def prepare(self, system: System) -> "Curved":
        return replace(self, scene=system.scene)

    def rest(self) -> State:
        return self.at(0.0)

    def at(self, q: float) -> State:
        u = np.sin(40 * q) * np.ones(3)
        return State(0, u[None], None, 1, {"stage.force": q**3})

    @property
    def units(self) -> dict[str, str]:
        return {"stage.force": "N"}

    def step(self, state: State, drives: np.ndarray) -> State:
        q = float(drives[0])
        self.calls.append(q)
        found = self.at(q)
        return replace(found, failure=("not_converged", "ends")) if q > self.end else found

    def field(self, state: State) -> np.ndarray:
        return np.asarray(state.inner)


@pytest.fixture(scope="module")
def system() -> System:
    return build(phantom_scene(phantom_mesh(COARSE_GRID)))


def error(system: System, grid: float) -> float:
    stepper = Tabulated(Curved(), grid).prepare(system)
    at = np.linspace(0.0, 0.012, 97)
    off = [stepper.field(stepper.step(stepper.rest(), np.array([q]))) - np.sin(40 * q) for q in at]
    return float(np.abs(off).max())


def test_between_the_grid_it_is_of_fourth_order(system: System) -> None:
    errors = [error(system, grid) for grid in (0.002, 0.001, 0.0005)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx(4.0, abs=0.25)


def test_on_the_grid_it_is_the_inner_state_and_cubics_are_exact(system: System) -> None:
    stepper = Tabulated(Curved(), 0.002).prepare(system)
    on = stepper.step(stepper.rest(), np.array([0.006]))
    assert stepper.field(on)[0, 0] == np.sin(0.24)
    between = stepper.step(stepper.rest(), np.array([0.0047]))
    assert between.numbers["stage.force"] == pytest.approx(0.0047**3, rel=1e-12)


def test_every_load_of_the_grid_is_solved_once(system: System) -> None:
    inner = Curved()
    stepper = Tabulated(inner, 0.002).prepare(system)
    for q in (0.001, 0.0035, 0.006, 0.001, 0.0060001):
        stepper.step(stepper.rest(), np.array([q]))
    assert inner.calls == pytest.approx([0.002, 0.004, 0.006])


def test_beyond_the_last_solution_the_failure_is_told(system: System) -> None:
    stepper = Tabulated(Curved(end=0.005), 0.002).prepare(system)
    assert stepper.step(stepper.rest(), np.array([0.0039])).failure is None
    failed = stepper.step(stepper.rest(), np.array([0.0045]))
    assert failed.failure == ("not_converged", "ends")
    assert stepper.field(failed)[0, 0] == pytest.approx(np.sin(40 * 0.004))


def test_newton_on_a_grid_is_newton(system: System) -> None:
    """Neo-Hooke on the coarse phantom, halfway between two loads of the grid."""
    scene = replace(
        system.scene,
        material=replace(system.scene.material, law="neo_hooke"),
        dilatation="nodal_mean",
    )
    stepper = Tabulated(StaticNewton(), 0.001).prepare(build(scene))
    direct = StaticNewton().prepare(build(scene))
    one = stepper.step(stepper.rest(), np.array([0.0015]))
    two = direct.step(direct.rest(), np.array([0.0015]))
    found, known = (s.numbers["cyst.pressure"] for s in (one, two))
    assert found == pytest.approx(known, rel=1e-6)
    assert np.abs(stepper.field(one) - direct.field(two)).max() < 1e-9


def test_wrong_settings_are_refused(system: System) -> None:
    with pytest.raises(SceneError, match="load grid of 0 m"):
        Tabulated(Curved(), 0.0)
    with pytest.raises(SceneError, match="0 drives"):
        Tabulated(Curved(), 0.001).prepare(replace(system, scene=replace(system.scene, drives=())))
