"""Bodies of tet4 or mixed hex8 at large strain for explicit schemes.

The element loops are in `fem.kernels.explicit` and `fem.kernels.cells`; this is their packing and
their interface.

Mixed hexahedra packed for the compiled loops of `fem.kernels.cells`.
"""

import math
import os
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from functools import partial
from operator import attrgetter
from typing import Literal, get_args

import numpy as np
from scipy import sparse

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.fem.assembly.assemble import foundation_stiffness, shape_gradients, stiffness_points
from validate.fem.kernels import explicit as kernels
from validate.fem.kernels import points as laws
from validate.fem.kernels.cells import BRICK_ROWS, CORNERS, LANES, POINTS, ROWS
from validate.fem.kernels.explicit import Cells
from validate.fem.kernels.lanes import BLOCK, on_lines
from validate.fem.kernels.points import NEO_HOOKE, SVK
from validate.fem.laws.viscoelasticity import cell_branches, taut
from validate.scene.laws import coupled_lambda, further_laws, ogden_terms
from validate.scene.material import Material
from validate.scene.mesh import require_positive_cells
from validate.scene.scene import Scene

_BRICK_LAWS = ("neo_hooke", "mooney_rivlin", "yeoh")


# kappa, C10, C01, C20, C30 Pa.
_CARD: tuple[Callable[[Material], float], ...] = (
    lambda m: m.bulk_modulus,
    lambda m: m.shear_modulus / 2 - m.coefficients.C01,
    lambda m: m.coefficients.C01,
    lambda m: m.coefficients.C20,
    lambda m: m.coefficients.C30,
)


def require_bricks(scene: Scene) -> None:
    """Raise `SceneError` for what mixed hexahedra have no explicit form of."""
    if scene.dilatation != "mixed":
        raise SceneError(
            f"explicit hexahedra must be mixed, because {scene.dilatation} ones lock; use "
            "dilatation='mixed'"
        )
    for m in (scene.material, *(r.material for r in scene.regions)):
        form = m.coefficients.volumetric
        if m.law not in _BRICK_LAWS or form != "split":
            raise SceneError(
                f"explicit hexahedra support the laws {', '.join(_BRICK_LAWS)} in their split "
                f"form, not '{m.law}' ({form})"
            )


def packed_bricks(scene: Scene) -> tuple[Floats, Cells]:
    """Geometry (blocks, 9, 25, 16) and cells (blocks, 8, 16), the rest without stiffness."""
    mesh, points = scene.mesh, stiffness_points(scene.mesh)
    e = len(mesh.cells)
    blocks = -(-e // LANES)
    rows = np.zeros((blocks * LANES, POINTS + 1, BRICK_ROWS))
    rows[:e, :POINTS, :24] = np.swapaxes(points.slopes, 2, 3).reshape(e, POINTS, 24)
    rows[:e, :POINTS, 24] = points.weights
    for k, modulus in enumerate(_CARD):
        rows[:e, POINTS, k] = scene.per_cell(modulus)
    rows[:e, POINTS, 5] = 1 / points.weights.sum(axis=1)
    cells = np.zeros((blocks * LANES, CORNERS), np.int32)
    cells[:e] = 3 * mesh.cells
    packed = rows.reshape(blocks, LANES, POINTS + 1, BRICK_ROWS).transpose(0, 2, 3, 1)
    lanes = cells.reshape(blocks, LANES, CORNERS).swapaxes(1, 2)
    return np.ascontiguousarray(packed), np.ascontiguousarray(lanes)


Precision = Literal["double", "single"]
RowName = Literal["u", "d", "r", "old", "v", "a"]
_ROWS: tuple[RowName, ...] = get_args(RowName)
# Turns that a thread waits awake for the next step; read when GNU OpenMP is loaded. With its own
# default steps take a hundred times as long where another process has the core.
_PATIENCE = "3000"
_DIFFERENCE = 1e-6  # of the body's size: half the step of a difference of forces
_LAWS = {
    ("svk", "split"): SVK,
    ("neo_hooke", "split"): NEO_HOOKE,
    ("neo_hooke", "coupled"): laws.INVARIANTS_COUPLED,
    ("ogden", "split"): laws.OGDEN,
    ("ogden", "coupled"): laws.OGDEN_COUPLED,
    **dict.fromkeys((("mooney_rivlin", "split"), ("yeoh", "split")), laws.INVARIANTS),
    **dict.fromkeys((("mooney_rivlin", "coupled"), ("yeoh", "coupled")), laws.INVARIANTS_COUPLED),
}


#: Law, geometry, cells, springs and their diagonal (empty without any), workspace.
PackedBody = tuple[int, Floats, kernels.Cells, kernels.Springs, Floats, Floats]


@dataclass(frozen=True)
class BodyLook:
    """A state of the body: stored energy J, least det F, cells of `cells` with det F <= 0."""

    energy: float
    det_F: float
    inverted: int
    cells: int


@dataclass(frozen=True)
class ExplicitMotion:
    """Rows (6, N): u m, last increment d m, forces r at u and `old` one step before N, v, a."""

    rows: Floats
    #: What the branches of a viscoelastic body remember; None at rest, and where there are none.
    memory: Floats | None = None

    def __getitem__(self, name: RowName) -> Floats:
        row: Floats = self.rows[_ROWS.index(name)]
        return row


@dataclass(frozen=True)
class CentralRule:
    """Steps of dt s, d' = keep d - gain (r + lag (r - old) - f): `kernels.advance`.

    `held` unknowns move by `moves` (held, k) times the drives, `loaded` take `loads` (loaded, l).
    """

    dt: float
    keep: Floats
    gain: Floats
    lag: float
    held: Ints
    moves: Floats
    loaded: Ints
    loads: Floats


class ExplicitBody:
    """A scene's cells packed in blocks; displacements u (N,) m, node-major.

    Foundations act as linear springs, as in `Body`. Raises `SceneError` for other elements than
    tet4 and mixed hex8, inverted cells, a linear law, membranes and nodal mean dilatation. One
    object serves one caller at a time: its workspace is its own. `threads` above 1 share the cells
    of `force` and `advance`, with the same results to rounding: two are 1.8 times as fast at 8640
    tets where the cores are idle, and several times slower than one where they are not. Without
    OpenMP numba bears only one caller a process with threads. `force` of a viscoelastic body is the
    relaxed one; in `advance` its branches act. In single `precision` the element loops of forces
    and blocks reckon in float32, from displacements rounded to it; what they give is added up over
    time in doubles, and looks and products stay double.
    """

    def __init__(self, scene: Scene, threads: int = 1, precision: Precision = "double") -> None:
        _require(scene)
        require_threads(threads)
        mesh = scene.mesh
        self.scene, self.law, self.size = scene, _code(scene.material), mesh.nodes.size
        self.geometry, self.cells = packed_bricks(scene) if mesh.bricks else _packed(scene)
        self.branches = cell_branches(scene)
        self._taut = self.geometry
        if self.branches:
            if mesh.bricks:
                raise SceneError(
                    "explicit hexahedra do not support a Prony series: remove it, or use tet4 or "
                    "NewtonDynamics"
                )
            if threads > 1:
                raise SceneError(
                    f"{threads} threads: a viscoelastic body supports one; use threads=1"
                )
            self._taut = _packed(taut(scene))[0]
        if precision == "single" and not knows_single(scene):
            raise SceneError(
                "single precision supports tet4 of St. Venant-Kirchhoff or neo-Hooke in its "
                "split form, without a Prony series; take precision='double'"
            )
        # The geometry that forces and blocks are reckoned with
        self._swift = self.geometry if precision == "double" else _in_single(self.geometry)
        self.work = on_lines(np.zeros(kernels.work_size(len(mesh.nodes))))
        self._quick = self.work if precision == "double" else _in_single(self.work)
        self._places = {1: self._quick}
        self.share(threads)
        springs = sparse.csr_array((self.size, self.size))
        for foundation in scene.foundations:
            springs = sparse.csr_array(springs + foundation_stiffness(mesh, foundation))
        self._spring(springs)

    def share(self, threads: int) -> None:
        """So many threads from now on."""
        if threads not in self._places:
            os.environ.setdefault("GOMP_SPINCOUNT", _PATIENCE)
            size = kernels.parts_size(self.size // 3)
            self._places[threads] = on_lines(np.zeros((threads, size), self._quick.dtype))
        self._parts = self._places[threads]

    def _spring(self, springs: sparse.csr_array) -> None:
        self.springs, self._own_springs = springs, np.asarray(springs.diagonal())
        rows = springs.indptr.astype(np.int32), springs.indices.astype(np.int32), springs.data
        own = self._own_springs if springs.nnz else np.zeros(0)
        self._packed = self.law, self._swift, self.cells, rows, own, self._quick

    def sprung(self, springs: sparse.csr_array) -> "ExplicitBody":
        """The same body with more linear springs (N, N) N/m; both share one workspace."""
        other = copy(self)
        other._spring(sparse.csr_array(self.springs + springs))
        return other

    @property
    def packed(self) -> PackedBody:
        """What compiled loops take of a body of tetrahedra."""
        self._require_tets()
        return self._packed

    def force(self, u: Floats) -> Floats:
        """Internal nodal forces (N,) N."""
        f = self._pull(u)
        add = kernels.add_forces if self._parts.ndim == 1 else kernels.add_forces_in_parts
        add(self.law, self._swift, self.cells, _own(u), f, self._parts)
        return f

    def force_and_diagonal(self, u: Floats) -> tuple[Floats, Floats]:
        """Internal forces (N,) N and the diagonal (N,) N/m of K_t, in one pass."""
        f, d = self._pull(u), self._own_springs.copy()
        self._blocks(u, f, d)
        return f, d

    def force_and_blocks(self, u: Floats) -> tuple[Floats, Floats]:
        """Internal forces (N,) N and the nodes' own blocks (n, 6): xx, yy, zz, xy, xz, yz N/m."""
        f, d = self._pull(u), np.zeros(2 * self.size)
        if self.springs.nnz:
            d.reshape(-1, 6)[:, :3] = self._own_springs.reshape(-1, 3)
        self._blocks(u, f, d)
        return f, d.reshape(-1, 6)

    def tangent_product(self, u: Floats, v: Floats) -> Floats:
        """K_t(u) v (N,) N; of hexahedra by a central difference, good to 7 digits, of viscoelastic
        bodies with the instantaneous moduli."""
        if self.scene.mesh.bricks:
            size = float(np.ptp(self.scene.mesh.nodes)) * _DIFFERENCE
            h = size / max(float(np.abs(v).max()), np.finfo(float).tiny)
            return (self.force(u + h * v) - self.force(u - h * v)) / (2 * h)
        f = self._pull(v)
        kernels.add_products(self.law, self._taut, self.cells, _own(u), _own(v), f, self.work)
        return f

    def look(self, u: Floats) -> BodyLook:
        """Stored energy and det F of all cells: not for every step."""
        count = len(self.scene.mesh.cells)
        energy, least, inverted = kernels.looked_at(
            self.law, count, self.geometry, self.cells, _own(u), self.work
        )
        return BodyLook(energy + float(u @ self._pull(u)) / 2, least, inverted, count)

    def advance(
        self, motion: ExplicitMotion, rule: CentralRule, begin: Floats, end: Floats, substeps: int
    ) -> tuple[ExplicitMotion, float, float, bool]:
        """Central-difference steps from inputs `begin` to `end` (k + l,), in one compiled call.

        Returns the new motion; work J of loads and prescribed motion and J taken by damping, both
        up to half a step before the end; whether all displacements are finite.
        """
        rows = np.empty((6, self.size))
        rows[:4] = motion.rows[:4]
        memory, series = self._remembered(motion, rule.dt)
        work, taken, size = kernels.advance(
            self.law, self._swift, self.cells, self._packed[3], rows,
            rule.keep, rule.gain, rule.lag, rule.dt,
            rule.held, rule.moves, rule.loaded, rule.loads, _own(begin), _own(end), substeps,
            self._parts, memory, series,
        )  # fmt: skip
        rows.setflags(write=False)
        return ExplicitMotion(rows, memory), work, taken, math.isfinite(size)

    def _remembered(self, motion: ExplicitMotion, dt: float) -> tuple[Floats | None, Floats | None]:
        """The memory to go on from, as a copy, and the series of steps of dt s."""
        if self.branches is None:
            return None, None
        blocks, k = len(self.cells), 2 * len(self.branches.g)
        series, factors = np.zeros((k, blocks * BLOCK)), np.stack(self.branches.factors(dt), 1)
        series[:, : len(self.scene.mesh.cells)] = factors.reshape(k, -1)
        lanes = np.ascontiguousarray(series.reshape(k, blocks, BLOCK).swapaxes(0, 1))
        if motion.memory is None:
            return np.zeros((blocks, 6 + 3 * k, BLOCK)), lanes
        return motion.memory.copy(), lanes

    def _pull(self, u: Floats) -> Floats:
        """Forces (N,) N of the springs alone."""
        return np.asarray(self.springs @ u) if self.springs.nnz else np.zeros(self.size)

    def _require_tets(self) -> None:
        if self.scene.mesh.bricks:
            raise SceneError("node filters support tetrahedra only; use box()")

    def _blocks(self, u: Floats, f: Floats, d: Floats) -> None:
        self._require_tets()
        law, geometry, cells, *_, work = self._packed
        kernels.add_forces_and_blocks(law, geometry, cells, _own(u), f, d, work)


def _in_single(x: Floats) -> Floats:
    """In float32, for which loops are compiled as they are for doubles."""
    return on_lines(x.astype(np.float32))


def knows_single(scene: Scene) -> bool:
    """Return whether a body's element loops are written for single precision."""
    known = scene.mesh.kind == "tet4" and _code(scene.material) in (SVK, NEO_HOOKE)
    return known and cell_branches(scene) is None


def require_threads(threads: int) -> None:
    """Raise `SceneError` for fewer than one."""
    if threads < 1:
        raise SceneError(f"{threads} threads: use 1, or at most the number of idle cores")


def _own(x: Floats) -> Floats:
    """x, or a copy that the kernels are compiled for: each kind of array would be compiled anew."""
    return x if x.flags.carray else np.array(x, dtype=np.float64, order="C")


def _require(scene: Scene) -> None:
    kind = scene.mesh.kind
    if kind not in ("tet4", "hex8"):
        raise SceneError(f"elements of kind {kind} have no explicit form; use tet4, or hex8")
    if kind == "hex8":
        require_bricks(scene)
    materials = (scene.material, *(r.material for r in scene.regions))
    if kind == "tet4" and len({_code(m) for m in materials}) > 1:
        forms = sorted({f"{m.law} {m.coefficients.volumetric}" for m in materials})
        raise SceneError(f"explicit steps support one law in one form, not {forms}")
    if scene.membranes:
        raise SceneError("membranes are linear only: remove them, or use the linear law")
    if kind == "tet4" and scene.dilatation != "pointwise":
        raise SceneError(
            f"{scene.dilatation} dilatation of tet4 has no explicit form; use 'pointwise'"
        )
    require_positive_cells(scene.mesh)


def _code(material: Material) -> int:
    law, form = material.law, material.coefficients.volumetric
    if (law, form) not in _LAWS:
        known = sorted({name for name, _ in _LAWS})
        what = "compiled form" if law in further_laws() else "large-strain form"
        raise SceneError(f"law '{law}' has no {what}; choose one of {known}")
    return _LAWS[law, form]


def _packed(scene: Scene) -> tuple[Floats, kernels.Cells]:
    """Geometry (blocks, 11 x 16) and cells (blocks, 4, 16), the rest filled up with soft cells.

    Rows: 9 gradients and two moduli times volume; with the card of a law (blocks, 11 + k, 16).
    """
    mesh, (bulk, cards) = scene.mesh, _cards(scene)
    e, blocks = len(mesh.cells), -(-len(mesh.cells) // BLOCK)
    n = ROWS + cards.shape[1]
    rows, cells = np.zeros((blocks * BLOCK, n)), np.zeros((blocks * BLOCK, 4), np.int32)
    rows[:e, :9] = shape_gradients(mesh)[:, 1:].reshape(e, 9)
    volumes, mu = mesh.cell_volumes(), scene.per_cell(lambda m: m.shear_modulus)
    rows[:e, 9], rows[:e, 10], rows[:e, ROWS:] = volumes * bulk, volumes * mu, cards
    cells[:e] = 8 * mesh.cells
    packed = on_lines(rows.reshape(blocks, BLOCK, n).swapaxes(1, 2))
    lanes = on_lines(cells.reshape(blocks, BLOCK, 4).swapaxes(1, 2))
    return packed if cards.shape[1] else packed.reshape(blocks, n * BLOCK), lanes


def _cards(scene: Scene) -> tuple[Floats, Floats]:
    """What every cell's volume resists by, Pa (e,), and its card (e, k), moduli times volume."""
    law, volumes = _code(scene.material), scene.mesh.cell_volumes()[:, None]
    lame = law in (SVK, laws.OGDEN_COUPLED)
    bulk = scene.per_cell(lambda m: m.bulk_modulus - (2 * m.shear_modulus / 3 if lame else 0.0))
    if law in (SVK, NEO_HOOKE):
        return bulk, np.zeros((len(bulk), 0))
    if law in (laws.OGDEN, laws.OGDEN_COUPLED):
        return bulk, _terms(scene, volumes)
    if law == laws.INVARIANTS_COUPLED:
        bulk = scene.per_cell(
            lambda m: coupled_lambda(m.coefficients, m.shear_modulus, m.bulk_modulus)
        )
    values = [scene.per_cell(attrgetter(f"coefficients.{name}")) for name in ("C01", "C20", "C30")]
    return bulk, volumes * np.stack(values, axis=1)


def _terms(scene: Scene, volumes: Floats) -> Floats:
    """mu_p times volume and alpha_p of every cell's terms, in turn; none has power 1, modulus 0."""
    found = [scene.material, *(region.material for region in scene.regions)]
    most = max(len(m.coefficients.ogden_alpha) for m in found)

    def number(k: int, m: Material) -> float:
        flat = np.ravel(ogden_terms(m.coefficients, m.shear_modulus))
        return float(flat[k]) if k < len(flat) else float(k % 2)

    cards = np.stack([scene.per_cell(partial(number, k)) for k in range(2 * most)], axis=1)
    cards[:, ::2] *= volumes
    return cards
