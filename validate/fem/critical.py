"""Modes and damping of a system; critical time step of central difference, and its bounds.

Sources: Lanczos (1950) on M^-1/2 K M^-1/2; paper 003, eq 16; Gershgorin's circles; the largest
element frequency (Irons & Treharne 1971), which bounds omega_max where masses add up by cells.

Departures: paper 003 trusts eq 16, which is no bound: on a regular mesh it allows steps above
2/omega_max, with slivers it is many times too small. It is reported, never recommended.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy import sparse
from scipy.linalg import eigh
from scipy.sparse.linalg import eigsh

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.assembly.assemble import lame_constants, shape_gradients
from validate.fem.laws.viscoelasticity import taut
from validate.fem.system import System, build, once
from validate.scene.material import Material
from validate.scene.scene import Scene

MatVec = Callable[[Floats], Floats]

PRODUCTS = 30  # of K with a vector; 15 to 20 settle most meshes, fewer overestimate the step
_FEWEST = 15
MARGIN = 0.08  # the limit falls as a body deforms: -17 % at a volume of 1.3
_BLOCK = 8192  # cells at a time


@dataclass(frozen=True)
class LanczosStep:
    """`limit` s is 2/omega_max as the products found it, from above; `safe` s lies below it.

    `safe` takes off the margin and what the products left open (the residual of the top value).
    """

    limit: float
    safe: float
    products: int


@dataclass(frozen=True)
class CriticalStep:
    """Steps s of central difference with lumped masses, undamped or with C of the last velocity.

    `lanczos` is the limit; `recommended` is what to use; `gershgorin` and, for linear cells,
    `element` are safe bounds; `eq_16_altitude` and `eq_16_edge` are paper 003's eq 16 with the
    least altitude and the shortest edge over the dilatational wave speed. `cell` limits the step.
    """

    lanczos: float
    recommended: float
    gershgorin: float
    element: float | None
    eq_16_altitude: float
    eq_16_edge: float
    cell: int
    altitude: float
    products: int

    @property
    def limited_by(self) -> str:
        """The cell that limits the step, for messages."""
        return f"cell {self.cell} (altitude {1e3 * self.altitude:.3g} mm) limits it"

    @classmethod
    def of(cls, system: System, *, products: int = PRODUCTS, margin: float = MARGIN) -> Self:
        """Return all limits of a system at rest, by its K and lumped masses, a viscoelastic one all
        taut.

        Raises `SceneError` for a missing density or settings out of range.
        """
        if any(m.prony.g for m in system.scene.materials):
            system = build(taut(system.scene))
        scene, free = system.scene, system.free
        K, masses = sparse.csr_array(system.K[free][:, free]), system.masses[free]
        found = cls.by_lanczos(lambda x: K @ x, masses, products=products, margin=margin)
        altitudes, c = cell_altitudes(scene), wave_speeds(scene)
        linear = scene.mesh.order == 1
        squares = element_frequencies(scene) ** 2 if linear else (c / altitudes) ** 2
        worst = int(np.argmax(squares))
        return cls(
            found.limit,
            found.safe,
            gershgorin_step(K, masses),
            2 / float(np.sqrt(squares[worst])) if linear else None,
            float((altitudes / c).min()),
            float((shortest_edges(scene) / c).min()),
            worst,
            float(altitudes[worst]),
            found.products,
        )

    @staticmethod
    def by_lanczos(
        apply: MatVec, masses: Floats, *, products: int = PRODUCTS, margin: float = MARGIN
    ) -> LanczosStep:
        """Return 2/omega_max of M^-1 K from products K x alone, x (m,), with diagonal masses (m,)
        kg.

        For a tangent at a deformed state as well. A negative tangent eigenvalue does not disturb
        it. Raises `SceneError` for fewer than 15 products or a margin outside 0..0.5.
        """
        if products < _FEWEST or not 0 <= margin <= 0.5:
            raise SceneError(
                f"{products} products, margin {margin:g}: expected at least {_FEWEST} products "
                "(fewer overestimate the step) and a margin in 0..0.5"
            )
        # Largest Ritz value 1/s^2 of scale K scale, its residual, and the products done
        scale = 1 / np.sqrt(masses)
        m = len(scale)
        q = np.random.default_rng(0).standard_normal(m)
        basis = np.zeros((min(products, m) + 1, m))
        basis[0] = q / np.linalg.norm(q)
        alphas: list[float] = []
        betas: list[float] = []
        for k in range(min(products, m)):
            w = scale * apply(scale * basis[k])
            alphas.append(float(basis[k] @ w))
            for _ in range(2):  # full orthogonalisation, twice: no ghosts
                w = w - basis[: k + 1].T @ (basis[: k + 1] @ w)
            betas.append(float(np.linalg.norm(w)))
            if betas[-1] <= 1e-12 * max(map(abs, alphas)):
                break
            basis[k + 1] = w / betas[-1]
        T = np.diag(alphas) + np.diag(betas[:-1], 1) + np.diag(betas[:-1], -1)
        values, vectors = np.linalg.eigh(T)
        top, open_part, done = (
            float(values[-1]),
            betas[-1] * abs(float(vectors[-1, -1])),
            len(alphas),
        )
        limit = 2 / float(np.sqrt(top))
        return LanczosStep(limit, (1 - margin) * 2 / float(np.sqrt(top + open_part)), done)


def gershgorin_step(K: sparse.csr_array, masses: Floats) -> float:
    """Return a safe step s: omega_max^2 <= max_i sum_j |K_ij| / m_i."""
    sums = np.asarray(abs(K).sum(axis=1)).ravel()
    return 2 / float(np.sqrt((sums / masses).max()))


def wave_speeds(scene: Scene) -> Floats:
    """Dilatational wave speed sqrt((lambda + 2 mu)/rho) m/s of every cell (e,)."""
    return np.sqrt(
        scene.per_cell(lambda m: m.bulk_modulus + 4 * m.shear_modulus / 3)
        / scene.per_cell(_density)
    )


def cell_altitudes(scene: Scene) -> Floats:
    """Least altitude m of every cell's corners (e,)."""
    return np.asarray(1 / np.linalg.norm(shape_gradients(scene.mesh), axis=2).max(axis=1))


def shortest_edges(scene: Scene) -> Floats:
    """Shortest edge m between corners of every cell (e,)."""
    x = scene.mesh.nodes[scene.mesh.corners]
    pairs = [(a, b) for b in range(x.shape[1]) for a in range(b)]
    lengths = [np.linalg.norm(x[:, a] - x[:, b], axis=1) for a, b in pairs]
    return np.asarray(np.min(lengths, axis=0))


def element_frequencies(scene: Scene) -> Floats:
    """Largest angular frequency 1/s of every free linear cell (e,) with a lumped mass.

    Of the strains' side, (d + 1)/rho B D B^T, which has the eigenvalues that are not zero.
    """
    mesh, d = scene.mesh, scene.mesh.dimension
    gradients = shape_gradients(mesh)
    (lam, mu), rho = lame_constants(scene), scene.per_cell(_density)
    squares = np.empty(len(gradients))
    for start in range(0, len(gradients), _BLOCK):
        part = slice(start, start + _BLOCK)
        B, D = _strain_rows(gradients[part]), _elasticity(lam[part], mu[part], d)
        root = np.linalg.cholesky(D)
        S = np.swapaxes(root, 1, 2) @ B @ np.swapaxes(B, 1, 2) @ root
        squares[part] = (d + 1) / rho[part] * np.linalg.eigvalsh(S)[:, -1]
    return np.sqrt(squares)


def _strain_rows(gradients: Floats) -> Floats:
    """B (e, s, (d + 1) d): strains, engineering shear, of nodal displacements."""
    e, nodes, d = gradients.shape
    shears = [(i, j) for j in range(d) for i in range(j)]
    B = np.zeros((e, d + len(shears), nodes, d))
    for i in range(d):
        B[:, i, :, i] = gradients[:, :, i]
    for s, (i, j) in enumerate(shears, start=d):
        B[:, s, :, i], B[:, s, :, j] = gradients[:, :, j], gradients[:, :, i]
    return B.reshape(e, d + len(shears), nodes * d)


def _elasticity(lam: Floats, mu: Floats, d: int) -> Floats:
    """D (e, s, s) Pa of Hooke's law; in 2-D of the plane state that lambda is for."""
    s = d + d * (d - 1) // 2
    normal = np.zeros(s)
    normal[:d] = 1
    weights = np.where(normal > 0, 2.0, 1.0)
    return np.asarray(
        lam[:, None, None] * np.outer(normal, normal) + mu[:, None, None] * np.diag(weights)
    )


def _density(m: Material) -> float:
    if m.rho is None:
        raise SceneError("a critical step needs the density; set rho kg/m3 of every material")
    return m.rho


# --- mode shapes, frequencies and damping ratios of a system: K phi = w^2 M phi ------------------

_CLUSTER = 1e-3  # relative distance of frequencies that are taken as one cluster
_COUPLED = 1e-8  # of the damping: rounding leaves 1e-12, other materials' damping far more
_DENSE = 1500  # free unknowns up to which all modes together are cheaper than some


@dataclass(frozen=True)
class Modes:
    """Shapes (m, r), M-orthonormal over the free unknowns, frequencies 1/s and dampings 1/s."""

    shapes: Floats
    omega: Floats
    damping: Floats

    @classmethod
    def of(cls, system: System, count: int | None = None) -> "Modes":
        """Return the lowest modes, with the whole of the last cluster of equal frequencies.

        They are kept with the system. Raises `SceneError` for more modes than unknowns or a C that
        they do not make diagonal.
        """
        return once(system, ("modes", count), lambda: _modes(system, count))


def _modes(system: System, count: int | None) -> Modes:
    free = system.free
    m = len(free)
    wanted = m if count is None else count
    if wanted > m:
        raise SceneError(f"{wanted} modes of {m} unknowns: expected at most {m}")
    K, M = (X[free][:, free] for X in (system.K, system.M))
    squares, shapes = lowest(K, M, wanted + max(8, wanted // 10))
    omega = np.sqrt(np.maximum(squares, 0.0))  # a body that is not held: 0 less rounding
    end = wanted
    while end < len(omega) and omega[end] <= omega[wanted - 1] * (1 + _CLUSTER):
        end += 1
    shapes, omega = np.ascontiguousarray(shapes[:, :end]), omega[:end]
    C = shapes.T @ (system.C[free][:, free] @ shapes)
    damping = np.diag(C).copy()
    if np.abs(C - np.diag(damping)).max() > _COUPLED * max(float(np.abs(C).max()), 1e-300):
        raise SceneError(
            "the damping couples the modes (regions damped differently); use Newmark, or the "
            "same mass_damping and stiffness_damping for all materials"
        )
    return Modes(shapes, omega, damping)


def lowest(K: sparse.csr_array, M: sparse.csr_array, count: int) -> tuple[Floats, Floats]:
    """Squares (r,) of the lowest frequencies and shapes (m, r), rising: `count`, or all where that
    is cheaper. K (m, m) N/m positive definite, M (m, m) kg."""
    m = K.shape[0]
    if m <= _DENSE or count >= m - 1:
        squares, shapes = eigh(K.toarray(), M.toarray())
    else:
        start = np.random.default_rng(0).standard_normal(m)
        squares, shapes = eigsh(K.tocsc(), k=count, M=M.tocsc(), sigma=0.0, which="LM", v0=start)
    order = np.argsort(squares)
    return np.asarray(squares)[order], np.asarray(shapes)[:, order]
