"""Factorisation: right solutions, refused indefinite matrices, an order that saves fill."""

from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from phantoms import grid_mesh, phantom_mesh, phantom_scene
from scipy import sparse
from scipy.sparse.linalg import splu

from validate.errors import SceneError
from validate.fem.assembly.assemble import stiffness
from validate.fem.linear_solvers import factor
from validate.fem.linear_solvers.factor import Factor, Fronts, factorise, nested_dissection
from validate.fem.system import build
from validate.scene.material import Material
from validate.scene.scene import Scene, Support


def random_spd(seed: int, nodes: int, per_node: int) -> sparse.csr_array:
    rng = np.random.default_rng(seed)
    n = nodes * per_node
    B = sparse.random_array((n, n), density=min(1.0, 4 / n), rng=rng)
    return sparse.csr_array(B @ B.T + 0.1 * sparse.eye_array(n))


def grid_laplacian(n: int) -> tuple[sparse.csr_array, np.ndarray]:
    """7-point Laplacian with fixed outside on n^3 points, and their places."""
    line = sparse.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(n, n))
    I = sparse.eye_array(n)
    A = sum(
        sparse.kron(sparse.kron(a, b), c) for a, b, c in ((line, I, I), (I, line, I), (I, I, line))
    )
    places = np.stack(np.meshgrid(*3 * [np.arange(n)], indexing="ij"), axis=-1).reshape(-1, 3)
    return sparse.csr_array(A), places.astype(float)


@settings(max_examples=25)
@given(st.integers(0, 2**31), st.integers(1, 150), st.integers(1, 3))
def test_solves_random_definite_systems(seed: int, nodes: int, per_node: int) -> None:
    A = random_spd(seed, nodes, per_node)
    rng = np.random.default_rng(seed)
    node = np.repeat(np.arange(nodes), per_node)
    found = factorise(A, node, rng.normal(size=(nodes, 3)))
    x = rng.normal(size=(len(node), 2))
    assert found.solve(A @ x) == pytest.approx(x, abs=1e-9)
    assert found.solve(A @ x[:, 0]) == pytest.approx(x[:, 0], abs=1e-9)


def test_nodes_may_be_missing_and_out_of_order() -> None:
    A, places = grid_laplacian(5)
    node = np.random.default_rng(0).permutation(len(places)) + 7
    elsewhere = np.zeros((len(places) + 9, 3))
    elsewhere[node] = places
    x = np.arange(len(node), dtype=float)
    assert factorise(A, node, elsewhere).solve(A @ x) == pytest.approx(x, rel=1e-12)


@pytest.mark.parametrize("shift", [0.7, 2.0, 7.0])
def test_indefinite_matrix_is_refused(shift: float) -> None:
    """The plain library solves this without a word."""
    A, places = grid_laplacian(6)
    A = sparse.csr_array(A - shift * sparse.eye_array(len(places)))
    assert np.isfinite(splu(A.tocsc()).solve(np.ones(len(places)))).all()
    with pytest.raises(SceneError, match=r"not positive definite .* support or pin"):
        factorise(A, np.arange(len(places)), places)


def test_one_negative_pivot_is_enough() -> None:
    A = sparse.csr_array(np.diag([1.0, 2.0, -1e-3, 4.0]))
    with pytest.raises(SceneError, match=r"pivot -2.5e-04.*1"):
        factorise(A, np.arange(4), np.eye(4, 3))


def test_zero_pivots_are_refused() -> None:
    for matrix in ([[1.0, 1.0], [1.0, 1.0]], [[0.0, 0.0], [0.0, 0.0]], [[0.0, 1.0], [1.0, 0.0]]):
        with pytest.raises(SceneError, match="not positive definite"):
            factorise(sparse.csr_array(np.array(matrix)), np.arange(2), np.eye(2))


def test_an_empty_column_is_refused_before_blas_complains(
    capfd: pytest.CaptureFixture[str],
) -> None:
    """SuperLU calls DGEMV with an illegal size, which prints to standard output."""
    A, places = grid_laplacian(8)
    kept = np.ones(len(places))
    kept[len(places) // 2 :] = 0.0
    empty = sparse.csr_array(sparse.diags_array(kept) @ A @ sparse.diags_array(kept))
    with pytest.raises(SceneError, match=r"not positive definite .*, 256"):
        factorise(empty, np.arange(len(places)), places)
    assert capfd.readouterr() == ("", "")


def test_entries_that_are_not_finite_are_refused() -> None:
    A, places = grid_laplacian(4)
    A.data[3] = np.inf
    with pytest.raises(SceneError, match="1 entries of the stiffness matrix"):
        factorise(A, np.arange(len(places)), places)


@pytest.mark.parametrize("drop", ["pin", "y0", "x0"])
def test_body_that_can_move_rigidly_is_refused(drop: str) -> None:
    """The missing z pin of paper 000's set-up is silent in the library."""
    scene = phantom_scene(phantom_mesh((5, 5, 6)))
    if drop == "pin":
        loose = Scene(scene.mesh, scene.material, scene.supports, (), scene.drives)
    else:
        kept = tuple(s for s in scene.supports if s.facets != drop)
        drives = () if drop == "x0" else scene.drives
        loose = Scene(scene.mesh, scene.material, kept, scene.pins, drives)
    with pytest.raises(SceneError, match="the body can move rigidly"):
        build(loose).factor()


def test_stiffness_with_a_negative_element_is_refused() -> None:
    """An element counted with the wrong sign leaves finite solutions: the pivots tell."""
    mesh = grid_mesh((4, 4, 4))
    K = stiffness(Scene(mesh, Material(1.0, 0.3)))
    nodes = np.unique(mesh.cells[40])
    at = (3 * nodes[:, None] + np.arange(3)).ravel()
    D = sparse.lil_array(K.shape)
    D[np.ix_(at, at)] = -0.6 * K[at][:, at].toarray()
    free = np.repeat(mesh.nodes[:, 0] > 0, 3)
    wrong = sparse.csr_array(K + D)[free][:, free]
    with pytest.raises(SceneError, match="element is inverted"):
        factorise(wrong, np.flatnonzero(free) // 3, mesh.nodes)


def test_nearly_incompressible_material_still_factorises() -> None:
    mesh = grid_mesh((4, 4, 4))
    for nu in (0.49, 0.4999, 0.4999999999):
        scene = Scene(mesh, Material(1.0, nu), (Support("z0", (0, 1, 2)),))
        system = build(scene)
        free = system.K[system.free][:, system.free]
        x = np.random.default_rng(0).normal(size=len(system.free))
        found = system.factor().solve(free @ x)
        assert found == pytest.approx(x, abs=1e-14 / (1 - 2 * nu))


@settings(max_examples=25)
@given(st.integers(0, 2**31), st.integers(1, 400), st.integers(1, 3), st.booleans())
def test_nested_dissection_is_a_permutation(seed: int, n: int, d: int, level: bool) -> None:
    rng = np.random.default_rng(seed)
    graph = sparse.csr_array(sparse.random_array((n, n), density=min(1.0, 6 / n), rng=rng))
    places = np.zeros((n, d)) if level else rng.integers(0, 5, (n, d)).astype(float)
    found = nested_dissection(graph, places)
    assert np.array_equal(np.sort(found.order), np.arange(n))
    assert found.stops[-1] == n
    assert sum(found.children) == len(found.stops) - 1  # one tree: all parts but the last are taken


@settings(max_examples=25)
@given(st.integers(0, 2**31), st.integers(1, 300), st.integers(1, 3), st.booleans())
def test_fronts_solve_as_the_sparse_factor_does(
    seed: int, nodes: int, per_node: int, apart: bool
) -> None:
    """Bodies that hang together, or fall into parts: then separators are empty."""
    A = random_spd(seed, nodes, per_node)
    A = sparse.csr_array(sparse.diags_array(A.diagonal())) if apart else A
    rng = np.random.default_rng(seed)
    node = np.repeat(np.arange(nodes), per_node)
    places = rng.normal(size=(nodes, 3))
    x = rng.normal(size=(len(node), 2))
    with mock.patch.object(factor, "FRONTAL", 0):
        found = factorise(A, node, places)
    assert isinstance(found, Fronts)
    assert found.solve(A @ x) == pytest.approx(x, abs=1e-9)
    assert found.solve(A @ x[:, 0]) == pytest.approx(x[:, 0], abs=1e-9)
    assert found.solve(A @ x) == pytest.approx(factorise(A, node, places).solve(A @ x), abs=1e-9)


def test_large_grids_are_solved_by_fronts_and_indefinite_ones_refused() -> None:
    A, places = grid_laplacian(18)
    x = np.arange(len(places), dtype=float)
    found = factorise(A, np.arange(len(places)), places)
    assert isinstance(found, Fronts)
    assert found.solve(A @ x) == pytest.approx(x, rel=1e-12)
    with pytest.raises(SceneError, match="not positive definite"):
        factorise(A - 2.0 * sparse.eye_array(len(places)), np.arange(len(places)), places)


def test_nested_dissection_saves_fill_on_a_grid() -> None:
    A, places = grid_laplacian(14)
    natural = splu(A.tocsc(), permc_spec="NATURAL", diag_pivot_thresh=0.0).L.nnz
    ours = factorise(A, np.arange(len(places)), places)
    assert isinstance(ours, Factor)
    assert ours.lu.L.nnz < 0.5 * natural


@pytest.mark.parametrize("factorised", [factor.factorise_indefinite, factor.factorise_general])
def test_a_vanishing_pivot_is_refused_whatever_the_signs(factorised: object) -> None:
    order = np.arange(3)
    signs = sparse.csr_array(np.diag([2.0, -1.0, 4.0]))
    solved = factorised(signs, order).solve(np.ones(3))  # type: ignore[operator]
    assert solved.tolist() == [0.5, -1.0, 0.25]
    tiny = sparse.csr_array(np.diag([2.0, -1.0, 1e-15]))
    with pytest.raises(SceneError, match="positive definite"):
        factorised(tiny, order)  # type: ignore[operator]
    with pytest.raises(SceneError, match="positive definite"):
        factorised(sparse.csr_array(np.zeros((3, 3)) + np.diag([1.0, 0, 1])), order)  # type: ignore[operator]
