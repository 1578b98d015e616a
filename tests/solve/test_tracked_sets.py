"""Sets of nodes that follow tracked points: exact motions, totals, covariance by hand and draw."""

from dataclasses import replace

import numpy as np
import pytest

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.system import build
from validate.scene.geometries.box import box
from validate.scene.material import LawName, Material
from validate.scene.places import InBox, OnPlane
from validate.scene.scene import Load, Prescribed, Probe, Scene
from validate.solve.march import run_scheme
from validate.solve.static.newton import StaticNewton
from validate.solve.static.quasi_static import QuasiStatic
from validate.solve.types import Run, SceneSolver, Scheme

SIZE = (0.03, 0.02, 0.02)
CORNERS = (
    ("a", (0.0, 0.0, 0.0)),
    ("b", (0.0, 0.02, 0.0)),
    ("c", (0.0, 0.0, 0.02)),
    ("d", (0.03, 0.0, 0.0)),
)
BASE = OnPlane((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)).faces
LAST = np.array([0])
TURN = np.array([[0.0, -0.02, 0.01], [0.02, 0.0, -0.03], [-0.01, 0.03, 0.0]])  # antisymmetric
SHIFT = np.array([1e-3, -2e-3, 5e-4])


def at(points: tuple[tuple[str, tuple[float, ...]], ...]) -> Floats:
    return np.array([place for _, place in points])


def affine(x: Floats, gradient: Floats) -> Floats:
    return np.asarray(SHIFT + x @ gradient.T)


@pytest.mark.parametrize("count", [3, 4])
def test_rigid_motions_are_exact(count: int) -> None:
    part = Prescribed("base", BASE, CORNERS[:count])
    x = np.random.default_rng(0).uniform(-0.05, 0.05, (20, 3))
    found = part.columns(x) @ affine(part.places, TURN).ravel()
    assert found.reshape(-1, 3) == pytest.approx(affine(x, TURN), abs=1e-12)


def test_in_two_dimensions_two_points_turn_a_set() -> None:
    part = Prescribed("base", "x0", (("a", (0.0, 0.0)), ("b", (0.0, 0.02))))
    assert part.inputs == ("base.a.x", "base.a.y", "base.b.x", "base.b.y")
    turned = part.columns(np.array([[0.01, 0.01]])) @ np.array([0.001, 0.0, -0.001, 0.0])
    assert turned == pytest.approx([0.0, 0.001])


def scene(law: LawName = "linear") -> Scene:
    """A block whose base follows three points, a weak pull at its end, a probe there."""
    return Scene(
        box(SIZE, (3, 2, 2)),
        Material(1e4, 0.3, law),
        loads=(Load("pull", "x1", (0.0, 0.0, 1.0)),),
        probes=(Probe("tip", (0.03, 0.01, 0.01)),),
        tracked=(Prescribed("base", BASE, CORNERS[:3]),),
    )


def run(scheme: Scheme | SceneSolver, body: Scene, seen: Floats, pull: float = 0.0) -> Run:
    return run_scheme("r", scheme, body, np.zeros(1), np.append(seen, pull)[None], LAST)


def test_a_body_without_load_moves_with_its_base() -> None:
    """A small rigid motion of the base is one of the whole, without force, to rounding."""
    body = scene()
    assert body.inputs[:4] == ("base.a.x", "base.a.y", "base.a.z", "base.b.x")
    moved = run(QuasiStatic(), body, affine(at(CORNERS[:3]), TURN).ravel())
    assert moved.u[0] == pytest.approx(affine(body.mesh.nodes, TURN), abs=1e-12)
    assert abs(moved.traces["base.force.z"].y[0]) < 1e-10
    assert moved.traces["base.a.x.displacement"].y[0] == pytest.approx(SHIFT[0])


@pytest.mark.parametrize("law", ["linear", "neo_hooke"])
def test_the_base_bears_what_pulls(law: LawName) -> None:
    scheme = QuasiStatic() if law == "linear" else StaticNewton()
    pulled = run(scheme, scene(law), np.zeros(9), 0.01)
    assert pulled.traces["base.force.z"].y[0] == pytest.approx(-0.01, rel=1e-6)
    assert pulled.traces["base.force.z"].unit == "N"
    assert abs(pulled.traces["base.force.x"].y[0]) < 1e-8


def test_deviations_carry_the_noise_of_points_into_the_field() -> None:
    """Sum of (J d)^2 over the six deviations d is the diagonal of sd^2 J J^T."""
    body, sd = scene(), 3e-5
    stepper = QuasiStatic().prepare(build(body))
    J = stepper.columns[:, :9]  # type: ignore[attr-defined]
    off = body.tracked[0].deviations(sd)
    assert off.shape == (6, 9)
    assert ((J @ off.T) ** 2).sum(axis=1) == pytest.approx(sd**2 * (J**2).sum(axis=1), rel=1e-9)


def test_forces_have_it_too() -> None:
    """Held at its other end, a rod's force has the scatter of its length: E A/L on both."""
    end = InBox((0.03, 0.0, 0.0), SIZE).points
    far = tuple(
        (label, (0.03, *place[1:])) for label, place in (*CORNERS[:3], ("d", (0, 0.02, 0.02)))
    )
    body = replace(
        scene(),
        material=Material(1e4, 0.0),
        tracked=(
            Prescribed("base", BASE, CORNERS[:3]),
            Prescribed("end", end, far),
        ),
    )
    off = body.tracked[1].deviations(1e-5)
    inputs = np.zeros((len(off), len(body.inputs)))
    inputs[:, 9:21] = off  # of the far end's points
    runs = [run_scheme("r", QuasiStatic(), body, np.zeros(1), row[None], LAST) for row in inputs]
    stiffness = 1e4 * 4e-4 / 0.03
    # The mean of four corners' x: turns of the end pull on one side and push on the other.
    for name in ("end.force.x", "base.force.x"):
        sd = np.sqrt(sum(one.traces[name].y[0] ** 2 for one in runs))
        assert sd == pytest.approx(stiffness * 1e-5 / 2, rel=1e-6)


def test_points_that_say_too_little_are_refused() -> None:
    line = tuple((str(i), (0.0, 0.01 * i, 0.0)) for i in range(4))
    with pytest.raises(SceneError, match=r"determine 5.*6 numbers"):
        Prescribed("base", BASE, line)
    with pytest.raises(SceneError, match="expected one label for each"):
        Prescribed("base", BASE, (*CORNERS, CORNERS[0]))
    with pytest.raises(SceneError, match=r"tracked points of \[2, 3\] coordinates"):
        Prescribed("base", BASE, (CORNERS[0], ("x", (0.0, 1.0))))
    flat = Prescribed("base", "x0", (("a", (0.0, 0.0)), ("b", (0.0, 0.02))))
    with pytest.raises(SceneError, match="points of 2 coordinates in 3 dimensions"):
        build(replace(scene(), tracked=(flat,)))


def test_replacing_a_scene_keeps_one_drive_a_component() -> None:
    body = scene()
    again = replace(body, material=Material(2e4, 0.3))
    assert again.inputs == body.inputs
    assert len(again.drives) == 9
    assert replace(again, tracked=()).drives == ()
