"""Stiffness: patch tests, zero modes, an oracle from elsewhere, orders of convergence."""

from itertools import product

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss
from phantoms import grid_mesh
from scipy import sparse
from scipy.sparse.linalg import spsolve
from skfem import (
    Basis,
    ElementTetP1,
    ElementTetP2,
    ElementTriP1,
    ElementTriP2,
    ElementVector,
    asm,
)
from skfem.models.elasticity import lame_parameters, linear_elasticity

from validate.errors import SceneError
from validate.fem.assembly.assemble import (
    _renumbered,
    _require_node_major,
    divergence,
    library_mesh,
    shape_gradients,
    stiffness,
)
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.mesh import Mesh, kuhn_cells
from validate.scene.scene import Dilatation, Scene
from validate.scene.shape_functions import EDGES

# private: _renumbered, _require_node_major: scikit-fem does not bring the error about.

KINDS = [("linear", 1, "pointwise"), ("nodal_mean", 1, "nodal_mean"), ("quadratic", 2, "pointwise")]
each_kind = pytest.mark.parametrize(
    ("order", "dilatation"), [k[1:] for k in KINDS], ids=[k[0] for k in KINDS]
)


def distorted(cells: int, order: int, seed: int = 3) -> Mesh:
    """A unit cube whose inner nodes are moved at random: no two tetrahedra alike."""
    mesh = grid_mesh((cells + 1,) * 3)
    inner = ((mesh.nodes > 0) & (mesh.nodes < 1)).all(axis=1)
    shift = np.random.default_rng(seed).uniform(-0.15, 0.15, mesh.nodes.shape) / cells
    moved = Mesh(mesh.nodes + shift * inner[:, None], mesh.cells, "tet4")
    return moved.quadratic() if order == 2 else moved


def inner_unknowns(mesh: Mesh) -> np.ndarray:
    return np.repeat(((mesh.nodes > 1e-9) & (mesh.nodes < 1 - 1e-9)).all(axis=1), 3)


def solve_with_edge_values(K: sparse.csr_array, mesh: Mesh, exact: np.ndarray) -> np.ndarray:
    inner = inner_unknowns(mesh)
    u = np.where(inner, 0.0, exact.ravel())
    u[inner] = spsolve(K[inner][:, inner].tocsc(), -(K @ u)[inner])
    return u.reshape(-1, 3)


@pytest.mark.parametrize(
    ("size", "element"),
    [
        ((0.1, 0.2), ElementTriP1),
        ((0.1, 0.2), ElementTriP2),
        ((0.1, 0.2, 0.3), ElementTetP1),
        ((0.1, 0.2, 0.3), ElementTetP2),
    ],
)
def test_the_stiffness_of_simplices_is_scikit_fems(size: tuple[float, ...], element: type) -> None:
    mesh = box(size, (2, 3, 2)[: len(size)])
    mesh = mesh.quadratic() if element.__name__.endswith("P2") else mesh
    basis = Basis(library_mesh(mesh), ElementVector(element()), intorder=2)
    theirs = asm(linear_elasticity(*lame_parameters(2.0, 0.3)), basis)
    ours = stiffness(Scene(mesh, Material(2.0, 0.3)))
    assert np.abs((ours - theirs).toarray()).max() < 1e-14 * np.abs(theirs).max()


@each_kind
def test_patch_test_on_a_distorted_mesh(order: int, dilatation: Dilatation) -> None:
    mesh = distorted(3, order)
    K = stiffness(Scene(mesh, Material(2.0, 0.3), dilatation=dilatation))
    G = np.random.default_rng(1).normal(size=(3, 3))
    exact = mesh.nodes @ G.T + [0.1, 0.2, 0.3]
    assert np.abs((K @ exact.ravel())[inner_unknowns(mesh)]).max() < 1e-13
    assert solve_with_edge_values(K, mesh, exact) == pytest.approx(exact, abs=1e-13)


@each_kind
def test_stress_of_a_linear_field_is_constant_and_hookes(
    order: int, dilatation: Dilatation
) -> None:
    """Work of the nodal forces on any second linear field: V sigma : grad v."""
    mesh, material = distorted(2, order), Material(2.0, 0.3)
    K = stiffness(Scene(mesh, material, dilatation=dilatation))
    G, H = np.random.default_rng(2).normal(size=(2, 3, 3))
    eps = (G + G.T) / 2
    lame = material.bulk_modulus - 2 / 3 * material.shear_modulus
    sigma = lame * np.trace(eps) * np.eye(3) + 2 * material.shear_modulus * eps
    work = (mesh.nodes @ H.T).ravel() @ (K @ (mesh.nodes @ G.T).ravel())
    assert work == pytest.approx((sigma * H).sum(), rel=1e-12)


@each_kind
def test_symmetric_with_six_rigid_modes_and_no_more(order: int, dilatation: Dilatation) -> None:
    mesh = distorted(2, order)
    K = stiffness(Scene(mesh, Material(1.0, 0.3), dilatation=dilatation)).toarray()
    x, zero, one = mesh.nodes, np.zeros(len(mesh.nodes)), np.ones(len(mesh.nodes))
    rigid = [np.stack(m, axis=1) for m in ((one, zero, zero), (zero, one, zero), (zero, zero, one))]
    rigid += [np.cross(axis, x) for axis in np.eye(3)]
    values = np.linalg.eigvalsh(K)
    assert np.abs(K - K.T).max() < 1e-15
    assert max(np.abs(K @ m.ravel()).max() for m in rigid) < 1e-13
    assert np.abs(values[:6]).max() < 1e-13
    assert values[6] > 1e-3


@each_kind
def test_unknowns_are_node_major(order: int, dilatation: Dilatation) -> None:
    """A translation along x costs nothing in x0 y0 z0 x1 ... order; in x0 x1 ... y0 ... it does."""
    mesh = distorted(2, order)
    K = stiffness(Scene(mesh, Material(1.0, 0.3), dilatation=dilatation))
    n = len(mesh.nodes)
    ours, theirs = np.tile([1.0, 0.0, 0.0], n), np.repeat([1.0, 0.0, 0.0], n)
    assert np.abs(K @ ours).max() < 1e-13
    assert np.abs(K @ theirs).max() > 0.1


def test_cube_oracle() -> None:
    """An earlier study: 5 x 5 x 8 nodes at 1 mm, z = 0 fixed, 3000 Pa on top, E 1e4, nu .47."""
    mesh = grid_mesh((5, 5, 8), (4e-3, 4e-3, 7e-3))
    K = stiffness(Scene(mesh, Material(1e4, 0.47)))
    load = np.zeros_like(mesh.nodes)
    np.add.at(load[:, 2], mesh.facets["z1"], 3000 * 0.5e-6 / 3)
    free = np.repeat(mesh.nodes[:, 2] > 0, 3)
    u = np.zeros(load.size)
    u[free] = spsolve(K[free][:, free].tocsc(), load.ravel()[free])
    for place, expected in [
        ((0, 0, 7e-3), (6.7129710205e-4, 6.7129710205e-4, 2.1343991963e-3)),  # its node 175
        ((2e-3, 2e-3, 7e-3), (3.8851967165e-4, 3.8851967165e-4, 1.8707896467e-3)),  # node 187
    ]:
        at = mesh.nearest_node(np.array(place))
        assert u.reshape(-1, 3)[at] == pytest.approx(expected, abs=1e-12)


def exact_field(x: np.ndarray, nu: float) -> np.ndarray:
    """A displacement in equilibrium without body force, neither polynomial nor divergence-free.

    Papkovich-Neuber with the harmonic b = exp(sqrt(2) x) cos y cos z along x:
    2 mu u = grad(x b) - 4 (1 - nu) b e_x, with 2 mu = 1.
    """
    X, Y, Z = x.T
    e = np.exp(np.sqrt(2) * X)
    b = e * np.cos(Y) * np.cos(Z)
    u_x = b + X * np.sqrt(2) * b - 4 * (1 - nu) * b
    return np.stack([u_x, -X * e * np.sin(Y) * np.cos(Z), -X * e * np.cos(Y) * np.sin(Z)], axis=1)


def l2_error(mesh: Mesh, u: np.ndarray, nu: float) -> float:
    """Over every cell by 64 Gauss points in collapsed coordinates."""
    g, w = leggauss(4)
    g, w = (g + 1) / 2, w / 2
    total = 0.0
    for (a, wa), (b, wb), (c, wc) in product(zip(g, w, strict=True), repeat=3):
        L = np.array([0.0, a, b * (1 - a), c * (1 - a) * (1 - b)])
        L[0] = 1 - L.sum()
        i, j = np.array(EDGES[3]).T
        N = L if mesh.order == 1 else np.concatenate([L * (2 * L - 1), 4 * L[i] * L[j]])
        place = np.einsum("a,ead->ed", L, mesh.nodes[mesh.corners])
        off = np.einsum("a,ead->ed", N, u[mesh.cells]) - exact_field(place, nu)
        total += wa * wb * wc * (1 - a) ** 2 * (1 - b) * (6 * mesh.cell_volumes() @ (off**2).sum(1))
    return float(np.sqrt(total))


@pytest.mark.parametrize(
    ("order", "dilatation", "cells", "expected", "within"),
    [
        (1, "pointwise", (5, 10), 2.0, 0.15),
        (1, "nodal_mean", (5, 10), 2.0, 0.25),
        (2, "pointwise", (3, 6), 3.0, 0.2),
    ],
    ids=[k[0] for k in KINDS],
)
def test_order_of_convergence(
    order: int, dilatation: Dilatation, cells: tuple[int, int], expected: float, within: float
) -> None:
    errors = []
    for n in cells:
        mesh = grid_mesh((n + 1,) * 3, kind="tet10" if order == 2 else "tet4")
        K = stiffness(Scene(mesh, Material(1.0, 0.3), dilatation=dilatation))
        u = solve_with_edge_values(K, mesh, exact_field(mesh.nodes, 0.3))
        errors.append(l2_error(mesh, u, 0.3))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(expected, abs=within)


def test_divergence_and_gradients_of_a_linear_field_are_exact() -> None:
    mesh = distorted(2, 1)
    G = np.random.default_rng(4).normal(size=(3, 3))
    u = mesh.nodes @ G.T
    B, volumes = divergence(mesh)
    assert B @ u.ravel() == pytest.approx(np.full(len(mesh.cells), np.trace(G)), abs=1e-13)
    assert volumes.sum() == pytest.approx(1.0, rel=1e-13)
    gradients = np.einsum("ead,eac->ecd", shape_gradients(mesh), u[mesh.cells])
    assert np.abs(gradients - G).max() < 1e-13


def test_what_cannot_be_assembled_is_refused() -> None:
    cells = kuhn_cells((3, 3, 3))
    cells[5, [0, 1]] = cells[5, [1, 0]]
    inverted = Mesh(grid_mesh((3, 3, 3)).nodes, cells, "tet4")
    with pytest.raises(SceneError, match=r"1 of 48 elements.*element 5"):
        stiffness(Scene(inverted, Material(1.0, 0.3)))


def test_a_library_that_numbers_otherwise_is_an_error_of_ours() -> None:
    """What it assembles would be permuted: places are compared, node by node."""
    nodes = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 2.0]])
    places = np.repeat(nodes, 2, axis=0).T
    _require_node_major(places, nodes, 2)
    with pytest.raises(AssertionError, match="numbers its unknowns differently from"):
        _require_node_major(places[:, ::-1], nodes, 2)
    assert _renumbered(nodes[[2, 0, 1]], nodes).tolist() == [1, 2, 0]
    with pytest.raises(AssertionError, match="has unknowns at other places than"):
        _renumbered(nodes + 1e-6, nodes)
