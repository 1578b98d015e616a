"""Condensation against the whole system, and displacements imposed and taken back on it."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from phantoms import COARSE_GRID, phantom_mesh, phantom_scene
from scipy.sparse.linalg import spsolve

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.fem.linear_solvers.condense import Condensed, WorkingSet, along, between, displaced
from validate.fem.system import System, build


def system(nu: float = 0.485) -> System:
    return build(phantom_scene(phantom_mesh(COARSE_GRID), nu=nu))


@pytest.fixture(scope="module")
def body() -> System:
    return system()


@pytest.fixture(scope="module")
def small(body: System) -> Condensed:
    """On the cavity, the plate and 12 nodes of the upper side."""
    return Condensed.of(body, _top(body)[::5])


def _top(body: System) -> Ints:
    x = body.scene.mesh.nodes
    inside = (x[:, 0] > 1e-9) & (x[:, 0] < 0.06 - 1e-9)
    return np.flatnonzero((np.abs(x[:, 1] - 0.045) < 1e-9) & inside)


def _whole(body: System, forces: Floats, held: dict[int, float]) -> Floats:
    """u (N,) of the mesh's unknowns under nodal forces, some displacements given: sparse, apart."""
    K = body.K
    free = np.setdiff1d(body.free, list(held))
    u = np.zeros(K.shape[0])
    for i, value in held.items():
        u[i] = value
    u[free] = spsolve(K[free][:, free].tocsc(), (forces - K @ u)[free])
    return u


def _unknown(body: System, small: Condensed, i: int) -> int:
    """The mesh's unknown of a kept one."""
    d = body.scene.mesh.dimension
    return int(small.nodes[i // d] * d + i % d)


def test_forces_on_kept_nodes_move_them_as_in_the_whole_body(
    body: System, small: Condensed
) -> None:
    f = np.zeros(small.size)
    f[small.free] = np.random.default_rng(1).normal(size=len(small.free))
    loads = np.zeros(body.K.shape[0])
    for i in small.free:
        loads[_unknown(body, small, i)] = f[i]
    u = _whole(body, loads, {})
    kept = [_unknown(body, small, i) for i in range(small.size)]
    assert small.compliance @ f == pytest.approx(u[kept], abs=1e-12 * np.abs(u).max())
    assert small.whole(f).ravel() == pytest.approx(u, abs=1e-12 * np.abs(u).max())


def test_kept_fields_are_those_of_the_body(small: Condensed) -> None:
    whole = small.responses.fields[:, small.nodes].reshape(len(small.fields), -1)
    assert np.array_equal(small.fields, whole)


@pytest.mark.parametrize("keep", ["none", "cavity", "all"])
def test_what_is_kept_changes_nothing(body: System, small: Condensed, keep: str) -> None:
    """No tool node, one on the cavity, every node: the same numbers where both have them."""
    mesh = body.scene.mesh
    nodes = {
        "none": np.zeros(0, dtype=np.int64),
        "cavity": mesh.facet_nodes("cavity")[:1],
        "all": np.arange(len(mesh.nodes)),
    }[keep]
    other = Condensed.of(body, nodes)
    node = int(mesh.facet_nodes("cavity")[3])
    unknowns = [3 * int(np.searchsorted(c.nodes, node)) + 1 for c in (small, other)]
    common = np.intersect1d(small.nodes, other.nodes)
    columns = [
        c.column(u).reshape(-1, 3)[np.searchsorted(c.nodes, common)]
        for c, u in zip((small, other), unknowns, strict=True)
    ]
    assert columns[0] == pytest.approx(columns[1], abs=1e-13 * np.abs(columns[0]).max())


def test_order_of_the_nodes_changes_nothing(body: System, small: Condensed) -> None:
    shuffled = np.random.default_rng(0).permutation(_top(body)[::5])
    again = Condensed.of(body, shuffled)
    assert np.array_equal(again.nodes, small.nodes)
    assert again.compliance == pytest.approx(small.compliance, abs=0)


def test_a_column_is_that_of_the_dense_form(small: Condensed) -> None:
    i = int(small.free[17])
    scale = np.abs(small.compliance[:, i]).max()
    assert small.column(i) == pytest.approx(small.compliance[:, i], abs=1e-13 * scale)
    assert small.column(i) is small.column(i)
    assert small.column_bytes % (8 * small.size) == 0
    assert small.dense_bytes == 8 * small.size**2


def test_a_tool_cannot_move_what_is_held(body: System, small: Condensed) -> None:
    held = next(i for i in range(small.size) if i not in set(small.free.tolist()))
    with pytest.raises(SceneError, match="is held or driven"):
        small.column(held)
    with pytest.raises(SceneError, match="to keep of a mesh of"):
        Condensed.of(body, np.array([10**6]))


@pytest.mark.parametrize("short", [1e-2, 1e-4, 1e-6, 1e-8, 2e-10])
def test_near_incompressibility_costs_the_digits_it_has_to(short: float) -> None:
    """nu = (1 - short)/2 to .4999999999: the condition grows as 1/short, the error no faster."""
    body = system(nu=(1 - short) / 2)
    small = Condensed.of(body, np.zeros(0, dtype=np.int64))
    i = int(small.free[5])
    error = small.relative_error(i)
    assert 0 < error < 1e-13 / short
    exact = small.whole(np.eye(small.size)[i]).ravel()
    K, loads = body.K[body.free][:, body.free], np.zeros(body.K.shape[0])
    loads[_unknown(body, small, i)] = 1.0
    sparse_one = np.zeros_like(exact)
    sparse_one[body.free] = spsolve(K.tocsc(), loads[body.free])
    assert exact == pytest.approx(sparse_one, abs=1e-13 / short * np.abs(exact).max())


# --- working set ----------------------------------------------------------------------------------


def test_imposed_displacements_are_those_of_the_whole_system(
    body: System, small: Condensed
) -> None:
    """A node along an oblique axis and one fully, with the plate driven and pressure on."""
    mesh = body.scene.mesh
    top = [int(np.searchsorted(small.nodes, n)) for n in _top(body)[::5][:2]]
    axis = np.array([0.6, -0.8, 0.0])
    tool = WorkingSet(small).with_row(along(top[0], axis))
    for a in np.eye(3):
        tool = tool.with_row(along(top[1], a))
    z, targets = np.array([0.004, 900.0]), [0.002, 0.001, -0.003, 0.0005]
    u, forces = displaced(tool, z, targets)
    moved = u.reshape(-1, 3)
    assert moved[top[0]] @ axis == pytest.approx(0.002, rel=1e-10)
    assert moved[top[1]] == pytest.approx(targets[1:], rel=1e-9)
    loads = np.zeros(mesh.nodes.size)
    loads[3 * small.nodes[top[0]] + np.arange(3)] += forces[0] * axis
    held = {int(3 * small.nodes[top[1]] + c): targets[1 + c] for c in range(3)}
    base = np.tensordot(z, small.responses.fields, 1).ravel()
    free = {i: v - base[i] for i, v in held.items()}
    whole = base + _whole(body, loads, free)
    kept = (small.nodes[:, None] * 3 + np.arange(3)).ravel()
    assert u == pytest.approx(whole[kept], abs=1e-10 * np.abs(whole).max())


def test_rows_added_and_removed_leave_no_trace(small: Condensed) -> None:
    """A thousand changes of contact: the last state is that of the rows that are left alone."""
    random = np.random.default_rng(2)
    cavity = np.searchsorted(small.nodes, small.responses.scene.mesh.facet_nodes("cavity"))
    tool, names = WorkingSet(small), []
    for _ in range(1000):
        if names and (len(names) > 4 or random.random() < 0.5):
            gone = int(random.integers(len(names)))
            tool = tool.without(gone)
            del names[gone]
        else:
            node = int(random.choice([n for n in cavity if n not in names]))
            tool = tool.with_row(along(node, np.array([0.0, 1.0, 0.0])))
            names.append(node)
    fresh = WorkingSet(small)
    for node in names:
        fresh = fresh.with_row(along(node, np.array([0.0, 1.0, 0.0])))
    targets = np.full(len(names), 1e-3)
    one, two = (displaced(s, np.array([0.003, 100.0]), targets) for s in (tool, fresh))
    assert len(names) > 0
    assert one[0] == pytest.approx(two[0], abs=1e-12 * np.abs(two[0]).max())
    assert one[1] == pytest.approx(two[1], rel=1e-9)


@settings(max_examples=25)
@given(st.floats(0.05, 0.9), st.floats(-0.003, 0.003))
def test_a_point_between_nodes_moves_as_asked(share: float, by: float) -> None:
    small = _phantom()
    nodes = np.searchsorted(small.nodes, small.responses.scene.mesh.facets["cavity"][0])
    shares = np.array([share, (1 - share) / 2, (1 - share) / 2])
    row = between(nodes, shares, np.array([0.0, 0.0, 1.0]))
    u, forces = displaced(WorkingSet(small).with_row(row), np.zeros(2), [by])
    assert shares @ u.reshape(-1, 3)[nodes, 2] == pytest.approx(by, abs=1e-14)
    assert forces[0] * by >= 0  # a body gives no work


@cache
def _phantom() -> Condensed:
    return Condensed.of(system(), np.zeros(0, dtype=np.int64))


def test_the_same_row_twice_is_refused(small: Condensed) -> None:
    node = int(np.searchsorted(small.nodes, small.responses.scene.mesh.facet_nodes("cavity")[0]))
    row = along(node, np.array([1.0, 0.0, 0.0]))
    with pytest.raises(SceneError, match="one of 2 axes follows from the others"):
        WorkingSet(small).with_row(row).with_row(row)
