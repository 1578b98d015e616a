"""Norms of a difference of fields and the interior error: by hand, and against the mesh."""

import numpy as np
import pytest
from field_oracles import weighted_nodal_sum

from validate.arrays import Floats
from validate.compare.shapes.pair import Field, FieldPair, pair
from validate.compare.shapes.two_fields import (
    FieldScores,
    mean_distance,
    relative_energy_norm,
    relative_l2_norm,
    relative_nodal_norm,
)
from validate.fem.assembly.assemble import mass
from validate.scene.geometries.box import box, grid
from validate.scene.material import Material, Region
from validate.scene.mesh import Mesh
from validate.scene.scene import Scene

SOFT = Material(1e4, 0.3, rho=1000.0)


def test_one_triangle_by_hand() -> None:
    """Reference: all moved by (1, 0) m. Run: node 1 moved by (1, 0) more.

    e = N_1, so integral e = A/3, integral e^2 = A/6, strain e_xx = 1; A = 1/2.
    """
    mesh = Mesh(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), np.array([[0, 1, 2]]), "tri3")
    u = np.tile([1.0, 0.0], (3, 1))
    run = Field(mesh, u + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 0.0]]), "run")
    found = {s.name: s.value for s in FieldScores.of(run, Field(mesh, u, "ref")).whole()}
    lam, mu = 1e4 * 0.3 / (1.3 * 0.4), 1e4 / 2.6
    exact = {
        "E_n": 1 / np.sqrt(3),
        "L2.relative": np.sqrt(1 / 6),
        "L2.rms": np.sqrt(1 / 6),
        "E_i": (1 / 6) / np.sqrt(1 / 2),
        "E_i.mean": 1 / 3,
        "E_s": 1.0,
        "E_s.shell": 1.0,
        "surface.hausdorff": 1.0,
    }
    assert {name: found[name] for name in exact} == pytest.approx(exact, rel=1e-13)
    between = pair(run, Field(mesh, 2 * u, "ref"), Scene(mesh, SOFT))
    bent = {
        s.name: s.value
        for s in FieldScores.of(run, Field(mesh, run.u / 2, "r"), between.common).whole()
    }
    assert bent["energy"] == pytest.approx(np.sqrt((lam + 2 * mu) / 2) / 2, rel=1e-12)
    assert bent["energy.relative"] == pytest.approx(1.0, rel=1e-12)


def test_the_mass_weighs_the_l2_norm() -> None:
    """A heavy half: against u^T M u of the assembled mass with two densities."""
    mesh = box((1.0, 1.0), (4, 4))
    heavy = np.flatnonzero(mesh.nodes[mesh.cells].mean(axis=1)[:, 0] > 0.5)
    dense = Material(1e4, 0.3, rho=9000.0)
    scene = Scene(mesh, SOFT, regions=(Region("heavy", heavy, dense),))
    rng = np.random.default_rng(5)
    u, e = rng.normal(size=(2, *mesh.nodes.shape))
    found = relative_l2_norm(pair(Field(mesh, u + e, "run"), Field(mesh, u, "ref"), scene))
    M = mass(scene)
    exact = np.sqrt(e.ravel() @ (M @ e.ravel()) / (u.ravel() @ (M @ u.ravel())))
    assert found == pytest.approx(float(exact), rel=1e-12)


def bump(x: Floats) -> Floats:
    return np.stack([x[:, 0], 0 * x[:, 0]], axis=1)


def error(x: Floats) -> Floats:
    """Largest near x = 0, where the graded mesh has its nodes."""
    return 0.1 * np.stack([(1 - x[:, 0]) ** 3, 0 * x[:, 0]], axis=1)


def graded(n: int, power: float) -> FieldPair:
    mesh = grid((1.0, 1.0), (n, n))
    nodes = mesh.nodes * [1.0, 1.0]
    nodes[:, 0] **= power
    mesh = Mesh(nodes, mesh.cells, "quad4")
    u = bump(mesh.nodes)
    run = Field(mesh, u + error(mesh.nodes), "run")
    return pair(run, Field(mesh, u, "ref"), Scene(mesh, SOFT))


def test_the_energy_norm_does_not_drift_with_the_mesh_and_the_printed_norm_does() -> None:
    """The same two fields on uniform and graded meshes; exact energy ratio by quadrature in x.

    e_xx of the error is -0.3 (1 - x)^2, of the reference 1: ratio 0.3/sqrt(5).
    """
    energy = [relative_energy_norm(graded(n, p)) for n in (16, 32) for p in (1.0, 2.0)]
    assert energy == pytest.approx(4 * [0.3 / np.sqrt(5)], rel=0.01)
    printed = [relative_nodal_norm(graded(n, p)) for n in (16, 32) for p in (1.0, 2.0)]
    assert printed[1] > 1.5 * printed[0]
    assert printed[3] > 1.5 * printed[2]


@pytest.mark.parametrize("kind", ["tri3", "quad4", "tet4", "hex8"])
def test_the_weighted_nodal_sum_bounds_the_mean_distance(kind: str) -> None:
    """|interpolated| is at most interpolated |.|; here by 0.1 to 10 %, as found before."""
    make = grid if kind in ("quad4", "hex8") else box
    mesh = make((1.0, 1.0), (10, 10)) if kind in ("tri3", "quad4") else make((1.0,) * 3, (5,) * 3)
    x = mesh.nodes
    e = np.stack([np.sin(np.pi * x[:, 0]), np.cos(3 * x[:, 1])], axis=1)
    u = np.zeros(x.shape)
    moved = u.copy()
    moved[:, :2] = e
    between = pair(Field(mesh, moved, "run"), Field(mesh, u, "ref"))
    assert 1.001 < weighted_nodal_sum(between) / mean_distance(between) < 1.1


def test_the_nodal_sum_weighs_uneven_cells() -> None:
    """A difference of one sign and direction, linear: the sum is the integral, 0.5 m of x."""
    uniform = grid((1.0, 1.0), (6, 4))
    mesh = Mesh(uniform.nodes**2, uniform.cells, "quad4")
    u = np.zeros(mesh.nodes.shape)
    moved = np.stack([mesh.nodes[:, 0], u[:, 1]], axis=1)
    between = pair(Field(mesh, moved, "run"), Field(mesh, u, "ref"))
    assert weighted_nodal_sum(between) == pytest.approx(0.5, rel=1e-13)
    assert mean_distance(between) == pytest.approx(0.5, rel=1e-13)


@pytest.mark.parametrize("kind", ["tri3", "quad4"])
def test_the_interior_error_with_a_kink_converges(kind: str) -> None:
    """|x - c| over the unit square about its middle: (sqrt(2) + asinh(1))/6 m."""
    mesh = (grid if kind == "quad4" else box)((1.0, 1.0), (8, 8))
    run = Field(mesh, mesh.nodes - 0.5, "run")
    still = Field(mesh, np.zeros(mesh.nodes.shape), "ref")
    exact = (np.sqrt(2) + np.arcsinh(1)) / 6
    assert mean_distance(pair(run, still)) == pytest.approx(exact, rel=2e-5)
