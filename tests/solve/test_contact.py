"""Contact in statics: plates, Hertz, a punch, friction on a slope, and what is refused."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from contact_scenes import (
    DOWN,
    E_STAR,
    NU,
    E,
    bricks,
    graded,
    half_space,
    on_a_slope,
    pressed,
    traced,
    walked,
)
from scipy import sparse

from validate.errors import SceneError
from validate.fem.system import build
from validate.scene.contact import (
    RigidContact,
    RigidCylinder,
    RigidPlane,
    RigidPunch,
    RigidSphere,
    Shape,
)
from validate.scene.geometries.box import box, grid
from validate.scene.material import Material
from validate.scene.places import OnPlane
from validate.scene.scene import Drive, Load, Pin, Scene, Support
from validate.solve.dynamic.implicit import NewtonDynamics
from validate.solve.dynamic.newmark import Newmark
from validate.solve.explicit.central import CentralDifference
from validate.solve.march import march
from validate.solve.static.contact import SLIP, STICK, ContactNewton, ContactStepper
from validate.solve.static.newton import StaticNewton
from validate.solve.static.quasi_static import QuasiStatic

# private: _correction: called alone, case by case.

BOX = (0.1, 0.1, 0.1)
MESHES = {
    "tet4": box(BOX, (2, 2, 2)),
    "tet10": box(BOX, (1, 1, 1)).quadratic(),
    "hex8": grid(BOX, (2, 2, 2)),
}


@pytest.mark.parametrize("kind", MESHES)
def test_a_smooth_plate_squeezes_a_block_exactly(kind: str) -> None:
    """F = E A d/L on the whole face, nothing before it touches, nothing penetrates."""
    inputs = np.array([[0.0005], [0.002], [0.006], [0.0005]])
    states = walked(ContactNewton(), build(pressed(MESHES[kind])), inputs)
    assert traced(states, "plate.force") == pytest.approx([0, 1, 5, 0], rel=1e-9, abs=1e-12)
    assert traced(states, "plate.area") == pytest.approx([0, 0.01, 0.01, 0])
    assert traced(states, "plate.penetration").max() < 1e-15
    assert traced(states, "plate.friction").max() < 1e-12


@pytest.mark.parametrize("kind", ["tet4", "tet10"])
def test_at_large_strain_a_plate_is_a_drive(kind: str) -> None:
    """A smooth plate that touches all of a face, and the face itself moved, to every digit."""
    scene = pressed(MESHES[kind], "neo_hooke", gap=0.0)
    (last,) = walked(ContactNewton(), build(scene), np.array([[0.02]]))
    driven = replace(scene, contacts=(), drives=(Drive("plate", "z1", DOWN),))
    (other,) = walked(StaticNewton(), build(driven), np.array([[0.02]]))
    assert last.numbers["plate.force"] == pytest.approx(other.numbers["plate.force"], rel=1e-7)
    assert last.inner.u == pytest.approx(other.inner.u, abs=1e-10)


def test_without_a_rigid_body_it_is_plain_statics() -> None:
    scene = Scene(
        MESHES["tet4"],
        Material(E, NU),
        (Support("z0", (0, 1, 2)),),
        loads=(Load("pull", "z1", (1.0, 0.0, 0.0)),),
        drives=(Drive("press", "x1", (1.0, 0.0, 0.0)),),
    )
    ours, plain = (
        walked(scheme, build(scene), np.array([[0.001, 0.5]]))[0]
        for scheme in (ContactNewton(), QuasiStatic())
    )
    assert ours.inner.u == pytest.approx(plain.inner, rel=1e-9)
    assert ours.numbers["press.force"] == pytest.approx(plain.numbers["press.force"], rel=1e-9)


def test_hertz_cylinder() -> None:
    """F = pi E* a^2/(4 R) per metre and p_0^2 = F E*/(pi R), in plane strain.

    The half-width a is that of the pressures: for sqrt(1 - x^2/a^2) the mean of x^2 is a^2/4.
    """
    a, R = 0.01, 1.0
    system = build(half_space(RigidSphere((0.0, R), R), a, 12, 1.4, 40.0, d=2))
    stepper = ContactNewton().prepare(system)
    assert isinstance(stepper, ContactStepper)
    state = stepper.step(stepper.rest(), np.array([3 * a**2 / R]))
    assert state.failure is None
    force, pressed_ = state.numbers["tool.force"], -state.inner.forces[:, 1]
    x = system.scene.mesh.nodes[stepper.parts.nodes, 0]
    width = 2 * np.sqrt((pressed_ * x**2).sum() / pressed_.sum())
    assert force == pytest.approx(np.pi * E_STAR * width**2 / (4 * R), rel=0.01)
    peak = pressed_[np.argmin(x)] / stepper.parts.areas[np.argmin(x)]
    assert peak == pytest.approx(np.sqrt(force * E_STAR / (np.pi * R)), rel=0.01)
    assert pressed_.min() >= 0
    assert state.numbers["tool.penetration"] < 1e-12
    assert state.numbers["tool.area"] == pytest.approx(2 * width, rel=0.05)


def test_a_cylinder_in_three_dimensions_is_a_disc_in_two() -> None:
    """One layer of bricks between planes of symmetry, to every digit."""
    a, R = 0.02, 1.0
    flat = half_space(RigidSphere((0.0, R), R), a, 4, 2.0, 10.0, d=2)
    side, depth = (np.unique(flat.mesh.nodes[:, c]) for c in (0, 1))
    bar = RigidCylinder((0.0, 0.5, R), (0.0, 2.0, 0.0), R)
    solid = Scene(
        bricks(side, np.array([0.0, 0.01]), depth),
        flat.material,
        (Support("z0", (0, 1, 2)), Support("x0", (0,)), Support("y0", (1,)), Support("y1", (1,))),
        copies=2,
        contacts=(RigidContact("tool", "z1", bar, DOWN),),
    )
    forces = [
        walked(ContactNewton(), build(s), np.array([[a**2]]))[0].numbers["tool.force"]
        for s in (flat, solid)
    ]
    assert forces[1] == pytest.approx(0.01 * forces[0], rel=1e-9)


def ball(a: float, n: int, ratio: float, far: float, order: int = 1) -> tuple[float, float]:
    """Forces of a ball pressed in by d = a^2/R over Hertz's: by depth, and by the radius of the
    pressures, whose mean r^2 is 2 a^2/5."""
    scene = half_space(RigidSphere((0.0, 0.0, 1.0), 1.0), a, n, ratio, far)
    system = build(replace(scene, body=scene.mesh.quadratic()) if order == 2 else scene)
    stepper = ContactNewton().prepare(system)
    assert isinstance(stepper, ContactStepper)
    state = stepper.step(stepper.rest(), np.array([a**2]))
    assert state.failure is None
    force, down = state.numbers["tool.force"], -state.inner.forces[:, 2]
    r2 = (system.scene.mesh.nodes[stepper.parts.nodes, :2] ** 2).sum(axis=1)
    found = np.sqrt(2.5 * (down * r2).sum() / down.sum())
    by_depth = force / (4 / 3 * E_STAR * a**3)
    return by_depth, force / (4 / 3 * E_STAR * found**3)


def test_hertz_sphere_by_its_contact_radius() -> None:
    """F = 4 E* a^3/(3 R), whatever is far away."""
    assert ball(0.01, 5, 2.0, 6.0)[1] == pytest.approx(1.0, abs=0.03)


@pytest.mark.slow
def test_hertz_sphere_by_its_depth() -> None:
    """F = 4/3 E* sqrt(R) d^(3/2) on a large block, within 2 %."""
    by_depth, by_radius = ball(0.01, 2, 2.5, 100.0, order=2)
    assert by_depth == pytest.approx(1.0, abs=0.01)
    assert by_radius == pytest.approx(1.0, abs=0.03)


@pytest.mark.slow
def test_a_flat_punch() -> None:
    """F = 2 E* a d; its round end lies on a square grid of six cells a radius."""
    a = 0.01
    scene = half_space(RigidPunch((0.0, 0.0, 0.0), DOWN, a), a, 6, 1.6, 40.0)
    (state,) = walked(ContactNewton(), build(scene), np.array([[0.01 * a]]))
    assert state.numbers["tool.force"] == pytest.approx(2 * E_STAR * a * 0.01 * a, rel=0.02)
    assert state.numbers["tool.area"] == pytest.approx(np.pi * a**2, rel=0.02)


def test_a_smooth_sphere_on_a_soft_block_reverses_without_loss() -> None:
    """Statics without friction have no memory: force against depth up and down is one curve."""
    scene = replace(pressed(box(BOX, (3, 3, 3)), "neo_hooke"), supports=(Support("z0", (0, 1, 2)),))
    ball = RigidContact("plate", "z1", RigidSphere((0.05, 0.05, 0.14), 0.04), DOWN)
    up = np.array([0.005, 0.01, 0.015])
    depths = np.concatenate([up, up[:-1][::-1], [0.0]])
    states = walked(ContactNewton(), build(replace(scene, contacts=(ball,))), depths[:, None])
    forces = traced(states, "plate.force")
    assert (np.diff(forces[:3]) > 0).all()
    assert forces[3:5] == pytest.approx(forces[1::-1], rel=1e-6)
    assert abs(forces[5]) < 1e-9
    assert traced(states, "plate.penetration").max() < 1e-9


SLOPE = grid((0.1, 0.1, 0.05), (2, 2, 1))


@pytest.mark.parametrize("friction", [0.1, 0.3, 0.7])
def test_a_block_on_a_slope_stays_up_to_the_angle_of_friction(friction: float) -> None:
    """It stays at tan = .999 mu, pressed and rubbed as weight says; at 1.001 mu it slides."""
    below = np.arctan(0.999 * friction)
    (state,) = walked(ContactNewton(), on_a_slope(SLOPE, below, friction), np.array([[9.81]]))
    weight = 0.5 * 9.81
    assert state.numbers["floor.force"] == pytest.approx(weight * np.cos(below), rel=1e-8)
    assert state.numbers["floor.friction"] == pytest.approx(weight * np.sin(below), rel=1e-8)
    assert state.numbers["floor.touching"] >= state.numbers["floor.slipping"]
    beyond = ContactNewton().prepare(on_a_slope(SLOPE, np.arctan(1.001 * friction), friction))
    failed = beyond.step(beyond.rest(), np.array([9.81])).failure
    assert failed is not None
    assert failed[0] == "not_converged"
    assert "slides off: it is held only by" in failed[1]
    assert "% of the step's load was reached" in failed[1]


def dragged() -> Scene:
    """A block held below, under a rough plate that first presses, then drags along x."""
    plate = RigidPlane((0.0, 0.0, 0.1), DOWN)
    slanted = (0.8, 0.0, -0.6)
    return Scene(
        grid(BOX, (3, 1, 3)),
        Material(E, NU),
        (Support("z0", (0, 1, 2)),),
        contacts=(RigidContact("plate", "z1", plate, slanted, 0.3),),
    )


def test_coulomb_holds_at_every_node() -> None:
    """Nothing pulls; what sticks rubs with at most mu times the normal force, what slips with just
    that, against its slip."""
    stepper = ContactNewton().prepare(build(dragged()))
    assert isinstance(stepper, ContactStepper)
    state = stepper.rest()
    for q in (0.002, 0.004, 0.006):
        x = stepper.scene.mesh.nodes + stepper.field(state)
        before, state = x[stepper.parts.nodes], stepper.step(state, np.array([q]))
        assert state.failure is None
        forces, status = state.inner.forces, state.inner.status
        normal, along = -forces[:, 2], forces[:, :2]
        rubbing = np.linalg.norm(along, axis=1)
        assert normal.min() >= 0
        assert (rubbing <= 0.3 * normal * (1 + 1e-6) + 1e-12).all()
        assert rubbing[status == SLIP] == pytest.approx(0.3 * normal[status == SLIP])
        now = (stepper.scene.mesh.nodes + stepper.field(state))[stepper.parts.nodes]
        slid = (now - before)[:, :2] - np.array([0.002 * 0.8, 0.0])
        work = (along * slid).sum(axis=1)
        assert work.max() < 1e-12  # friction only takes
        assert work[status == SLIP].min() < -1e-7
    assert {SLIP, STICK} & set(status.tolist())


def test_over_a_closed_path_a_rough_tool_gets_no_more_than_it_gave() -> None:
    """There and back again in steps of statics: the tool has done work, which friction took."""
    there = np.linspace(0.001, 0.006, 6)
    path = np.concatenate([there, there[:-1][::-1], [0.0]])
    states = walked(ContactNewton(), build(dragged()), path[:, None])
    work = traced(states, "plate.work")
    assert work[5] > 0
    assert 0.01 * work[5] < work[-1] < work[5]


def test_one_iteration_is_too_few() -> None:
    stepper = ContactNewton(max_iterations=1, cuts=0).prepare(build(dragged()))
    failed = stepper.step(stepper.rest(), np.array([0.005])).failure
    assert failed is not None
    assert failed[0] == "not_converged"
    assert "after 1 iterations" in failed[1]


def test_a_run_traces_depth_and_force() -> None:
    system = build(pressed(MESHES["tet4"]))
    inputs = np.array([[0.001], [0.002]])
    run = march("c", ContactNewton().prepare(system), np.arange(2.0), inputs, np.array([1]), 0.0)
    assert run.traces["plate.displacement"].y.tolist() == [0.001, 0.002]
    units = {n: t.unit for n, t in run.traces.items() if n.startswith("plate.")}
    assert units == {
        "plate.displacement": "m", "plate.force": "N", "plate.friction": "N", "plate.area": "m^2",
        "plate.penetration": "m", "plate.touching": "1", "plate.slipping": "1", "plate.work": "J",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("shape", "words"),
    [
        (
            RigidSphere((0.05, 0.05, 0.12), 0.021),
            r"'tool' starts inside the body: 1 of 9 nodes, 1 ",
        ),
        (RigidPlane((0.0, 0.0, 0.08), DOWN), r"9 of 9 nodes, 20 mm at \(.*move it out"),
        (RigidSphere((0.0, 0.2), 0.05), r"\(0.0, 0.2\) in a scene of 3 dimensions"),
    ],
)
def test_a_rigid_body_that_starts_inside_is_refused(shape: Shape, words: str) -> None:
    tool = RigidContact("tool", "z1", shape, DOWN)
    with pytest.raises(SceneError, match=words):
        replace(pressed(MESHES["tet4"]), contacts=(tool,))


def test_bad_contacts_say_what_is_wrong() -> None:
    plane = RigidPlane((0.0, 0.0, 0.1), DOWN)
    with pytest.raises(SceneError, match=r"'tool': friction -0.1, expected 0"):
        RigidContact("tool", "z1", plane, DOWN, -0.1)
    with pytest.raises(SceneError, match="direction of length 2, needs 1"):
        RigidContact("tool", "z1", plane, (0.0, 0.0, 2.0))
    with pytest.raises(SceneError, match="rigid sphere of radius 0 m"):
        RigidSphere((0.0, 0.0, 0.0), 0.0)
    with pytest.raises(SceneError, match="give a direction of finite length"):
        RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    both = (
        RigidContact("a", "z1", plane, DOWN),
        RigidContact("b", OnPlane(BOX, DOWN).faces, plane),
    )
    with pytest.raises(SceneError, match="contact 'b' shares 9 nodes with 'a'"):
        replace(pressed(MESHES["tet4"]), contacts=both)


def test_a_body_that_nothing_holds_is_named_before_any_solve() -> None:
    scene = pressed(MESHES["tet4"])
    loose = replace(scene, supports=(Support("z0", (2,)),))
    with pytest.raises(SceneError, match=r"3 of 6 ways \(along.*z\)"):
        ContactNewton().prepare(build(loose))
    pinned = replace(loose, pins=(Pin((0.0, 0.0, 0.0), (0, 1)),))
    with pytest.raises(SceneError, match=r"in 1 of 6 ways|about z"):
        ContactNewton().prepare(build(pinned))
    ContactNewton().prepare(build(replace(pinned, pins=(*pinned.pins, Pin(BOX, (0,))))))
    ContactNewton().prepare(on_a_slope(SLOPE, 0.0, 0.3))  # what rubs on its floor is held
    with pytest.raises(SceneError, match="or place it in contact at rest"):
        ContactNewton().prepare(on_a_slope(SLOPE, 0.0, 0.0))


def test_schemes_without_contact_refuse_it() -> None:
    with pytest.raises(SceneError, match=r"contact with .* 1; use ContactNewton"):
        Newmark().prepare(build(pressed(MESHES["tet4"])))


def test_graded_lines_reach_as_far() -> None:
    line = graded(0.1, 3, 2.0, 2.0)
    assert line == pytest.approx([0, 0.1, 0.2, 0.3, 0.5, 0.9, 1.7, 3.3])


@pytest.mark.parametrize("wrong", [{"tolerance": 0.0}, {"max_iterations": 0}])
def test_settings_of_a_scheme_are_positive(wrong: dict[str, float]) -> None:
    for scheme in (ContactNewton, NewtonDynamics):
        with pytest.raises(SceneError, match=r"tolerance .*, .* iterations"):
            scheme(**wrong)  # type: ignore[arg-type]
    with pytest.raises(SceneError, match="dt 0 s"):
        NewtonDynamics(dt=0.0)
    for margin in (-0.1, 1.0):
        with pytest.raises(SceneError, match=rf"margin {margin:g}: expected a share"):
            CentralDifference(margin=margin)


def test_a_tangent_of_touching_bodies_that_is_indefinite_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One unknown of stiffness -1 N/m: no correction of Newton leads to balance."""
    one = sparse.csr_array(-np.eye(1))
    body = SimpleNamespace(tangent=lambda u, pressures: one)
    stepper = SimpleNamespace(body=body, rank=np.zeros(1, int))
    held = SimpleNamespace(L=sparse.csr_array(np.eye(1)), T=sparse.csr_array(np.eye(1)), S=None,
                           kept=np.zeros(1, int), off=np.zeros(1), du=np.zeros(1))  # fmt: skip
    with pytest.raises(SceneError, match=r"definite \(1 negative pivots\)"):
        ContactStepper._correction(stepper, np.zeros(1), None, held)  # type: ignore[arg-type]
