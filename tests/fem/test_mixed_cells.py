"""Mixed cells (constant or linear pressure in each) against exact truths, and regions in a body."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve
from test_hyperelastic import turn

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.assembly.assemble import (
    projections,
    rule,
    stiffness,
    stiffness_points,
    values_at,
    volumes_at,
)
from validate.fem.large_strain.hyperelastic import Body
from validate.fem.laws.law import law_of
from validate.fem.system import build
from validate.scene.geometries.box import box, grid
from validate.scene.material import LawName, Material, Region
from validate.scene.mesh import Mesh
from validate.scene.scene import Dilatation, Load, Scene, Support

SOFT = Material(15_200.0, 0.49)
KINDS = ("hex8", "hex27", "tet10")
LAWS: tuple[LawName, ...] = ("svk", "neo_hooke")
every = pytest.mark.parametrize("kind", KINDS)
laws = pytest.mark.parametrize("law", LAWS)


def made(kind: str, size: tuple[float, ...], cells: tuple[int, ...]) -> Mesh:
    mesh = box(size, cells) if kind == "tet10" else grid(size, cells)
    return mesh if kind in ("hex8", "tet4") else mesh.quadratic()


@cache
def skewed(kind: str) -> Mesh:
    """A block of 3 x 2 x 2 cells whose inner nodes are moved."""
    mesh = box((1.0, 1.0, 1.0), (3, 2, 2)) if kind == "tet10" else grid((1.0,) * 3, (3, 2, 2))
    inner = ((mesh.nodes > 0) & (mesh.nodes < 1)).all(axis=1)
    nodes = mesh.nodes + 0.08 * np.sin(7 * mesh.nodes[:, ::-1]) * inner[:, None]
    moved = Mesh(nodes, mesh.cells, mesh.kind, mesh.facets)
    return moved if kind == "hex8" else moved.quadratic()


def mixed(kind: str, law: LawName, nu: float = 0.49) -> Scene:
    return Scene(skewed(kind), Material(15_200.0, nu, law), dilatation="mixed")


def bent(mesh: Mesh) -> Floats:
    """A large deformation with volume changes of its own at every point."""
    rng, x = np.random.default_rng(1), mesh.nodes
    H = np.array([[-0.25, 0.2, 0.1], [0.05, 0.2, -0.1], [0.1, 0.0, 0.1]])
    return np.asarray(x @ H.T + 0.08 * x**2 + 1e-3 * rng.normal(size=x.shape)).ravel()


# Derivatives


@every
@laws
def test_force_and_tangent_are_derivatives(kind: str, law: LawName) -> None:
    b = Body(mixed(kind, law))
    u, v = bent(b.mesh), np.random.default_rng(2).normal(size=b.mesh.nodes.size)
    assert b.inverted(u) is None
    h = 1e-7
    work = (b.energy(u + h * v) - b.energy(u - h * v)) / (2 * h)
    assert work == pytest.approx(b.force(u) @ v, rel=1e-6)
    T = b.tangent(u)
    slope = (b.force(u + h * v) - b.force(u - h * v)) / (2 * h)
    assert slope == pytest.approx(T @ v, abs=1e-6 * np.abs(T @ v).max())
    assert abs(T - T.T).max() <= 1e-12 * abs(T).max()


@every
@laws
def test_at_rest_the_tangent_is_the_linear_stiffness(kind: str, law: LawName) -> None:
    scene = mixed(kind, law)
    K, T = stiffness(scene), Body(scene).tangent(np.zeros(scene.mesh.nodes.size))
    assert abs(T - K).max() <= 1e-10 * abs(K).max()
    pointwise = stiffness(replace(scene, dilatation="pointwise"))
    assert abs(T - pointwise).max() > 1e-2 * abs(K).max()


@pytest.mark.parametrize(
    ("kind", "dilatation"),
    [*((k, "mixed") for k in KINDS), ("tet10", "pointwise"), ("tet4", "nodal_mean")],
)
def test_extrapolated_pressures_are_right_to_first_order(kind: str, dilatation: Dilatation) -> None:
    """At u + h v they differ from u's own there by h^2, and at h = 0 not at all."""
    mesh = box((1.0,) * 3, (2, 2, 2)) if kind == "tet4" else skewed(kind)
    b = Body(Scene(mesh, replace(SOFT, law="neo_hooke"), dilatation=dilatation))
    u, v = bent(mesh), np.random.default_rng(2).normal(size=mesh.nodes.size)
    own = [b.extrapolated(u + h * v, 0 * v) for h in (0.0, 1e-4, 2e-4)]
    apart = [np.abs(b.extrapolated(u, h * v) - p).max() for h, p in zip((0, 1e-4, 2e-4), own)]  # noqa: B905
    assert apart[0] == 0
    assert apart[2] / apart[1] == pytest.approx(4, rel=0.1)
    T = b.tangent(u)
    assert abs(b.tangent(u, own[0]) - T).max() <= 1e-13 * abs(T).max()
    assert abs(b.tangent(u, own[0] + 1e4) - T).max() > 1e-6 * abs(T).max()


# Exact truths


@every
@laws
def test_a_turn_costs_nothing_and_a_homogeneous_deformation_is_exact(
    kind: str, law: LawName
) -> None:
    b, x = Body(mixed(kind, law)), skewed(kind).nodes
    turned = (x @ turn(1, np.pi / 2).T - x + [0.1, -0.2, 0.3]).ravel()
    assert np.abs(b.force(turned)).max() <= 1e-13 * b.unit_force
    H = np.array([[-0.3, 0.2, 0.1], [0.05, 0.25, -0.1], [0.1, 0.0, 0.15]])
    force = b.force((x @ H.T).ravel()).reshape(-1, 3)
    whole = law_of(replace(SOFT, law=law))
    inner = ((x > 1e-9) & (x < 1 - 1e-9)).all(axis=1)
    assert np.abs(force[inner]).max() <= 1e-12 * np.abs(force).max()
    assert force.T @ x == pytest.approx(whole.stress(H), abs=1e-9 * np.abs(force).max())
    assert b.energy((x @ H.T).ravel()) == pytest.approx(float(whole.energy(H)), rel=1e-12)


@every
def test_without_volume_stiffness_mixed_is_pointwise(kind: str) -> None:
    """At kappa = 2 mu/3 + lambda with lambda = -2 mu/3, nu = -1: nothing is projected. At nu = 0
    the two differ by what a coarse mesh leaves open, at .49 by locking."""
    apart = []
    for nu in (-0.999, 0.0, 0.49):
        scene = mixed(kind, "neo_hooke", nu)
        u = bent(scene.mesh)
        ours, theirs = (Body(s).force(u) for s in (scene, replace(scene, dilatation="pointwise")))
        apart.append(np.linalg.norm(ours - theirs) / np.linalg.norm(theirs))
    assert apart[0] < 1e-4
    assert apart[0] < apart[1] < apart[2]


@pytest.mark.parametrize(("kind", "fields"), [("hex8", 1), ("tet10", 1), ("hex27", 4)])
def test_the_projection_keeps_what_it_projects_on(kind: str, fields: int) -> None:
    points = stiffness_points(skewed(kind))
    Pi = projections(skewed(kind), points.places, points.weights)
    assert np.linalg.matrix_rank(Pi[0], tol=1e-9) == fields
    assert Pi @ Pi == pytest.approx(Pi, abs=1e-12)
    weighted = points.weights[..., None] * Pi
    assert weighted == pytest.approx(np.swapaxes(weighted, 1, 2), abs=1e-16)
    linear = (points.places @ [1.0, 2.0, -3.0] + 4.0)[..., None]
    kept = np.abs(Pi @ linear - linear).max() < 1e-12
    assert kept == (kind == "hex27")
    means = (points.weights[..., None] * (Pi @ linear - linear)).sum(axis=1)
    assert np.abs(means).max() < 1e-14


# No locking


def cantilever(kind: str, cells: tuple[int, ...], nu: float, dilatation: Dilatation) -> float:
    """Tip of a clamped 5 x 1 x 1 beam under a small end load, by beam theory's with shear."""
    mesh = made(kind, (5.0, 1.0, 1.0), cells)
    scene = Scene(
        mesh, Material(1e4, nu), (Support("x0", (0, 1, 2)),), dilatation=dilatation,
        loads=(Load("down", "x1", (0.0, 0.0, -1.0)),),
    )  # fmt: skip
    system = build(scene)
    u = np.zeros(mesh.nodes.size)
    u[system.free] = system.factor().solve(system.loads[system.free, 0])
    shear = 5.0 / (5 / 6 * 1e4 / (2 * (1 + nu)))
    return float(-u.reshape(-1, 3)[mesh.facet_nodes("x1"), 2].mean() / (5**3 * 4e-4 + shear))


@pytest.mark.parametrize(
    ("kind", "cells", "within"),
    [("hex8", (10, 4, 4), 0.08), ("hex27", (5, 2, 2), 0.01), ("tet10", (5, 2, 2), 0.04)],
)
def test_nothing_locks_at_nu_4999(kind: str, cells: tuple[int, ...], within: float) -> None:
    """0.954 (3) is Taylor-Hood's on 8 x 3 x 3 and 5 x 2 x 2 quadratic hexahedra: the clamp."""
    mixed = cantilever(kind, cells, 0.4999, "mixed")
    assert mixed == pytest.approx(0.954, rel=within)
    assert cantilever(kind, cells, 0.4999, "pointwise") < 0.87 * mixed


@pytest.mark.parametrize("mesh", [grid((1.0, 1.0), (3, 3)), box((1.0, 1.0), (2, 2)).quadratic()])
def test_in_plane_strain_a_linear_field_is_exact_and_others_are_softer(mesh: Mesh) -> None:
    pointwise = Scene(mesh, SOFT, thickness=0.3)
    K, T = stiffness(pointwise), stiffness(replace(pointwise, dilatation="mixed"))
    linear = (mesh.nodes @ [[0.1, 0.3], [-0.2, 0.05]]).ravel()
    assert T @ linear == pytest.approx(K @ linear, abs=1e-12 * np.abs(K @ linear).max())
    u = np.random.default_rng(3).normal(size=mesh.nodes.size)
    assert u @ (T @ u) < 0.9 * (u @ (K @ u))


WAVE = np.array([[0.0, 1.4, -1.3], [-1.5, 0.0, 1.6], [1.3, -1.7, 0.0]])  # no divergence
SIZE = {0.3: 0.12, 0.4999: 1e-7}


def exact(x: Floats, nu: float) -> Floats:
    return SIZE[nu] * np.sin(x @ WAVE.T + [0.3, 1.1, 2.0])


def body_force(scene: Scene, x: Floats, nu: float) -> Floats:
    """-Div P(u), through the law's tangent and the exact second derivatives."""
    phase = x @ WAVE.T + [0.3, 1.1, 2.0]
    H = SIZE[nu] * np.cos(phase)[..., None] * WAVE
    second = -SIZE[nu] * np.sin(phase)[..., None, None] * WAVE[:, :, None] * WAVE[:, None, :]
    return -np.asarray(np.einsum("...JijK,...jJK->...i", law_of(scene.material).tangent(H), second))


def error(kind: str, nu: float, n: int) -> float:
    """L2 norm of u_h - u on the unit cube with its surface held at the exact u."""
    mesh = made(kind, (1.0, 1.0, 1.0), (n, n, n))
    scene = Scene(mesh, Material(1e3, nu, "neo_hooke"), dilatation="mixed")
    body, at = Body(scene), rule(mesh, 4)
    w, x = volumes_at(mesh, at), values_at(mesh, at, mesh.nodes)
    f = np.zeros_like(mesh.nodes)
    np.add.at(f, mesh.cells, np.einsum("eq,qa,eqi->eai", w, at.N, body_force(scene, x, nu)))
    inner = np.repeat(((mesh.nodes > 1e-9) & (mesh.nodes < 1 - 1e-9)).all(axis=1), 3)
    free, u = np.flatnonzero(inner), exact(mesh.nodes, nu).ravel()
    for _ in range(8):
        residual = (body.force(u) - f.ravel())[free]
        if np.linalg.norm(residual) < 1e-8 * np.linalg.norm(f):
            break
        u[free] -= spsolve(body.tangent(u)[free][:, free].tocsc(), residual)
    else:
        raise AssertionError(f"Newton has not converged on {n} cells a side")
    found = values_at(mesh, at, u.reshape(-1, 3))
    return float(np.sqrt((w[..., None] * (found - exact(x, nu)) ** 2).sum()))


@pytest.mark.parametrize("nu", [0.3, 0.4999])
@pytest.mark.parametrize(
    ("kind", "order", "sides"), [("hex8", 2, (3, 6)), ("hex27", 3, (2, 4)), ("tet10", 2, (2, 4))]
)
def test_observed_order(kind: str, order: int, sides: tuple[int, int], nu: float) -> None:
    """Constant pressures leave tetrahedra order 2, or 3 where the exact pressure is none."""
    coarse, fine = (error(kind, nu, n) for n in sides)
    observed = np.log2(coarse / fine)
    assert observed > order - 0.15
    assert observed < (3 if kind == "tet10" else order) + 0.35


# Regions


def test_two_regions_are_two_bodies_side_by_side() -> None:
    mesh = skewed("hex8")
    stiff, cells = Material(60e3, 0.3, "svk"), np.arange(0, len(mesh.cells), 3)
    soft = replace(SOFT, law="neo_hooke")
    scene = Scene(mesh, soft, regions=(Region("core", cells, stiff),), dilatation="mixed")
    rest = np.setdiff1d(np.arange(len(mesh.cells)), cells)
    alone = [
        Body(Scene(Mesh(mesh.nodes, mesh.cells[of], "hex8"), material, dilatation="mixed"))
        for of, material in ((cells, stiff), (rest, soft))
    ]
    u, body = bent(mesh), Body(scene)
    assert body.energy(u) == pytest.approx(sum(b.energy(u) for b in alone), rel=1e-13)
    force = alone[0].force(u) + alone[1].force(u)
    assert body.force(u) == pytest.approx(force, abs=1e-12 * np.abs(force).max())
    T = alone[0].tangent(u) + alone[1].tangent(u)
    assert abs(body.tangent(u) - T).max() <= 1e-12 * abs(T).max()
    crushed = mesh.nodes.copy()
    crushed[:, 0] *= -0.45
    crushed[:, 1:] = 0.0
    assert f"element {cells[0]} is below 0.577" in body.beyond_the_law(crushed.ravel())
    assert Body(replace(scene, regions=())).beyond_the_law(crushed.ravel()) == ""
    K = stiffness(scene)
    assert abs(body.tangent(0 * u) - K).max() <= 1e-10 * abs(K).max()


def test_what_cannot_be_mixed_is_refused() -> None:
    with pytest.raises(SceneError, match=r"tet4.*'nodal_mean'"):
        Scene(box((1.0,) * 3, (1, 1, 1)), SOFT, dilatation="mixed")
    with pytest.raises(SceneError, match="not quad4 in plane stress"):
        Scene(grid((1.0, 1.0), (1, 1)), SOFT, plane="stress", dilatation="mixed")
    region = Region("a", np.arange(2), replace(SOFT, law="svk"))
    with pytest.raises(SceneError, match="use linear laws only, or no linear law"):
        Scene(skewed("hex8"), SOFT, regions=(region,))
