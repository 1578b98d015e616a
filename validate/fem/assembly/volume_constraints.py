"""Volume constraints: Taylor-Hood elements, and exact volume at nu = 0.5.

Taylor-Hood elements (displacements quadratic, pressure linear) are a locking-free reference.
Find u, p: 2 mu (e(u), e(v)) - (p, div v) = f(v), (div u, q) + (p/lambda, q) = 0; stable and of
second order in p up to nu -> 1/2 (Taylor & Hood 1973; Boffi, Brezzi & Fortin 2013, ch. 8). P2-P1 on
simplices, Q2-Q1 on bricks, on the scene's own mesh.

Linear statics at nu = 0.5: augmented Lagrangian on mixed cells, exact volume. Find u and pressures
p, of their own in every cell: a(u, v) + (p, theta(v)) = f(v), theta(u) = 0, theta the projected
volume strain (`fem.assembly.assemble`). K holds a and a finite penalty r theta^T theta; each
iteration adds r theta to p (Uzawa's, on the penalised problem: Fortin & Glowinski 1983, ch. 1). The
error shrinks by about mu / r an iteration, so that the limit is that of the saddle system and of
the penalty in nothing.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu
from skfem import (
    Basis,
    BilinearForm,
    ElementHex1,
    ElementHex2,
    ElementQuad1,
    ElementQuad2,
    ElementTetP1,
    ElementTetP2,
    ElementTriP1,
    ElementTriP2,
    ElementVector,
    FacetBasis,
    LinearForm,
    asm,
)
from skfem.helpers import ddot, div, sym_grad

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.fem.assembly.assemble import (
    lame_constants,
    library_mesh,
    mean_divergence,
)
from validate.fem.linear_solvers.factor import Factor, Fronts
from validate.fem.system import System
from validate.scene.places import Place, facets_of, kind_of
from validate.scene.scene import Load, Pressure, Scene, Weight

_PAIRS = {
    "tri3": (ElementTriP2, ElementTriP1),
    "tet4": (ElementTetP2, ElementTetP1),
    "quad4": (ElementQuad2, ElementQuad1),
    "hex8": (ElementHex2, ElementHex1),
}


@dataclass(frozen=True)
class MixedStatic:
    """Displacements u (l, n, d) m of the mesh's nodes and compliances f u (l,) J of unit loads."""

    u: Floats
    compliances: Floats


def mixed_static(scene: Scene) -> MixedStatic:
    """Statics of one unit of every load, drives held.

    Raises `SceneError` for quadratic meshes, plane stress (which does not lock), loads other than
    consistent ones and weights, or parts that only displacement elements know.
    """
    _require_plain(scene)
    domain = library_mesh(scene.mesh)
    fine, coarse = _PAIRS[scene.mesh.kind]
    basis = Basis(domain, ElementVector(fine()), intorder=5)
    pressure = basis.with_element(coarse())
    lam, mu = (scene.thickness * c for c in lame_constants(scene))
    soft = np.where(scene.per_cell(lambda m: m.incompressible), 0.0, scene.thickness**2 / lam)
    A = asm(BilinearForm(_shear), basis, mu=mu[:, None])
    B = asm(BilinearForm(_volume), basis, pressure)
    D = asm(BilinearForm(_squeeze), pressure, by=soft[:, None])
    B = scene.thickness * B
    free = np.setdiff1d(np.arange(basis.N), _held(scene, domain, basis))
    saddle = sparse.block_array([[A[free][:, free], -B[:, free].T], [-B[:, free], -D]]).tocsc()
    forces = np.array([_force(scene, load, domain, basis) for load in scene.loads])
    right = np.hstack([forces[:, free], np.zeros((len(forces), pressure.N))])
    u = np.zeros((len(forces), basis.N))
    u[:, free] = splu(saddle).solve(np.ascontiguousarray(right.T))[: len(free)].T
    nodal = u[:, basis.nodal_dofs.T]
    return MixedStatic(nodal, np.einsum("li,li->l", forces, u))


def _shear(u: Any, v: Any, w: Any) -> Any:
    return 2 * w["mu"] * ddot(sym_grad(u), sym_grad(v))


def _volume(u: Any, q: Any, w: Any) -> Any:
    return div(u) * q


def _squeeze(p: Any, q: Any, w: Any) -> Any:
    return w["by"] * p * q


def _require_plain(scene: Scene) -> None:
    if scene.mesh.kind not in _PAIRS or scene.plane == "stress":
        raise SceneError(
            "mixed elements support linear meshes in plane strain or 3-D, not "
            f"{scene.mesh.kind} in plane {scene.plane}"
        )
    places = [p.facets for p in (*scene.supports, *scene.drives, *scene.loads)
              if not isinstance(p, Weight)]  # fmt: skip
    shaped = any(d.shape for d in scene.drives)
    if scene.masses or scene.tracked or shaped or {"faces"} != {"faces", *map(kind_of, places)}:
        raise SceneError(
            "mixed elements support faces only, no edges, points, masses, tracked sets or shapes"
        )
    if scene.foundations or scene.membranes or scene.cavities:
        raise SceneError("mixed elements support supports, pins, drives and loads only")
    spread = [x.name for x in scene.loads if not isinstance(x, Weight)
              and (isinstance(x, Pressure) or x.spread != "consistent")]  # fmt: skip
    if spread or not scene.loads:
        raise SceneError(f"mixed elements need consistent loads or weights, got {spread or 'none'}")


def _held(scene: Scene, domain: Any, basis: Basis) -> Ints:
    """Unknowns of the supports, pins and drives (k,)."""
    mesh, held = scene.mesh, [np.zeros(0, dtype=np.int64)]
    for support in scene.supports:
        names = [f"u^{c + 1}" for c in support.components]
        held.append(basis.get_dofs(_facets(scene, domain, support.facets)).all(names))
    for pin in scene.pins:
        node = mesh.nearest_node(np.array(pin.point))
        held.append(basis.nodal_dofs[list(pin.components), node])
    for drive in scene.drives:
        axes = np.flatnonzero(drive.direction)
        if drive.point is None:
            names = [f"u^{c + 1}" for c in axes]
            held.append(basis.get_dofs(_facets(scene, domain, drive.facets)).all(names))
        else:
            node = mesh.nearest_node(np.array(drive.point))
            held.append(basis.nodal_dofs[axes, node])
    return np.unique(np.concatenate(held))


def _facets(scene: Scene, domain: Any, place: Place) -> Ints:
    """The library's numbers of facets."""
    wanted, known = np.sort(facets_of(scene.mesh, place), axis=1), np.sort(domain.facets.T, axis=1)
    number = {tuple(f): i for i, f in enumerate(known.tolist())}
    return np.array([number[tuple(f)] for f in wanted.tolist()])


def _force(scene: Scene, load: Load | Weight | Pressure, domain: Any, basis: Basis) -> Floats:
    """f (N',) N of one unit of the load."""
    assert not isinstance(load, Pressure)  # refused before
    direction = np.array(load.direction)

    def pushed(v: Any, w: Any) -> Any:
        return w["by"] * np.einsum("i,i...->...", direction, v)

    if isinstance(load, Weight):
        rho = scene.thickness * scene.per_cell(lambda m: m.rho or 0.0)
        return np.asarray(asm(LinearForm(pushed), basis, by=rho[:, None]))
    facets = _facets(scene, domain, load.facets)
    side = FacetBasis(domain, basis.elem, facets=facets, intorder=4)
    f = asm(LinearForm(pushed), side, by=1.0)
    return np.asarray(f / float(np.sum(side.dx)))


_KEPT = 1e-11  # volume strain over the displacement gradient that counts as none
_ITERATIONS = 50


def keep_volumes(
    system: System, factor: Factor | Fronts, columns: Floats, loads: Floats
) -> tuple[Floats, Floats]:
    """Displacements (N, k + l) m per unit input that keep every cell with nu = 0.5, and the nodal
    forces (N, k + l) N of its pressures.

    `columns` are those of the penalty alone, drives first, `loads` (N, l) N. Raises `SceneError`
    where what is prescribed changes the volume.
    """
    scene, free = system.scene, system.free
    D, weights = mean_divergence(scene)
    kept = scene.per_cell(lambda m: m.incompressible) > 0
    bulk = lame_constants(scene)[0] + 2 / 3 * lame_constants(scene)[1]
    r = scene.thickness * (np.where(kept, bulk, 0.0)[:, None] * weights).ravel()
    push, D = sparse.csr_array(D.T * r), D[np.repeat(kept, weights.shape[1])]
    size = float(np.ptp(scene.mesh.nodes, axis=0).max())
    strain = np.abs(columns).max(axis=0) / size
    forces = np.hstack([np.zeros((len(columns), columns.shape[1] - loads.shape[1])), loads])
    u, total = columns.copy(), np.zeros((push.shape[1], columns.shape[1]))
    rows = np.flatnonzero(np.repeat(kept, weights.shape[1]))
    for _ in range(_ITERATIONS):
        theta = D @ u
        worst = np.abs(theta).max(axis=0)
        held = push @ total
        if (worst <= _KEPT * strain).all():
            return u, held
        total[rows] += theta
        held = push @ total
        left = forces - held - system.K @ u
        u[free] += factor.solve(left[free])
    raise SceneError(
        f"nu = 0.5: the cells change their volume by {worst.max():.1e} of it per unit input "
        f"after {_ITERATIONS} iterations; the held and driven nodes allow no motion of "
        "constant volume: free a face, or use nu <= 0.4999"
    )
