"""Penalties against a change of volume: which is an energy, and what the other one invents."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from experiments.needle_block.volume_penalty import Normals, volume_penalty
from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.assembly.assemble import divergence, stiffness
from validate.fem.system import build
from validate.scene.geometries.box import box, grid
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.scene import Scene, Support

SOFT = Material(10e3, 0.3)
READINGS: tuple[Normals, ...] = ("area", "unit")


def uneven(dimension: int) -> Scene:
    """A box whose inner nodes are moved: no two cells are alike."""
    size, cells = (1.0, 0.8, 1.2)[:dimension], (3, 2, 3)[:dimension]
    mesh = box(size, cells)
    inner = (mesh.nodes > 1e-9).all(axis=1) & (mesh.nodes < np.array(size) - 1e-9).all(axis=1)
    moved = mesh.nodes + 0.1 * inner[:, None] * np.random.default_rng(3).uniform(-1, 1, 3)[
        :dimension
    ] * np.arange(1, len(mesh.nodes) + 1)[:, None] / len(mesh.nodes)  # fmt: skip
    mesh = Mesh(moved, mesh.cells, mesh.kind, mesh.facets)
    return Scene(mesh, SOFT, (Support("x0", tuple(range(dimension))),), thickness=0.5
                 if dimension == 2 else 1.0)  # fmt: skip


def one_cell(*corners: tuple[float, ...]) -> Scene:
    nodes = np.array(corners)
    d = nodes.shape[1]
    mesh = Mesh(nodes, np.arange(d + 1)[None], "tri3" if d == 2 else "tet4", {})
    return Scene(mesh, SOFT, ())


def field(scene: Scene, seed: int = 0) -> Floats:
    return np.random.default_rng(seed).standard_normal(scene.mesh.nodes.size)


def with_lame(lam: float, mu: float) -> Material:
    nu = lam / (2 * (lam + mu))
    return Material(2 * mu * (1 + nu), nu)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("weight", [0.0, 3e3, 1e7])
def test_area_weighted_normals_are_a_raised_lambda(dimension: int, weight: float) -> None:
    scene = uneven(dimension)
    mu = SOFT.shear_modulus
    lam = SOFT.bulk_modulus - 2 * mu / 3
    raised = stiffness(replace(scene, material=with_lame(lam + weight, mu)))
    off = abs(stiffness(scene) + volume_penalty(scene, weight) - raised).max()
    assert off <= 1e-12 * abs(raised).max()


@pytest.mark.parametrize("normals", READINGS)
@pytest.mark.parametrize("dimension", [2, 3])
def test_no_force_resists_a_rigid_motion_or_a_shear(dimension: int, normals: Normals) -> None:
    scene = uneven(dimension)
    P, x = volume_penalty(scene, 1e4, normals), scene.mesh.nodes
    turn = np.zeros((dimension, dimension))
    turn[0, 1], turn[1, 0] = 1, -1
    shear = np.abs(turn)
    fields = [x @ turn.T, x @ shear.T, np.ones_like(x)]
    assert max(np.abs(P @ u.ravel()).max() for u in fields) < 1e-11 * abs(P).max()
    assert np.abs(P @ x.ravel()).max() > 1e-3 * abs(P).max()


@pytest.mark.parametrize(
    "corners",
    [
        ((0, 0), (1, 0), (0.5, 0.75**0.5)),
        ((1, 1, 1), (1, -1, -1), (-1, -1, 1), (-1, 1, -1)),
    ],
    ids=["triangle", "tetrahedron"],
)  # fmt: skip
def test_on_a_regular_cell_both_readings_are_one(corners: tuple[tuple[float, ...], ...]) -> None:
    scene = one_cell(*corners)
    area, unit = (volume_penalty(scene, 1e4, n) for n in READINGS)
    assert abs(area - unit).max() < 1e-12 * abs(area).max()


def test_forces_push_away_from_the_opposite_face_when_a_cell_is_squeezed() -> None:
    scene = one_cell((0, 0), (1, 0), (0, 1))
    squeezed = -0.1 * scene.mesh.nodes  # theta = -0.2
    slopes = np.array([[-1, -1], [1, 0], [0, 1]])
    k, V = 1e4, 0.5
    lengths = np.linalg.norm(slopes, axis=1)
    area, unit = (-(volume_penalty(scene, k, n) @ squeezed.ravel()).reshape(3, 2) for n in READINGS)
    assert area == pytest.approx(k * V * 0.2 * slopes, rel=1e-12)
    unit_slopes = slopes / lengths[:, None] * lengths.mean()
    assert unit == pytest.approx(k * V * 0.2 * unit_slopes, rel=1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
def test_unit_normals_create_momentum(dimension: int) -> None:
    """The sum of all inner forces over the sum of their sizes: of a cell, and of a free body."""
    corner = one_cell(*np.vstack([np.zeros(dimension), np.eye(dimension)]).tolist())
    normal = 1 - dimension**-0.5  # of the slanted face, less the others', per axis
    for scene, least in (
        (corner, normal * dimension**0.5 / (dimension + 1)),
        (uneven(dimension), 1e-3),
    ):
        shares = []
        for normals in READINGS:
            f = (volume_penalty(scene, 1e4, normals) @ field(scene)).reshape(scene.mesh.nodes.shape)
            shares.append(np.linalg.norm(f.sum(axis=0)) / np.linalg.norm(f, axis=1).sum())
        assert shares[0] < 1e-14
        assert shares[1] >= least * (1 - 1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
def test_unit_normals_create_energy_on_a_closed_path(dimension: int) -> None:
    """Work around the square of two fields a, b: a (P - P^T) b; none of a symmetric matrix."""
    scene = uneven(dimension)
    a, b = field(scene, 1), field(scene, 2)
    corners = np.stack([0 * a, a, a + b, b, 0 * a])
    gains = []
    for normals in READINGS:
        P = volume_penalty(scene, 1e4, normals)
        work = sum(float((P @ (p + q) / 2) @ (q - p)) for p, q in pairwise(corners))
        gains.append(abs(work) / float(a @ (P @ a)))
    assert gains[0] < 1e-13
    assert gains[1] > 1e-3


def test_a_weight_scales_and_a_heavy_one_keeps_the_volume() -> None:
    """Volume strains fall as the inverse weight where the cells leave a motion without any."""
    scene = uneven(2)
    off = volume_penalty(scene, 2e4) - 2 * volume_penalty(scene, 1e4)
    assert abs(off).max() < 1e-14 * abs(volume_penalty(scene, 2e4)).max()
    B, _ = divergence(scene.mesh)
    free, f, K = build(scene).free, field(scene), stiffness(scene)
    left = []
    for weight in (1e8, 1e9):
        A = (K + volume_penalty(scene, weight))[free][:, free].toarray()
        left.append(np.abs(B[:, free] @ np.linalg.solve(A, f[free])).max())
    assert left[0] / left[1] == pytest.approx(10, rel=1e-2)


def test_what_has_no_such_penalty_is_refused() -> None:
    scene = uneven(2)
    with pytest.raises(SceneError, match="penalty of -1 Pa"):
        volume_penalty(scene, -1.0)
    with pytest.raises(SceneError, match="thickness is free"):
        volume_penalty(replace(scene, plane="stress"), 1.0)
    with pytest.raises(SceneError, match="linear simplices, not tri6"):
        volume_penalty(replace(scene, body=scene.mesh.quadratic()), 1.0)
    with pytest.raises(SceneError, match="linear simplices, not quad4"):
        volume_penalty(replace(scene, body=grid((1.0, 1.0), (2, 2))), 1.0)
