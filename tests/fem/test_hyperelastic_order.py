"""A manufactured solution at large strain: the L2 error falls with the order of the element."""

from functools import cache

import numpy as np
import pytest
from law_samples import NAMES, sample
from phantoms import grid_mesh

from validate.arrays import Floats
from validate.fem.large_strain.hyperelastic import Body
from validate.fem.laws.law import Law, law_of
from validate.fem.linear_solvers.factor import elimination_order, factorise_indefinite
from validate.scene.mesh import Mesh
from validate.scene.scene import Dilatation, Scene
from validate.scene.shape_functions import EDGES

# Gauss-Legendre points on [0, 1] folded onto the tetrahedron (Duffy): exact to degree 5.
_X, _W = np.polynomial.legendre.leggauss(4)
_T, _V = (_X + 1) / 2, _W / 2
A, B, C = np.meshgrid(_T, _T, _T, indexing="ij")
WEIGHTS = (np.einsum("i,j,k->ijk", _V, _V, _V) * (1 - A) ** 2 * (1 - B) * 6).ravel()
PLACES = np.stack([A, (1 - A) * B, (1 - A) * (1 - B) * C], axis=-1).reshape(-1, 3)
BARYCENTRIC = np.hstack([1 - PLACES.sum(axis=1, keepdims=True), PLACES])

WAVE = np.array([[1.1, 0.4, -0.3], [-0.5, 0.9, 0.6], [0.3, -0.7, 1.2]])
SHIFT = np.array([0.3, 1.1, 2.0])
SIZE = 0.12


def exact(x: Floats) -> Floats:
    """u_i = s sin(k_i . x + c_i): gradients to 0.2, with shear and volume change."""
    return SIZE * np.sin(x @ WAVE.T + SHIFT)


def body_force(law: Law, x: Floats) -> Floats:
    """b = -Div P(u), through the law's tangent and the exact second derivatives."""
    phase = x @ WAVE.T + SHIFT
    H = SIZE * np.cos(phase)[..., None] * WAVE
    second = -SIZE * np.sin(phase)[..., None, None] * WAVE[:, :, None] * WAVE[:, None, :]
    return -np.asarray(np.einsum("...JijK,...jJK->...i", law.tangent(H), second))


def shapes(order: int) -> Floats:
    L = BARYCENTRIC
    if order == 1:
        return L
    i, j = np.array(EDGES[3]).T
    return np.hstack([L * (2 * L - 1), 4 * L[:, i] * L[:, j]])


def points(mesh: Mesh) -> tuple[Floats, Floats]:
    """Places (e, q, 3) and weights (e, q) of the fine quadrature."""
    x = np.einsum("qa,ead->eqd", BARYCENTRIC, mesh.nodes[mesh.corners])
    return x, mesh.cell_volumes()[:, None] * WEIGHTS


def load(mesh: Mesh, law: Law) -> Floats:
    x, w = points(mesh)
    nodal = np.einsum("eq,qa,eqi->eai", w, shapes(mesh.order), body_force(law, x))
    out = np.zeros_like(mesh.nodes)
    np.add.at(out, mesh.cells, nodal)
    return out.ravel()


@cache
def error(name: str, order: int, dilatation: Dilatation, n: int) -> float:
    """L2 norm of u_h - u on the unit cube with its surface held at the exact u."""
    mesh = grid_mesh((n + 1, n + 1, n + 1), kind="tet10" if order == 2 else "tet4")
    scene = Scene(mesh, sample(name, 1e3, 0.3), dilatation=dilatation)
    body, f = Body(scene), load(mesh, law_of(scene.material))
    inner = np.repeat(((mesh.nodes > 1e-9) & (mesh.nodes < 1 - 1e-9)).all(axis=1), 3)
    free = np.flatnonzero(inner)
    u = exact(mesh.nodes).ravel()
    sequence = None
    for _ in range(8):
        residual = (body.force(u) - f)[free]
        if np.linalg.norm(residual) < 1e-9 * np.linalg.norm(f):
            break
        K = body.tangent(u)[free][:, free]
        sequence = elimination_order(K, free // 3, mesh.nodes) if sequence is None else sequence
        u[free] -= factorise_indefinite(K, sequence).solve(residual)
    else:
        raise AssertionError(f"Newton has not converged on {n} cells a side")
    x, w = points(mesh)
    found = np.einsum("qa,eai->eqi", shapes(order), u.reshape(-1, 3)[mesh.cells])
    return float(np.sqrt(np.einsum("eq,eqi->", w, (found - exact(x)) ** 2)))


CASES = [
    pytest.param("svk", 1, "pointwise", (3, 4, 6, 8), marks=pytest.mark.slow),
    pytest.param("neo_hooke", 1, "pointwise", (3, 4, 6, 8), marks=pytest.mark.slow),
    pytest.param("neo_hooke", 1, "nodal_mean", (3, 4, 6, 8), marks=pytest.mark.slow),
    pytest.param("svk", 2, "pointwise", (2, 3, 4, 6), marks=pytest.mark.slow),
    ("neo_hooke", 2, "pointwise", (2, 3, 4, 6)),
    *(
        pytest.param(name, order, "pointwise", sides, marks=pytest.mark.slow)
        for name in NAMES
        if name not in ("svk", "neo_hooke")
        for order, sides in ((1, (3, 4, 6, 8)), (2, (2, 3, 4, 6)))
    ),
]


@pytest.mark.parametrize(("name", "order", "dilatation", "sides"), CASES)
def test_observed_order(
    name: str, order: int, dilatation: Dilatation, sides: tuple[int, ...]
) -> None:
    errors = [error(name, order, dilatation, n) for n in sides]
    slope = -np.polyfit(np.log(sides), np.log(errors), 1)[0]
    last = np.log(errors[-2] / errors[-1]) / np.log(sides[-1] / sides[-2])
    assert slope == pytest.approx(order + 1, abs=0.1)
    assert last == pytest.approx(order + 1, abs=0.1)
