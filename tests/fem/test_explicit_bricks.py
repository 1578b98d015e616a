"""Compiled mixed hexahedra against their numpy reference, and a swing against implicit steps."""

from dataclasses import replace

import numpy as np
import pytest
from law_samples import sample
from test_mixed_cells import bent, skewed

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.large_strain.explicit import ExplicitBody
from validate.fem.large_strain.hyperelastic import Body
from validate.fem.system import System, build
from validate.scene.geometries.box import grid
from validate.scene.material import Material, Region
from validate.scene.scene import Load, Scene, Support
from validate.solve.dynamic.implicit import NewtonDynamics
from validate.solve.explicit.central import CentralDifference
from validate.solve.march import march
from validate.solve.types import Scheme

LAWS = ("neo_hooke", "mooney_rivlin", "yeoh")
laws = pytest.mark.parametrize("name", LAWS)


def body(name: str = "neo_hooke") -> Scene:
    """A skewed block with a stiffer core of another law: 12 cells, not a whole block of lanes."""
    core = Region("core", np.array([0, 5, 7]), sample("yeoh", 90e3, 0.4))
    return Scene(skewed("hex8"), sample(name, 30e3, 0.499), regions=(core,), dilatation="mixed")


def apart(a: Floats, b: Floats) -> float:
    return float(np.abs(a - b).max() / np.abs(b).max())


@laws
def test_forces_are_those_of_the_reference(name: str) -> None:
    scene = body(name)
    u = bent(scene.mesh)
    assert apart(ExplicitBody(scene).force(u), Body(scene).force(u)) < 1e-13
    tiny = 1e-9 * np.random.default_rng(0).normal(size=u.size)
    assert apart(ExplicitBody(scene).force(tiny), Body(scene).force(tiny)) < 1e-7


@laws
def test_energy_volume_and_tangent_are_those_of_the_reference(name: str) -> None:
    scene = body(name)
    fast, slow, u = ExplicitBody(scene), Body(scene), bent(scene.mesh)
    look = fast.look(u)
    assert look.energy == pytest.approx(slow.energy(u), rel=1e-12)
    assert look.det_F == pytest.approx(slow.jacobians(u).min(), rel=1e-12)
    assert (look.inverted, look.cells) == (0, len(scene.mesh.cells))
    v = np.random.default_rng(2).normal(size=u.size)
    assert apart(fast.tangent_product(u, v), slow.tangent(u) @ v) < 1e-7
    assert not fast.tangent_product(u, 0 * v).any()


@pytest.mark.slow
def test_threads_share_the_cells_and_inverted_ones_are_counted() -> None:
    scene = Scene(grid((1.0, 1.0, 1.0), (4, 4, 3)), sample("neo_hooke"), dilatation="mixed")
    u = bent(scene.mesh)
    assert apart(ExplicitBody(scene, 2).force(u), ExplicitBody(scene).force(u)) < 1e-14
    u[3 * scene.mesh.cells[7, 0]] += 0.6
    bad = (Body(scene).jacobians(u) <= 0).any(axis=1)
    assert ExplicitBody(scene).look(u).inverted == bad.sum() > 0
    assert np.isnan(ExplicitBody(scene).force(u)).any()


def swinging(**more: object) -> System:
    """A short beam of 2 x 1 x 1 thick cells, pulled down at its end."""
    scene = Scene(
        grid((0.06, 0.02, 0.02), (4, 2, 2)),
        Material(60e3, 0.49, "neo_hooke", 1000.0),
        (Support("x0", (0, 1, 2)),),
        loads=(Load("down", "x1", (0.0, 0.0, -1.0)),),
        dilatation="mixed",
    )
    return build(replace(scene, **more))  # type: ignore[arg-type]


def end(scheme: Scheme, system: System, steps: int, dt: float) -> Floats:
    """Under a force that rises smoothly: inputs are linear within explicit steps."""
    t = dt * np.arange(1, steps + 1)
    inputs = 0.05 * np.sin(np.pi / 2 * t[:, None] / 0.04) ** 2
    run = march("swing", scheme.prepare(system), t, inputs, np.array([steps - 1]), 0.0)
    assert run.finished, run.outcome.why
    return np.asarray(run.u[0])


@pytest.mark.slow
def test_explicit_steps_converge_to_implicit_ones() -> None:
    """Both are of order two, so half the step leaves a quarter of what is between them."""
    system = swinging()
    fine, coarse = (end(NewtonDynamics(0.04 / n), system, n, 0.04 / n) for n in (40, 20))
    limit = fine + (fine - coarse) / 3
    ours = end(CentralDifference(1e-3, substeps=12), system, 40, 1e-3)
    assert np.abs(limit).max() > 1e-3
    assert apart(ours, limit) < 2e-3


@pytest.mark.slow
def test_a_step_beyond_the_limit_is_refused_with_the_limit() -> None:
    run = march(
        "fast", CentralDifference(1e-3).prepare(swinging()), np.array([1e-3]), np.ones((1, 1)),
        np.array([0]), 0.0,
    )  # fmt: skip
    assert run.outcome.state == "refused"
    assert "critical step" in run.outcome.why


def test_what_has_no_explicit_form_is_refused() -> None:
    scene = body()
    with pytest.raises(SceneError, match="explicit hexahedra must be mixed"):
        ExplicitBody(replace(scene, dilatation="pointwise", regions=()))
    with pytest.raises(SceneError, match=r"laws neo_hooke.*'svk' \(split\)"):
        ExplicitBody(replace(scene, material=sample("svk"), regions=()))
    with pytest.raises(SceneError, match="hex27 have no explicit form"):
        ExplicitBody(replace(scene, body=grid((1.0,) * 3, (3, 2, 2)).quadratic(), regions=()))
    with pytest.raises(SceneError, match="node filters support tetrahedra"):
        ExplicitBody(scene).force_and_blocks(np.zeros(scene.mesh.nodes.size))
