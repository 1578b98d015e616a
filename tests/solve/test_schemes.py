"""The contract of every scheme: prepare, rest, step, field, traces."""

from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np
import pytest
from phantoms import COARSE_GRID, phantom_mesh, phantom_scene

from validate.errors import SceneError
from validate.estimate.filters import FILTERS
from validate.fem.system import System, build
from validate.parameters import with_values
from validate.scene.contact import Needle, RigidContact, RigidPlane
from validate.scene.geometries.box import box
from validate.scene.material import LawName, Material
from validate.scene.scene import Drive, Load, Scene, Support
from validate.solve.dynamic.modal import Modal
from validate.solve.handles import INSTEAD, LARGE
from validate.solve.schemes import SCHEMES, SOLVERS, schemes_that
from validate.solve.static.load_table import Tabulated
from validate.solve.static.newton import StaticNewton
from validate.solve.types import Scheme
from validate.testing import scheme_contract

# Linear schemes of drives and cavities, and those of drives and loads.
LINEAR = schemes_that(lambda h: "linear" in h.law and h.cavities and "needle" not in h.contact)
INERTIAL = schemes_that(lambda h: h.law == ("linear",) and h.loads)

# Dynamics at large strain of drives and loads, without cavities.
LARGE_INERTIAL = schemes_that(lambda h: "linear" not in h.law and h.inertia and h.loads)

# Bodies that touch rigid ones.
TOUCHING = schemes_that(lambda h: "rigid" in h.contact)

# Bodies that a needle touches, whose path is given.
NEEDLES = schemes_that(lambda h: "needle" in h.contact)


@pytest.fixture(scope="module")
def system() -> System:
    return build(phantom_scene(phantom_mesh(COARSE_GRID)))


@pytest.fixture(scope="module")
def large(system: System) -> System:
    """The same at large strain."""
    scene = system.scene
    return build(replace(scene, material=replace(scene.material, law="neo_hooke")))


@pytest.fixture(scope="module")
def pressed() -> System:
    """A block with a plate that presses it from above and a load that pulls on its side."""
    return build(
        Scene(
            box((0.02, 0.02, 0.02), (2, 2, 2)),
            Material(1e4, 0.45, rho=1000.0, stiffness_damping=0.01),
            (Support("z0", (0, 1, 2)),),
            drives=(Drive("press", "z1", (0.0, 0.0, -1.0)),),
            loads=(Load("pull", "x1", (1.0, 0.0, 0.0)),),
        )
    )


def settings(scheme: type[Scheme]) -> Scheme:
    return Tabulated(StaticNewton(), 0.001) if scheme is Tabulated else scheme()


@pytest.mark.parametrize(
    "scheme",
    [s for s in SCHEMES if s not in (*INERTIAL, *LARGE_INERTIAL, *TOUCHING, *NEEDLES)],
    ids=lambda s: s.__name__,
)
def test_a_scheme_steps_and_says_what_its_states_mean(
    scheme: type[Scheme], system: System, large: System
) -> None:
    stepper = settings(scheme).prepare(system if scheme in LINEAR else large)
    mesh = system.scene.mesh
    rest = stepper.rest()
    state = stepper.step(rest, np.array([0.001]))
    assert state.failure is None
    assert (state.k, set(state.numbers)) == (1, set(stepper.units))
    assert np.abs(stepper.field(rest)).max() == 0.0
    u = stepper.field(state)
    assert u.shape == mesh.nodes.shape
    plate = mesh.facet_nodes("x1")
    assert u[plate, 0] == pytest.approx(np.full(len(plate), -0.001))
    assert stepper.units["stage.force"] == "N"
    assert rest.numbers["stage.force"] == pytest.approx(0.0, abs=1e-12)
    assert state.numbers["stage.force"] > 0.1


@pytest.mark.parametrize("scheme", INERTIAL, ids=lambda s: s.__name__)
def test_a_scheme_of_drives_and_loads_steps_and_says_what_its_states_mean(
    scheme: type[Scheme], pressed: System
) -> None:
    stepper = scheme().prepare(pressed)
    mesh = pressed.scene.mesh
    rest = stepper.rest()
    assert (rest.k, np.abs(stepper.field(rest)).max()) == (0, 0.0)
    state = stepper.step(rest, np.array([0.001, 0.01]))
    assert state.failure is None
    assert (state.k, state.updates) == (1, 0)
    u = stepper.field(state)
    assert u.shape == mesh.nodes.shape
    plate = mesh.facet_nodes("z1")
    assert u[plate, 2] == pytest.approx(np.full(len(plate), -0.001))
    assert stepper.units == {"press.force": "N"}
    assert state.numbers["press.force"] > 0.1


@pytest.mark.parametrize(
    "scheme",
    [s for s in NEEDLES if s.handles.inertia and s.handles.law == ("linear",)],
    ids=lambda s: s.__name__,
)
def test_a_scheme_of_a_touched_body_steps_and_says_what_its_states_mean(
    scheme: type[Scheme], pressed: System
) -> None:
    """A probe that pushes a face inward feels it push back."""
    scene = replace(
        pressed.scene,
        material=Material(1e5, 0.45, rho=1000.0, mass_damping=5.0),
        drives=(),
        loads=(),
        tools=(Needle("tip", "x1", (0.02, 0.01, 0.01), (-1.0, 0.0, 0.0)),),
    )
    stepper = scheme().prepare(build(scene))
    rest = stepper.rest()
    assert (rest.k, np.abs(stepper.field(rest)).max()) == (0, 0.0)
    state = stepper.step(rest, np.array([-0.001, 0.0, 0.0]))
    assert state.failure is None
    assert (state.k, set(state.numbers)) == (1, set(stepper.units))
    u = stepper.field(state)
    assert u.shape == scene.mesh.nodes.shape
    assert u[scene.mesh.nearest_node(np.array([0.02, 0.01, 0.01])), 0] < 0
    assert stepper.units["tip.force.x"] == "N"
    assert state.numbers["tip.force.x"] > 0.1


@pytest.mark.parametrize("scheme", INERTIAL, ids=lambda s: s.__name__)
def test_a_scheme_of_drives_and_loads_refuses_fluid(scheme: type[Scheme], system: System) -> None:
    with pytest.raises(
        SceneError,
        match=r"fluid in cavities.*use ExactPressure",
    ):
        scheme().prepare(system)


@pytest.mark.parametrize("scheme", LINEAR + INERTIAL, ids=lambda s: s.__name__)
def test_a_linear_scheme_refuses_a_law_at_large_strain(scheme: type[Scheme], large: System) -> None:
    with pytest.raises(SceneError, match="cannot solve the law 'neo_hooke'"):
        scheme().prepare(large)


@pytest.mark.parametrize(
    ("scheme", "law"),
    [
        pytest.param(s, law, marks=[] if law == "neo_hooke" else pytest.mark.slow)
        for s in LARGE_INERTIAL
        for law in s.handles.law
    ],
    ids=lambda v: v if isinstance(v, str) else v.__name__,
)
def test_dynamics_at_large_strain_step_drives_and_loads(
    scheme: type[Scheme], law: LawName, pressed: System
) -> None:
    scene = pressed.scene
    material = replace(scene.material, law=law, stiffness_damping=0.0)
    stepper = scheme().prepare(build(replace(scene, material=material)))
    rest = stepper.rest()
    first = stepper.step(rest, np.array([1e-5, 0.01]))
    state = stepper.step(first, np.array([2e-5, 0.02]))
    assert state.failure is None
    assert state.k == 2
    assert np.abs(stepper.field(rest)).max() == 0.0
    plate = scene.mesh.facet_nodes("z1")
    assert stepper.field(state)[plate, 2] == pytest.approx(np.full(len(plate), -2e-5))
    assert set(rest.numbers) == set(first.numbers) == set(stepper.units)
    assert rest.numbers["press.force"] == rest.numbers["energy.strain"] == 0.0
    assert first.numbers["press.force"] > 0
    assert (stepper.units["press.force"], stepper.units["energy.strain"]) == ("N", "J")


@pytest.mark.parametrize("scheme", LARGE_INERTIAL, ids=lambda s: s.__name__)
def test_dynamics_at_large_strain_refuse_cavities_and_the_linear_law(
    scheme: type[Scheme], pressed: System, large: System
) -> None:
    with pytest.raises(SceneError, match="does not support fluid in cavities"):
        scheme().prepare(large)
    with pytest.raises(SceneError, match=r"'linear'.*neo_hooke"):
        scheme().prepare(build(replace(pressed.scene, material=Material(1e4, 0.4, rho=1000.0))))


@pytest.mark.parametrize("scheme", TOUCHING, ids=lambda s: s.__name__)
def test_contact_says_what_its_states_mean(scheme: type[Scheme], pressed: System) -> None:
    """A plate that has pressed for a step: force, area and nodes of a whole face, no depth left."""
    scene, down = pressed.scene, (0.0, 0.0, -1.0)
    plate = RigidContact("plate", "z1", RigidPlane((0.0, 0.0, 0.02), down), down, 0.2)
    material = replace(scene.material, law=scheme.handles.law[-1], stiffness_damping=0.0)
    touched = replace(scene, material=material, drives=(), contacts=(plate,))
    stepper = scheme().prepare(build(touched))
    rest = stepper.rest()
    state = stepper.step(stepper.step(rest, np.array([0.0, 1e-5])), np.array([0.0, 2e-5]))
    assert state.failure is None
    assert np.abs(stepper.field(rest)).max() == 0.0
    assert set(rest.numbers) == set(state.numbers) == set(stepper.units)
    assert rest.numbers["plate.force"] == 0.0
    assert state.numbers["plate.force"] > 0
    assert state.numbers["plate.touching"] == 9.0
    assert state.numbers["plate.area"] == pytest.approx(4e-4)
    assert state.numbers["plate.penetration"] < 1e-12
    assert stepper.field(state)[scene.mesh.facet_nodes("z1"), 2] == pytest.approx(-2e-5)


@pytest.mark.parametrize("scheme", [s for s in SCHEMES if s not in TOUCHING])
def test_contact_is_refused_by_the_others(scheme: type[Scheme], pressed: System) -> None:
    law, down = scheme.handles.law[-1], (0.0, 0.0, -1.0)
    plate = RigidContact("plate", "z1", RigidPlane((0.0, 0.0, 0.02), down), down)
    material = replace(pressed.scene.material, law=law)
    scene = replace(pressed.scene, material=material, loads=(), contacts=(plate,))
    with pytest.raises(SceneError, match=r"does not support.*1"):
        settings(scheme).prepare(build(scene))


OTHER_BLOCKS = ("Tabulated", "NeedleLoop", "HapticLoop")  # of one drive, or of a needle in it


@pytest.mark.parametrize("check", scheme_contract, ids=lambda check: check.__name__)
@pytest.mark.parametrize("scheme", SCHEMES, ids=lambda scheme: scheme.__name__)
def test_a_scheme_keeps_its_contract(scheme: type[Scheme], check: Callable[[Scheme], None]) -> None:
    if scheme.__name__ not in OTHER_BLOCKS or check in scheme_contract[3:]:
        check(settings(scheme))


@pytest.mark.parametrize("kind", SCHEMES)
def test_only_the_step_is_in_seconds(kind: type[Scheme]) -> None:
    for f in fields(kind):  # type: ignore[arg-type]
        if f.name != "inner":  # itself a scheme
            assert (f.metadata["unit"] == "s") == (f.name == "dt"), f.name


@pytest.mark.parametrize("propagate", ["linear", "constant", "average", "generalised_alpha"])
def test_every_propagation_of_modes_can_be_set_as_text(propagate: str) -> None:
    assert with_values(Modal(), {"propagate": propagate}).propagate == propagate


def test_what_a_refusal_names_instead_handles_it() -> None:
    """Every name is a scheme, solver or filter, and its `handles` has the part."""
    known = {kind.__name__: kind.handles for kind in (*SCHEMES, *SOLVERS, *FILTERS)}
    for part, names in INSTEAD.items():
        for name in names:
            h = known[name]
            has = {
                "mesh": h.mesh,
                "point": not h.mesh,
                "rigid_body": not h.mesh and not h.law,
                "membranes": "membranes" in h.contact,
                "rigid": "rigid" in h.contact,
                "needle": "needle" in h.contact,
                **{law: law in h.law for law in ("linear", *LARGE)},
            }
            assert has.get(part) or getattr(h, part, False), (part, name)


def test_handles_cover_what_prepares(system: System, large: System, pressed: System) -> None:
    """What `covers` promises of a scene is what `prepare` does."""
    for scheme in SCHEMES:
        for body in (system, large, pressed):
            if scheme.handles.covers(body.scene):
                continue
            with pytest.raises(SceneError, match="; use "):
                settings(scheme).prepare(body)
    linear = {s for s in TOUCHING if "linear" in s.handles.law}
    assert {s for s in SCHEMES if s.handles.covers(pressed.scene)} == {*INERTIAL, *linear}
