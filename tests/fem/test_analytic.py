"""Bodies with an exact solution: a plate with a circular hole, a hollow sphere.

Hole and inner sphere are free, all other faces follow the exact field (on planes of symmetry only
across them), so what the elements find at the hole is theirs. The error falls with order two.
"""

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from validate.arrays import Floats, Ints
from validate.fem.system import build
from validate.scene.geometries.box import grid
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.scene import Scene

INNER, OUTER = 1.0, 3.0
STEEL = Material(200.0, 0.3)


def solved(mesh: Mesh, exact: Floats, held: Ints) -> Floats:
    """Displacements (n, d) with the exact ones at the `held` unknowns and no other load."""
    K = build(Scene(mesh, STEEL)).K.tocsc()
    free = np.setdiff1d(np.arange(exact.size), held)
    u = np.zeros(exact.size)
    u[held] = exact.ravel()[held]
    u[free] = spsolve(K[free][:, free], -(K[free][:, held] @ u[held]))
    return u.reshape(exact.shape)


def of_sets(mesh: Mesh, components: dict[str, tuple[int, ...]]) -> Ints:
    found = [
        mesh.facet_nodes(name) * mesh.dimension + c for name, cs in components.items() for c in cs
    ]
    return np.unique(np.concatenate(found))


def moved(mesh: Mesh, nodes: Floats) -> Mesh:
    return Mesh(nodes, mesh.cells, mesh.kind, mesh.facets)


def quarter_plate(n: int) -> Mesh:
    square = grid((1.0, 1.0), (n, n))
    r = INNER * (OUTER / INNER) ** square.nodes[:, 0]
    angle = np.pi / 2 * square.nodes[:, 1]
    return moved(square, np.stack([r * np.cos(angle), r * np.sin(angle)], axis=1))


def kirsch(nodes: Floats, tension: float = 1.0) -> Floats:
    """Displacements of an infinite plate with a free hole under tension along x (Kirsch 1898)."""
    r, t = np.hypot(*nodes.T) / INNER, np.arctan2(nodes[:, 1], nodes[:, 0])
    kappa = 3 - 4 * STEEL.nu  # plane strain
    x = r * (kappa + 1) * np.cos(t) + 2 / r * ((1 + kappa) * np.cos(t) + np.cos(3 * t))
    y = r * (kappa - 3) * np.sin(t) + 2 / r * ((1 - kappa) * np.sin(t) + np.sin(3 * t))
    far = 2 / r**3
    field = np.stack([x - far * np.cos(3 * t), y - far * np.sin(3 * t)], axis=1)
    return np.asarray(INNER * tension / (8 * STEEL.shear_modulus) * field)


def sphere_patch(n: int) -> Mesh:
    """Directions within a square about x, from the inner to the outer radius."""
    cube = grid((1.0, 1.0, 1.0), (n, n, n))
    towards = np.stack([np.ones(len(cube.nodes)), *(cube.nodes[:, 1:].T - 0.5)], axis=1)
    towards /= np.linalg.norm(towards, axis=1)[:, None]
    r = INNER * (OUTER / INNER) ** cube.nodes[:, :1]
    return moved(cube, r * towards)


def lame(nodes: Floats) -> Floats:
    """u = A r + B / r^2 with no radial stress at the inner sphere (Lame 1852)."""
    r = np.linalg.norm(nodes, axis=1)[:, None]
    B = 3 * STEEL.bulk_modulus * INNER**3 / (4 * STEEL.shear_modulus)
    return np.asarray(1e-3 * (nodes + B * nodes / r**3))


def plate_error(n: int) -> float:
    mesh = quarter_plate(n)
    exact = kirsch(mesh.nodes)
    found = solved(mesh, exact, of_sets(mesh, {"x1": (0, 1), "y0": (1,), "y1": (0,)}))
    hole = mesh.facet_nodes("x0")
    return float(np.abs(found - exact)[hole].max() / np.abs(exact[hole]).max())


def sphere_error(n: int) -> float:
    mesh, every = sphere_patch(n), (0, 1, 2)
    exact = lame(mesh.nodes)
    held = of_sets(mesh, dict.fromkeys(("x1", "y0", "y1", "z0", "z1"), every))
    found = solved(mesh, exact, held)
    inner = mesh.facet_nodes("x0")
    return float(np.abs(found - exact)[inner].max() / np.abs(exact[inner]).max())


def test_a_circular_hole_is_kirschs() -> None:
    coarse, fine = plate_error(12), plate_error(24)
    assert fine < 5e-3
    assert np.log2(coarse / fine) == pytest.approx(2.0, abs=0.2)


def test_a_hollow_sphere_is_lames() -> None:
    coarse, fine = sphere_error(5), sphere_error(10)
    assert fine < 5e-3
    assert np.log2(coarse / fine) == pytest.approx(2.0, abs=0.3)


def test_the_hole_triples_the_stress() -> None:
    """Hoop strain at the hole across the tension: (1 - nu^2)/E of three times the tension."""
    mesh = quarter_plate(24)
    exact = kirsch(mesh.nodes)
    found = solved(mesh, exact, of_sets(mesh, {"x1": (0, 1), "y0": (1,), "y1": (0,)}))
    top = mesh.nearest_node(np.array([0.0, INNER]))
    hole = mesh.facet_nodes("x0")
    beside = hole[np.argsort(np.abs(mesh.nodes[hole] - mesh.nodes[top]).sum(axis=1))[1]]
    length = np.linalg.norm(mesh.nodes[beside] - mesh.nodes[top])
    along = (mesh.nodes[beside] - mesh.nodes[top]) / length
    strain = float((found[beside] - found[top]) @ along / length)
    assert strain * STEEL.E / (1 - STEEL.nu**2) == pytest.approx(3.0, rel=0.02)
