"""Hyperelastic body in total Lagrangian form: energy, internal force and tangent.

f_int = sum over points of w P : dN/dX, K_t its derivative (Bonet & Wood 2008, ch. 9). The isochoric
law acts at every point, the volumetric one on the law's measure of volume change (tr E or J - 1):
pointwise, projected in every cell (`fem.assembly.assemble`), or averaged around each node
(`fem.large_strain.hyperelastic`). At rest the tangent is that of `fem.assembly.assemble`.

Near nu = .5 Newton's method wants the pressures p of the tangent to be unknowns of their own, p' =
U'(theta(u)) + U''(theta(u)) dtheta (`extrapolated`): the pressure that a step of size d leaves at
its end, kappa d^2 too large, then stiffens or softens nothing (Magisano, Leonetti & Garcea 2017 for
stresses at points). At a solution both are one.

At nu = .5 the mean J - 1 of every cell is kept at zero by multipliers, p = multiplier + U'(theta)
with a finite kappa in U (augmented Lagrangian: Hestenes 1969; Simo & Taylor 1991 for volumes). The
pressures that an iteration has foreseen are the next multipliers; at a solution theta = 0 in every
cell and p is the multiplier alone.

In two dimensions H is completed: by nothing in plane strain, in plane stress by the stretch that
leaves no stress across (`fem.laws.plane_stress`). Forces are those of the scene's thickness.

Departures: four points per quadratic tetrahedron (degree 2) integrate the stiffness at rest
exactly; at large strain they are what the order of convergence needs, not exact. Foundations act as
linear springs at any displacement; membranes are known at small strain only and are refused.

Common interface of linear and large-strain bodies for Newton's method.
"""

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy import sparse

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.fem.assembly.assemble import (
    foundation_stiffness,
    projections,
    shape_gradients,
    stiffness_points,
)
from validate.fem.laws.energies import green_strain, volume_change
from validate.fem.laws.law import Law, parts_of
from validate.fem.laws.plane_stress import PlaneStress
from validate.fem.laws.viscoelasticity import Branches, Lagged, Remembered, second_stress
from validate.fem.system import System
from validate.scene.material import Material
from validate.scene.mesh import Mesh, require_positive_cells
from validate.scene.scene import Scene

# --- Where the entries of the cells go in a sparse matrix, found once and used at every
# assembly.


class NodePattern:
    """d x d blocks of all pairs of nodes that share a cell; `cells` (e, k), n nodes."""

    def __init__(self, cells: Ints, n: int, d: int) -> None:
        pairs = (cells[:, :, None] * n + cells[:, None, :]).reshape(len(cells), -1)
        keys, place = np.unique(pairs, return_inverse=True)
        self.place = place.reshape(pairs.shape)
        self.columns = keys % n
        self.starts = np.concatenate([[0], np.cumsum(np.bincount(keys // n, minlength=n))])
        self.n, self.d = n, d

    def zeros(self) -> Floats:
        return np.zeros((len(self.columns), self.d, self.d))

    def add(self, blocks: Floats, part: slice | Ints, local: Floats) -> None:
        """Add the matrices (e, a, i, j, b) of the cells `part` to `blocks` in place; in 2-D what
        they have of the third direction is left out."""
        place = self.place[part].ravel()
        for i in range(self.d):
            for j in range(self.d):
                values = local[:, :, i, j].ravel()
                blocks[:, i, j] += np.bincount(place, values, minlength=len(blocks))

    def matrix(self, blocks: Floats) -> sparse.csr_array:
        """Return the matrix (n d, n d), node-major."""
        size = self.d * self.n
        parts = (blocks, self.columns, self.starts)
        return sparse.csr_array(sparse.bsr_array(parts, shape=(size, size)))


# --- The volumetric part of nodal mean dilatation at large strain, on linear tetrahedra.
#
# W = sum_a V_a U(s_a), s_a = sum_e V_e/4 s_e / V_a, over the cells e around node a, with the
# law's own measure s (tr E or J - 1). Source: Bonet & Burton (1998), their J averaged; the form
# for St. Venant-Kirchhoff is the same average of tr E.


class NodalMean:
    """`law` gives the measure and U with modulus kappa Pa; cell gradients H (e, 3, 3)."""

    def __init__(self, mesh: Mesh, law: Law, kappa: float) -> None:
        self.law, self.kappa = law, kappa
        self.gradients = shape_gradients(mesh)
        cells, n = mesh.corners, len(mesh.nodes)
        share = np.repeat(mesh.cell_volumes() / 4, 4)
        entries = (share, (cells.ravel(), np.repeat(np.arange(len(cells)), 4)))
        gathered = sparse.csr_array(entries, shape=(n, len(cells)))
        self.volumes: Floats = np.asarray(gathered.sum(axis=1))
        self.average = sparse.csr_array(sparse.diags_array(1 / self.volumes) @ gathered)
        self.columns = (3 * cells[..., None] + np.arange(3)).ravel()
        self.starts = 12 * np.arange(len(cells) + 1)
        self.cells, self.shape = cells, (len(cells), 3 * n)

    def energy(self, H: Floats) -> float:
        """J."""
        return float(self.volumes @ self._at_nodes(H)[0])

    def pressures(self, H: Floats, dH: Floats | None = None) -> Floats:
        """Return the slope dU/ds (e,) Pa that acts in every cell: the mean of its nodes' slopes,
        with the linear change that cell gradients dH (e, 3, 3) make."""
        _, slopes, stiff = self._at_nodes(H)
        if dH is not None:
            ds = (self.law.dilatation(H)[1] * dH).sum(axis=(-2, -1))
            slopes = slopes + stiff * (self.average @ ds)
        return np.asarray(slopes[self.cells].mean(axis=1))

    def tangent(self, H: Floats) -> sparse.csr_array:
        """D^T V U'' D (N, N) N/m, D = ds_a/du; the part with d2s/dF2 is the cells' own."""
        slope = self.law.dilatation(H)[1]
        values = (self.gradients @ np.swapaxes(slope, 1, 2)).ravel()
        B = sparse.csr_array((values, self.columns, self.starts), shape=self.shape)
        D = sparse.csr_array(self.average @ B)
        stiff = sparse.diags_array(self.volumes * self._at_nodes(H)[2])
        return sparse.csr_array(D.T @ stiff @ D)

    def _at_nodes(self, H: Floats) -> tuple[Floats, Floats, Floats]:
        s = np.asarray(self.average @ self.law.dilatation(H)[0])
        return self.law.volumetric(s, self.kappa)


# -------------------------------------------------------------------------------------------------

BEYOND_LAW = "beyond the law's validity"  # how the reason begins where a cell leaves the law
_BLOCK = 2048  # cells at a time: bounds the memory of the kernel's temporaries


@dataclass(frozen=True)
class Inverted:
    """`count` of `points` quadrature points with det F <= 0, `first` the first such cell."""

    count: int
    points: int
    first: int


@dataclass(frozen=True)
class _Block:
    """Cells of one material: its isochoric law and kappa Pa, H (b, q, 3, 3) = du/dX."""

    cells: slice | Ints
    law: Law
    kappa: float
    H: Floats


class Body:
    """A scene's mesh and laws, prepared once; displacements u (N,) m, node-major.

    Raises `SceneError` for inverted cells, a linear law, a membrane, and a Prony series in 2-D.
    """

    def __init__(self, scene: Scene) -> None:
        mesh = scene.mesh
        if scene.membranes:
            raise SceneError("membranes are linear only: remove them, or use the linear law")
        if mesh.dimension == 2 and any(m.prony.g for m in scene.materials):
            raise SceneError("a Prony series needs a body in 3-D: remove it, or use a 3-D mesh")
        require_positive_cells(mesh)
        self.mesh = mesh
        self.parts, self.sheet = tuple(_parts(scene)), scene.plane == "stress"
        points = stiffness_points(mesh)
        self.gradients = np.pad(points.slopes, [(0, 0)] * 3 + [(0, 3 - mesh.dimension)])
        self.weights = scene.thickness * points.weights
        self.projections = None
        if scene.dilatation == "mixed":
            self.projections = projections(mesh, points.places, points.weights)
        self.mean = None
        if scene.dilatation == "nodal_mean":
            self.mean = NodalMean(mesh, *self.parts[0][1:])
        self.lag: tuple[Floats, Floats] | None = None
        springs = [foundation_stiffness(mesh, f) for f in scene.foundations]
        self.springs: sparse.csr_array | None = sum(springs[1:], springs[0]) if springs else None
        self.pattern = NodePattern(mesh.cells, len(mesh.nodes), mesh.dimension)
        kept = scene.per_cell(lambda m: m.incompressible) > 0
        #: (e,): cells with nu = 0.5, if any, and the multipliers (e, q) Pa that keep their volume.
        self.kept = kept if kept.any() else None
        self.multipliers = np.zeros(self.weights.shape) if kept.any() else None
        moduli = scene.per_cell(lambda m: m.assembled_bulk_modulus + m.shear_modulus)
        spread = np.linalg.norm(self.gradients, axis=-1) * self.weights[..., None]
        spread *= moduli[:, None, None]
        #: N, norm of the nodal forces that a stress of kappa + mu in every cell would add up to.
        self.unit_force = float(np.linalg.norm(self._nodal(spread.sum(1))))

    def after(self, branches: Branches, memory: Remembered, dt: float) -> "Body":
        """Return the body at the end of a step of dt s, with what its branches remember at its
        points."""
        lagged = copy(self)
        lagged.lag = branches.lag(memory, dt)
        return lagged

    def holding(self, multipliers: Floats | None) -> "Body":
        """Return the body with these multipliers (e, q) Pa of its cells with nu = 0.5."""
        if multipliers is self.multipliers:
            return self
        held = copy(self)
        held.multipliers = multipliers
        return held

    def kept_pressures(self, pressures: Floats) -> Floats | None:
        """Pressures (e, q) Pa as multipliers: of the cells with nu = 0.5, zero in others."""
        return None if self.kept is None else np.where(self.kept[:, None], pressures, 0.0)

    def volume_error(self, u: Floats) -> float:
        """Return the largest |theta| = |projected J - 1| of the cells with nu = 0.5."""
        if self.kept is None:
            return 0.0
        error = np.empty(self.weights.shape)
        for b in self._blocks(u):
            error[b.cells] = self._mean(b, volume_change(b.H))
        return float(np.abs(error[self.kept]).max())

    def isochoric(self, u: Floats) -> Floats:
        """Return the second Piola-Kirchhoff stress (e, q, 3, 3) Pa of the relaxed isochoric law."""
        S = np.empty((*self.weights.shape, 3, 3))
        for b in self._blocks(u):
            law = b.law.law if isinstance(b.law, Lagged) else b.law
            S[b.cells] = second_stress(law, b.H)
        return S

    @property
    def most_stretch(self) -> float:
        """Above this principal stretch a law of the body has no sense."""
        return min(law.most_stretch for _, law, _ in self.parts)

    def energy(self, u: Floats) -> float:
        """Stored energy J of the mesh (not times the scene's copies)."""
        total = 0.0 if self.springs is None else float(u @ (self.springs @ u)) / 2
        total += self.mean.energy(self._cell_gradient(u)) if self.mean else 0.0
        for b in self._blocks(u):
            W = b.law.energy(b.H)
            if not self.mean:
                W = W + b.law.volumetric(self._mean(b, b.law.dilatation(b.H)[0]), b.kappa)[0]
            total += float((self.weights[b.cells] * W).sum())
        return total

    def force(self, u: Floats) -> Floats:
        """Internal nodal forces (N,) N."""
        nodal = np.empty((*self.mesh.cells.shape, 3))
        pressures = self._nodal_pressures(u)
        for b in self._blocks(u):
            s, slope = b.law.dilatation(b.H)
            p = self._slopes(b, s)[0] if pressures is None else pressures[b.cells]
            P = b.law.stress(b.H) + p[..., None, None] * slope
            weighted = np.swapaxes(self.weights[b.cells][..., None, None] * P, -1, -2)
            nodal[b.cells] = (self.gradients[b.cells] @ weighted).sum(axis=1)
        components = [self._nodal(nodal[..., i]) for i in range(self.mesh.dimension)]
        force = np.stack(components, axis=1).ravel()
        return force if self.springs is None else force + self.springs @ u

    def tangent(self, u: Floats, pressures: Floats | None = None) -> sparse.csr_array:
        """K_t (N, N) N/m, symmetric; with the `pressures` (e, q) Pa of an iteration, or u's own."""
        blocks = self.pattern.zeros()
        own = self._nodal_pressures(u) if pressures is None else pressures
        for b in self._blocks(u):
            s, slope = b.law.dilatation(b.H)
            p, stiff = self._slopes(b, s)
            p = p if own is None else own[b.cells]
            A = b.law.tangent(b.H) + p[..., None, None, None, None] * b.law.curvature(b.H)
            if self.projections is None and not self.mean:
                A = A + np.einsum("...,...iJ,...jK->...JijK", stiff, slope, slope)
            K = self._cell_tangents(b.cells, A)
            if self.projections is not None:
                K += self._projected(b, slope, stiff)
            self.pattern.add(blocks, b.cells, K)
        total = self.pattern.matrix(blocks)
        if self.springs is not None:
            total = sparse.csr_array(total + self.springs)
        if self.mean:
            total = sparse.csr_array(total + self.mean.tangent(self._cell_gradient(u)))
        return total

    def extrapolated(self, u: Floats, du: Floats) -> Floats:
        """Return the pressures (e, q) Pa at u + du, by the slope and curvature that they have at
        u."""
        if self.mean:
            p = self.mean.pressures(self._cell_gradient(u), self._cell_gradient(du))
            return np.asarray(p[:, None])
        if self.sheet:
            return np.zeros(self.weights.shape)  # no stress across leaves no pressure
        out = np.empty(self.weights.shape)
        for b, step in zip(self._blocks(u), self._blocks(du), strict=True):
            s, slope = b.law.dilatation(b.H)
            out[b.cells] = self._slopes(b, s, (slope * step.H).sum(axis=(-2, -1)))[0]
        return out

    def jacobians(self, u: Floats) -> Floats:
        """det F (e, q) at every quadrature point."""
        out = np.empty(self.weights.shape)
        for b in self._blocks(u):
            out[b.cells] = 1 + volume_change(b.H)
        return out

    def inverted(self, u: Floats) -> Inverted | None:
        """Return the points with det F <= 0, of itself or as projected, if any: no state of a
        body."""
        bad = ~(self.jacobians(u) > 0)
        if self.projections is not None:
            for b in self._blocks(u):
                bad[b.cells] |= ~(self._mean(b, volume_change(b.H)) > -1)
        if not bad.any():
            return None
        return Inverted(int(bad.sum()), bad.size, int(np.argmax(bad.any(axis=1))))

    def principal_stretches(self, u: Floats) -> Floats:
        """Return the principal stretches (e, q, 3), rising, at every quadrature point."""
        squares = np.empty((*self.weights.shape, 3))
        for b in self._blocks(u):
            squares[b.cells] = np.linalg.eigvalsh(2 * green_strain(b.H) + np.eye(3))
        return np.sqrt(np.maximum(squares, 0.0))

    def beyond_the_law(self, u: Floats) -> str:
        """Where a principal stretch is one at which its law has no sense, in words, or nothing."""
        laws = [law for _, law, _ in self.parts]
        if all(law.least_stretch == 0 and law.most_stretch == np.inf for law in laws):
            return ""
        stretches, numbers = self.principal_stretches(u), np.arange(len(self.mesh.cells))
        for cells, law, _ in self.parts:
            low, high = stretches[cells, :, 0].min(axis=1), stretches[cells, :, 2].max(axis=1)
            if low.min() < law.least_stretch:
                found, cell, ends = low.min(), low.argmin(), f"below {law.least_stretch:.3f}"
            elif high.max() > law.most_stretch:
                found, cell, ends = high.max(), high.argmax(), f"above {law.most_stretch:.3f}"
            else:
                continue
            words = f"principal stretch {found:.3f} in element {numbers[cells][cell]}"
            return f"{BEYOND_LAW}: {words} is {ends}"
        return ""

    def _mean(self, b: _Block, values: Floats) -> Floats:
        """Values (b, q) at the points as the volumetric law takes them."""
        if self.projections is None:
            return values
        return np.asarray((self.projections[b.cells] @ values[..., None])[..., 0])

    def _slopes(self, b: _Block, s: Floats, ds: Floats | None = None) -> tuple[Floats, Floats]:
        """Pressures (b, q) Pa and U'' Pa of the measures s, with the change that `ds` makes."""
        _, p, stiff = b.law.volumetric(self._mean(b, s), b.kappa)
        if self.multipliers is not None:
            p = p + self.multipliers[b.cells]
        return self._mean(b, p if ds is None else p + stiff * self._mean(b, ds)), stiff

    def _nodal_pressures(self, u: Floats) -> Floats | None:
        """Pressures (e, 1) Pa of nodal mean dilatation, which no cell has for itself."""
        return self.mean.pressures(self._cell_gradient(u))[:, None] if self.mean else None

    def _cell_tangents(self, part: slice | Ints, A: Floats) -> Floats:
        """K (e, a, i, j, b) of the cells of a block: dN_aJ A_iJjK dN_bK, summed over points."""
        dN, w = self.gradients[part], self.weights[part]
        e, q, a, _ = dN.shape
        right = (w[..., None, None] * A.reshape(e, q, 27, 3)) @ np.swapaxes(dN, -1, -2)
        left = np.swapaxes(dN, 1, 2).reshape(e, a, 3 * q)
        return (left @ right.reshape(e, 3 * q, 9 * a)).reshape(e, a, 3, 3, a)

    def _projected(self, b: _Block, slope: Floats, stiff: Floats) -> Floats:
        """(Pi ds/du)^T w U'' (Pi ds/du) as (e, a, i, j, b)."""
        assert self.projections is not None
        e, q, a, _ = self.gradients[b.cells].shape
        change = (self.gradients[b.cells] @ np.swapaxes(slope, -1, -2)).reshape(e, q, 3 * a)
        mean = self.projections[b.cells] @ change
        weighted = mean * (self.weights[b.cells] * stiff)[..., None]
        K = np.swapaxes(weighted, 1, 2) @ mean
        return np.moveaxis(K.reshape(e, a, 3, a, 3), 3, 4)

    def _blocks(self, u: Floats) -> Iterator[_Block]:
        """The cells, material by material, block by block."""
        d = self.mesh.dimension
        nodal = u.reshape(-1, d)
        if d < 3:
            nodal = np.pad(nodal, [(0, 0), (0, 3 - d)])
        for part, law, kappa in self.parts:
            local = np.swapaxes(nodal[self.mesh.cells[part]], 1, 2)
            if self.lag is not None:
                law = Lagged(law, self.lag[0][part], self.lag[1][part])
            H = local[:, None] @ self.gradients[part]
            yield _Block(part, law, kappa, law.completed(H) if isinstance(law, PlaneStress) else H)

    def _cell_gradient(self, u: Floats) -> Floats:
        """H (e, 3, 3) of linear cells."""
        return np.concatenate([b.H[:, 0] for b in self._blocks(u)])

    def _nodal(self, values: Floats) -> Floats:
        """Sums (n,) of what the cells (e, k) leave at their nodes."""
        cells, n = self.mesh.cells, len(self.mesh.nodes)
        return np.bincount(cells.ravel(), values.ravel(), n).astype(np.float64)


def _parts(scene: Scene) -> Iterator[tuple[slice | Ints, Law, float]]:
    """Cells by material, in blocks; a body of one material is cut in slices, which copy nothing."""
    if not scene.regions:
        for start in range(0, len(scene.mesh.cells), _BLOCK):
            yield slice(start, start + _BLOCK), *_law(scene, scene.material)
        return
    own = np.zeros(len(scene.mesh.cells), dtype=np.int64)
    for i, region in enumerate(scene.regions, start=1):
        own[region.cells] = i
    for i, material in enumerate((scene.material, *(r.material for r in scene.regions))):
        cells = np.flatnonzero(own == i)
        for start in range(0, len(cells), _BLOCK):
            yield cells[start : start + _BLOCK], *_law(scene, material)


def _law(scene: Scene, material: Material) -> tuple[Law, float]:
    """The isochoric law and kappa Pa; in plane stress both as one, with no volumetric part left."""
    law, kappa = parts_of(material, averaged=scene.dilatation != "pointwise")
    return (PlaneStress(law, kappa), 0.0) if scene.plane == "stress" else (law, kappa)


class Elastic(Protocol):
    """What is needed of a body at displacements u (N,) m; `unit_force` N scales its rounding."""

    @property
    def unit_force(self) -> float: ...

    def force(self, u: Floats) -> Floats: ...

    def tangent(self, u: Floats, pressures: Floats | None = None) -> sparse.csr_array: ...

    def extrapolated(self, u: Floats, du: Floats) -> Floats | None: ...

    def energy(self, u: Floats) -> float: ...

    def inverted(self, u: Floats) -> Inverted | None: ...


@dataclass(frozen=True)
class LinearBody:
    """K u, whatever u; `unit_force` N is what a displacement of the body's size would take."""

    K: sparse.csr_array
    unit_force: float

    def force(self, u: Floats) -> Floats:
        return np.asarray(self.K @ u)

    def tangent(self, u: Floats, pressures: Floats | None = None) -> sparse.csr_array:
        return self.K

    def extrapolated(self, u: Floats, du: Floats) -> None:
        return None

    def energy(self, u: Floats) -> float:
        return float(u @ (self.K @ u)) / 2

    def inverted(self, u: Floats) -> None:
        return None


def elastic(system: System) -> Elastic:
    """Return the body of a system; raises `SceneError` for what has no form at large strain."""
    scene = system.scene
    if scene.material.law != "linear":
        return Body(scene)
    size = float(np.ptp(scene.mesh.nodes, axis=0).max())
    return LinearBody(system.K, size * float(np.linalg.norm(system.K.diagonal())))
