"""The same bodies by another finite-element code (NGSolve): an oracle with no line of ours.

pip install -e ".[oracle]"; without it the tests are skipped, which `.ci/run` does not allow.
"""

import os
from typing import Any

import numpy as np
import pytest

from validate.arrays import Floats
from validate.fem.system import build
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.scene import Load, Scene, Support

SIZE, CELLS = (0.004, 0.004, 0.007), (4, 4, 7)  # the block of paper 001
E, NU, TRACTION = 1e4, 0.47, 3000.0
SIDES = ("z0", "z1", "x0", "x1", "y0", "y1")


@pytest.fixture(scope="module")
def ng() -> Any:
    if os.environ.get("VALIDATE_REQUIRE_ORACLE"):
        import ngsolve
    else:
        ngsolve = pytest.importorskip("ngsolve", reason="oracle absent: pip install ngsolve")
    return ngsolve


def their_mesh(ng: Any, mesh: Mesh) -> Any:
    """Our nodes and cells, in their orientation; boundaries by side."""
    from netgen.meshing import Element2D, Element3D, FaceDescriptor, MeshPoint, Pnt
    from netgen.meshing import Mesh as Netgen

    made = Netgen(dim=3)
    points = [made.Add(MeshPoint(Pnt(*(float(c) for c in node)))) for node in mesh.nodes]
    faces = [made.Add(FaceDescriptor(surfnr=i + 1, domin=1, bc=i + 1)) for i in range(len(SIDES))]
    for a, b, c, d in mesh.cells.tolist():
        made.Add(Element3D(1, [points[i] for i in (a, b, d, c)]))
    for i, side in enumerate(SIDES):
        for facet in mesh.facets[side].tolist():
            made.Add(Element2D(faces[i], [points[j] for j in facet]))
        made.SetBCName(i, side)
    return ng.Mesh(made)


def theirs(ng: Any, mesh: Mesh, order: int) -> Floats:
    """Displacements (n, 3) m of our nodes under the traction, held at z0."""
    space = ng.VectorH1(their_mesh(ng, mesh), order=order, dirichlet="z0")
    u, v = space.TnT()
    lam, mu = E * NU / (1 + NU) / (1 - 2 * NU), E / 2 / (1 + NU)

    def strain(w: Any) -> Any:
        return 0.5 * (ng.Grad(w) + ng.Grad(w).trans)

    work = 2 * mu * ng.InnerProduct(strain(u), strain(v)) + lam * ng.div(u) * ng.div(v)
    K = ng.BilinearForm(work * ng.dx).Assemble()
    pull = ng.CoefficientFunction((0, 0, TRACTION))
    f = ng.LinearForm(pull * v * ng.ds("z1")).Assemble()
    found = ng.GridFunction(space)
    found.vec.data = K.mat.Inverse(space.FreeDofs(), inverse="sparsecholesky") * f.vec
    return np.array(found.vec).reshape(3, -1).T[: len(mesh.nodes)]


def ours(mesh: Mesh) -> Floats:
    load = Load("pull", "z1", (0.0, 0.0, 1.0))
    scene = Scene(mesh, Material(E, NU), (Support("z0", (0, 1, 2)),), loads=(load,))
    system = build(scene)
    u = np.zeros(mesh.nodes.size)
    force = TRACTION * SIZE[0] * SIZE[1] * system.loads[system.free, 0]
    u[system.free] = system.factor().solve(force)
    return u.reshape(mesh.nodes.shape)


@pytest.mark.slow
def test_the_block_of_paper_001_is_the_same_by_another_code(ng: Any) -> None:
    mesh = box(SIZE, CELLS)
    other = theirs(ng, mesh, 1)
    assert np.abs(other).max() == pytest.approx(2.3e-3, rel=0.1)  # it did move
    assert ours(mesh) == pytest.approx(other, rel=0, abs=1e-11 * np.abs(other).max())


@pytest.mark.slow
def test_quadratic_elements_agree_at_the_corners(ng: Any) -> None:
    """Their quadratic space is hierarchical: its vertex values are displacements, as ours are."""
    pass

    mesh = box(SIZE, CELLS)
    other = theirs(ng, mesh, 2)
    mine = ours(mesh.quadratic())[: len(mesh.nodes)]
    assert mine == pytest.approx(other, rel=0, abs=1e-10 * np.abs(other).max())
