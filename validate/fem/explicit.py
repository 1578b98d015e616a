"""A tet4 body at large strain for explicit schemes: the forces of `fem.hyperelastic`, compiled.

The element loops are in `fem.explicit_kernels`; this is their packing and their interface. Unlike
`Body` it takes regions: moduli are per cell.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.fem import explicit_kernels as kernels
from validate.fem.assemble import shape_gradients
from validate.fem.explicit_kernels import LANES, NEO_HOOKE, ROWS, SVK
from validate.fem.surface import foundation_stiffness
from validate.scene.mesh import cell_volumes, require_positive_cells
from validate.scene.scene import Scene

_LAWS = {"svk": SVK, "neo_hooke": NEO_HOOKE}


@dataclass(frozen=True)
class Look:
    """A state of the body: stored energy J, least det F, cells of `cells` with det F <= 0."""

    energy: float
    det_F: float
    inverted: int
    cells: int


@dataclass(frozen=True)
class Motion:
    """u (N,) m, the last increment d, forces r at u and `old` one step before (N,) N."""

    u: Floats
    d: Floats
    r: Floats
    old: Floats

    def copy(self) -> "Motion":
        return Motion(self.u.copy(), self.d.copy(), self.r.copy(), self.old.copy())


@dataclass(frozen=True)
class Rule:
    """d' = keep d - gain (r + lag (r - old) - f), all (N,): see `explicit_kernels.advance`."""

    keep: Floats
    gain: Floats
    lag: float


@dataclass(frozen=True)
class Ends:
    """Places (2, held) m of held unknowns, loads (2, loaded) N, at both ends of some steps."""

    held: Ints
    places: Floats
    loaded: Ints
    loads: Floats


class ExplicitBody:
    """A scene's cells packed in blocks; displacements u (N,) m, node-major.

    Foundations act as linear springs, as in `Body`. Raises `SceneError` for other elements than
    tet4, inverted cells, a linear law, membranes and nodal mean dilatation. One object serves one
    thread: its workspace is its own.
    """

    def __init__(self, scene: Scene) -> None:
        _require(scene)
        mesh = scene.mesh
        self.scene, self.law, self.size = scene, _LAWS[scene.material.law], mesh.nodes.size
        self.geometry, self.cells = _packed(scene)
        self.work = np.zeros(kernels.WORK)
        springs = [foundation_stiffness(mesh, f) for f in scene.foundations]
        self.springs: sparse.csr_array | None = sum(springs[1:], springs[0]) if springs else None
        K = self.springs if springs else sparse.csr_array((self.size, self.size))
        self._springs = (K.indptr.astype(np.int32), K.indices.astype(np.int32), K.data)

    def force(self, u: Floats) -> Floats:
        """Internal nodal forces (N,) N."""
        f = np.zeros(self.size) if self.springs is None else self.springs @ u
        kernels.add_forces(self.law, self.geometry, self.cells, u, f, self.work)
        return f

    def tangent_diagonal(self, u: Floats) -> Floats:
        """The diagonal (N,) N/m of K_t."""
        return self.force_and_diagonal(u)[1]

    def force_and_diagonal(self, u: Floats) -> tuple[Floats, Floats]:
        """Internal forces (N,) N and the diagonal (N,) N/m of K_t, in one pass."""
        f, d = np.zeros(self.size), np.zeros(self.size)
        if self.springs is not None:
            f, d = self.springs @ u, self.springs.diagonal()
        self._blocks(u, f, d)
        return f, d

    def tangent_blocks(self, u: Floats) -> Floats:
        """The blocks (n, 3, 3) N/m of K_t that couple a node with itself."""
        six = self.force_and_blocks(u)[1]
        return six[:, [0, 3, 4, 3, 1, 5, 4, 5, 2]].reshape(-1, 3, 3)

    def force_and_blocks(self, u: Floats) -> tuple[Floats, Floats]:
        """Internal forces (N,) N and the nodes' own blocks (n, 6): xx, yy, zz, xy, xz, yz N/m."""
        f, d = np.zeros(self.size), np.zeros(2 * self.size)
        if self.springs is not None:
            f = self.springs @ u
            d.reshape(-1, 6)[:, :3] = self.springs.diagonal().reshape(-1, 3)
        self._blocks(u, f, d)
        return f, d.reshape(-1, 6)

    def tangent_product(self, u: Floats, v: Floats) -> Floats:
        """K_t(u) v (N,) N."""
        f = np.zeros(self.size) if self.springs is None else self.springs @ v
        kernels.add_products(self.law, self.geometry, self.cells, u, v, f, self.work)
        return f

    def look(self, u: Floats) -> Look:
        """Stored energy and det F of all cells: not for every step."""
        count = len(self.scene.mesh.cells)
        energy, least, inverted = kernels.looked_at(
            self.law, count, self.geometry, self.cells, u, self.work
        )
        springs = 0.0 if self.springs is None else float(u @ (self.springs @ u)) / 2
        return Look(energy + springs, least, inverted, count)

    def advance(self, motion: Motion, rule: Rule, ends: Ends, substeps: int) -> tuple[float, float]:
        """Central-difference steps in one compiled call; `motion` is overwritten.

        Returns work J of the loads and prescribed motion, and J taken by damping.
        """
        return kernels.advance(
            self.law, self.geometry, self.cells, self._springs,
            motion.u, motion.d, motion.r, motion.old, rule.keep, rule.gain, rule.lag,
            ends.held, ends.places, ends.loaded, ends.loads, substeps, self.work,
        )  # fmt: skip

    def _blocks(self, u: Floats, f: Floats, d: Floats) -> None:
        kernels.add_forces_and_blocks(self.law, self.geometry, self.cells, u, f, d, self.work)


def _require(scene: Scene) -> None:
    if scene.mesh.kind != "tet4":
        raise SceneError(f"elements of kind {scene.mesh.kind} have no explicit form; use tet4")
    if scene.material.law not in _LAWS:
        raise SceneError(
            f"law '{scene.material.law}' has no form at large strain; choose one of {sorted(_LAWS)}"
        )
    if scene.membranes:
        raise SceneError("membranes are linear only: drop them, or take the linear law")
    if scene.dilatation != "pointwise":
        raise SceneError("nodal mean dilatation has no explicit form; use dilatation='pointwise'")
    require_positive_cells(scene.mesh)


def _packed(scene: Scene) -> tuple[Floats, kernels.Cells]:
    """Geometry (blocks, 11 x 16) and cells (blocks, 4, 16), filled up with cells of no stiffness."""
    mesh = scene.mesh
    e, blocks = len(mesh.cells), -(-len(mesh.cells) // LANES)
    rows, cells = np.zeros((blocks * LANES, ROWS)), np.zeros((blocks * LANES, 4), np.int32)
    rows[:e, :9] = shape_gradients(mesh)[:, 1:].reshape(e, 9)
    volumes, mu = cell_volumes(mesh), scene.per_cell(lambda m: m.shear_modulus)
    kappa = scene.per_cell(lambda m: m.bulk_modulus)
    rows[:e, 9] = volumes * (kappa - 2 * mu / 3 if scene.material.law == "svk" else kappa)
    rows[:e, 10] = volumes * mu
    cells[:e] = 3 * mesh.cells
    packed = np.ascontiguousarray(rows.reshape(blocks, LANES, ROWS).swapaxes(1, 2))
    lanes = np.ascontiguousarray(cells.reshape(blocks, LANES, 4).swapaxes(1, 2))
    return packed.reshape(blocks, ROWS * LANES), lanes
