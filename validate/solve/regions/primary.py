"""Solvers of a region, and the primary region with a law of its own (paper 004).

What paper 004 names as future work. The body's own linear stiffness stays everywhere; the cells all
of whose free nodes are in the primary region add what their law has beyond it, r(u) = f(u) - K u.
Such cells touch no other region's nodes, so what regions show each other is as in the linear body.

A law at large strain is `fem.large_strain.hyperelastic`, with a Prony series
`fem.laws.viscoelasticity`. In the linear law the isochoric stress relaxes alike: r = sum of h_i,
dh_i/dt + h_i/tau_i = g_i K_iso du/dt, by the same recursion. K_iso is the stiffness less that of
its volume change, 2 K(kappa) - K(2 kappa).

Solvers of one region (paper 004, section 4): eqs 3, 5, 6 and the static one. All carry the
displacements u now and u- one period T before. The other regions enter by their displacements on
the right side (eq 7).

Departures: the definition of eq 3 is lost in the text we have. It is taken as (M/T^2 + C/2T + K) u+
= f + M/T^2 (2 u - u-) + C/2T u-, which gives the paper's whole-model peaks.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Literal, Protocol

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import eigsh

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.fem.assembly.assemble import stiffness
from validate.fem.large_strain.hyperelastic import Body
from validate.fem.laws.viscoelasticity import Branches, cell_branches, relaxed
from validate.fem.linear_solvers.factor import Factor, Fronts, factorise
from validate.scene.material import LawName, Material, Prony
from validate.scene.mesh import Mesh
from validate.scene.scene import Scene

SolverName = Literal["semi_implicit", "explicit", "euler", "static"]
EXPLICIT: tuple[SolverName, ...] = ("explicit", "euler")
_DENSE = 60  # unknowns below which Lanczos needs more vectors than there are


@dataclass(frozen=True)
class RegionMatrices:
    """K (m, m) N/m over the free unknowns, lumped masses m (m,) kg, damping c (m,) N s/m.

    Unknown i belongs to node `node[i]`, which rests at `places[node[i]]` m.
    """

    K: sparse.csr_array
    m: Floats
    c: Floats
    node: Ints
    places: Floats


class RegionSolver(Protocol):
    """`next` gives u+ (w,) from u, u- (w,) and forces (w,) less what the others' displacements
    bring; trailing columns are independent states."""

    def next(self, u: Floats, before: Floats, f: Floats) -> Floats: ...


def across(d: Floats, x: Floats) -> Floats:
    """d (w,) beside x (w,) or (w, q)."""
    return d if x.ndim == 1 else d[:, None]


@dataclass(frozen=True)
class SemiImplicit:
    """Eq 3; `inertia` M/T^2 and `damping` C/2T (w,). Static: both are zero."""

    factor: Factor | Fronts
    inertia: Floats
    damping: Floats

    def next(self, u: Floats, before: Floats, f: Floats) -> Floats:
        M, C = across(self.inertia, u), across(self.damping, u)
        return self.factor.solve(f + M * (2 * u - before) + C * before)


@dataclass(frozen=True)
class Explicit:
    """Eq 5 with its K (w, w), `half` c T / 2 m and `gain` T^2/m (w,)."""

    K: sparse.csr_array
    half: Floats
    gain: Floats

    def next(self, u: Floats, before: Floats, f: Floats) -> Floats:
        half, gain = across(self.half, u), across(self.gain, u)
        return np.asarray(u + ((1 - half) * (u - before) + gain * (f - self.K @ u)) / (1 + half))


@dataclass(frozen=True)
class ImplicitExplicit:
    """Eq 6: the new velocity from old forces, the new place from the new velocity."""

    K: sparse.csr_array
    half: Floats
    gain: Floats

    def next(self, u: Floats, before: Floats, f: Floats) -> Floats:
        half, gain = across(self.half, u), across(self.gain, u)
        return np.asarray(u + (1 - 2 * half) * (u - before) + gain * (f - self.K @ u))


def semi_implicit(body: RegionMatrices, at: Ints, T: Floats) -> SemiImplicit:
    """Eq 3 on the unknowns `at` (w,), each with its own period T (w,) s; infinite: static."""
    inertia, damping = body.m[at] / T**2, body.c[at] / (2 * T)
    A = sparse.csr_array(body.K[at][:, at] + sparse.diags_array(inertia + damping))
    return SemiImplicit(factorise(A, body.node[at], body.places), inertia, damping)


def solver_of(name: SolverName, body: RegionMatrices, at: Ints, T: float) -> RegionSolver:
    """Return the named solver of the unknowns `at` (w,), once every T s."""
    if name in ("semi_implicit", "static"):
        return semi_implicit(body, at, np.full(len(at), np.inf if name == "static" else T))
    kind = Explicit if name == "explicit" else ImplicitExplicit
    K = sparse.csr_array(body.K[at][:, at])
    return kind(K, body.c[at] * T / (2 * body.m[at]), T**2 / body.m[at])


def critical_period(
    name: SolverName, body: RegionMatrices, at: Ints, taut: sparse.csr_array | None = None
) -> float:
    """Return the longest stable T s of an explicit region whose neighbours stand still; else
    infinite.

    `taut` (w, w) N/m is what a law adds to K at once. Eq 5: 2/w, whatever the damping. Eq 6:
    w^2 T^2 + 2 (c/m) T = 4, with the largest c/m.
    """
    if name not in EXPLICIT:
        return np.inf
    root = sparse.diags_array(1 / np.sqrt(body.m[at]))
    K = body.K[at][:, at] if taut is None else body.K[at][:, at] + taut
    A = root @ K @ root
    if len(at) < _DENSE:
        square = float(np.linalg.eigvalsh(A.toarray())[-1])
    else:
        start = np.random.default_rng(0).standard_normal(len(at))
        square = float(eigsh(A, k=1, which="LA", v0=start, return_eigenvectors=False)[0])
    if name == "explicit":
        return float(2 / np.sqrt(square))
    c = float((body.c[at] / body.m[at]).max())
    return float(4 / (np.sqrt(c**2 + 4 * square) + c))


_CONTRACTION = 0.2  # of the residual, that keeps a factorisation
_ROUNDING = 1e-15  # of the cells' unit force
_TOLERANCE, _MOST, _HALVINGS = 1e-10, 25, 6  # of Newton in a step, and of a correction


class UnsettledError(SceneError):
    """A primary region that found no next step."""


class Response(Protocol):
    """Contribution of the cells to the linear body at an instant: forces (w,) N and tangent (w,
    w)."""

    def force(self, u: Floats) -> Floats: ...

    def tangent(self, u: Floats) -> sparse.csr_array: ...

    def inverted(self, u: Floats) -> bool: ...


class Beyond(Protocol):
    """A law beyond the linear one. `taut` (w, w) N/m is what it adds to the stiffness at once,
    `rounding` N how sure its forces are. `after` is how it answers dt s later, `advanced` what it
    remembers then."""

    @property
    def taut(self) -> sparse.csr_array | None: ...

    @property
    def rounding(self) -> float: ...

    def rest(self) -> Any: ...

    def after(self, memory: Any, dt: float) -> Response: ...

    def advanced(self, memory: Any, u: Floats, dt: float) -> Any: ...


# --- large strain ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class LargeStrainRegion:
    """`body` are the cells alone, whose unknowns `put` (w, s) among the region's; K (w, w) is their
    linear stiffness."""

    body: Body
    branches: Branches | None
    put: sparse.csr_array
    K: sparse.csr_array
    taut: sparse.csr_array | None = None

    @property
    def rounding(self) -> float:
        return _ROUNDING * self.body.unit_force

    def rest(self) -> Any:
        return self.branches.at_rest(self.body.weights.shape) if self.branches else None

    def after(self, memory: Any, dt: float) -> "LargeStrainRegion":
        if self.branches is None:
            return self
        return replace(self, body=self.body.after(self.branches, memory, dt))

    def advanced(self, memory: Any, u: Floats, dt: float) -> Any:
        if self.branches is None:
            return None
        return self.branches.advanced(memory, self.body.isochoric(self.put.T @ u), dt)

    def force(self, u: Floats) -> Floats:
        return np.asarray(self.put @ self.body.force(self.put.T @ u) - self.K @ u)

    def tangent(self, u: Floats) -> sparse.csr_array:
        own = self.put @ self.body.tangent(self.put.T @ u) @ self.put.T
        return sparse.csr_array(own - self.K)

    def inverted(self, u: Floats) -> bool:
        return not np.isfinite(u).all() or self.body.inverted(self.put.T @ u) is not None


# --- the linear law that relaxes ------------------------------------------------------------------


@dataclass(frozen=True)
class Relaxing:
    """K_iso (w, w) N/m, g and tau s (k,). It remembers K_iso u (w,) N and the branches' forces
    (k, w) N."""

    K_iso: sparse.csr_array
    g: Floats
    tau: Floats
    rounding: float = 0.0

    @property
    def taut(self) -> sparse.csr_array:
        return sparse.csr_array(float(self.g.sum()) * self.K_iso)

    def rest(self) -> tuple[Floats, Floats]:
        size = self.K_iso.shape[0]
        return np.zeros(size), np.zeros((len(self.g), size))

    def after(self, memory: tuple[Floats, Floats], dt: float) -> "Relaxed":
        s, h = memory
        decay, gain = Branches(self.g, self.tau).factors(dt)
        share = float(gain.sum())
        return Relaxed(self.K_iso, share, decay @ h - share * s)

    def advanced(
        self, memory: tuple[Floats, Floats], u: Floats, dt: float
    ) -> tuple[Floats, Floats]:
        s, h = memory
        decay, gain = Branches(self.g, self.tau).factors(dt)
        new = self.K_iso @ u
        return new, decay[:, None] * h + gain[:, None] * (new - s)


@dataclass(frozen=True)
class Relaxed:
    """share K_iso u + rest."""

    K_iso: sparse.csr_array
    share: float
    rest: Floats

    def force(self, u: Floats) -> Floats:
        return np.asarray(self.share * (self.K_iso @ u) + self.rest)

    def tangent(self, u: Floats) -> sparse.csr_array:
        return sparse.csr_array(self.share * self.K_iso)

    def inverted(self, u: Floats) -> bool:
        return False


# --- which cells ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class PrimaryLaw:
    """The law of a scene's primary region; `free` (m,) are the body's unknowns in the mesh."""

    scene: Scene
    free: Ints
    law: LawName
    prony: Prony

    def __post_init__(self) -> None:
        if self.scene.dilatation == "nodal_mean":
            raise SceneError(
                "nodal mean dilatation couples across the border of a primary region with a "
                "separate law; use pointwise or mixed dilatation"
            )
        if self.law == "linear" and self.scene.plane == "stress":
            raise SceneError(
                "in plane stress volumetric and isochoric stiffness cannot be separated, so "
                "relaxation is not possible; use plane strain or a body in 3-D"
            )
        if self.law != "linear" and self.prony.g and self.scene.mesh.dimension == 2:
            raise SceneError(
                f"'{self.law}' with a Prony series is for bodies in 3-D: take the linear law, or a "
                "3-D mesh"
            )
        self._of(self.scene)  # a law that cannot relax is refused before the first touch

    def _of(self, scene: Scene) -> Scene:
        """The scene with the primary region's law."""
        if self.law == "linear":
            return scene
        return _made(scene, lambda m: replace(m.of_law(self.law), prony=self.prony))

    def beyond(self, wide: Ints, own: Ints) -> Beyond | None:
        """On the unknowns `wide` (w,) of the body, of the mesh's nodes `own` (k,); None where these
        have no whole cell."""
        d, cells = self.scene.mesh.dimension, self.scene.mesh.cells
        outside = np.setdiff1d(self.free // d, own)
        touched = np.asarray(np.isin(cells, own).any(axis=1), dtype=np.bool_)
        inside = touched & ~np.isin(cells, outside).any(axis=1)
        if not inside.any():
            return None
        nodes = np.unique(cells[inside])
        # The scene's cells `inside` (e,) alone, without what acts on them
        mesh, numbers = self.scene.mesh, np.flatnonzero(inside)
        regions = tuple(
            replace(r, cells=np.flatnonzero(np.isin(numbers, r.cells))) for r in self.scene.regions
        )
        part = Scene(
            Mesh(mesh.nodes[nodes], np.searchsorted(nodes, mesh.cells[inside]), mesh.kind),
            self.scene.material, regions=tuple(r for r in regions if len(r.cells)),
            plane=self.scene.plane, thickness=self.scene.thickness,
            dilatation=self.scene.dilatation,
        )  # fmt: skip
        put = _put(nodes, d, self.free[wide])
        if self.law == "linear":
            twice = _made(part, lambda m: _stiffer(m, 2.0))
            K_iso = sparse.csr_array(put @ (2 * stiffness(part) - stiffness(twice)) @ put.T)
            return Relaxing(K_iso, np.array(self.prony.g), np.array(self.prony.tau))
        large = self._of(part)
        K = sparse.csr_array(put @ stiffness(part) @ put.T)
        return LargeStrainRegion(Body(relaxed(large)), cell_branches(large), put, K)


def _put(nodes: Ints, d: int, unknowns: Ints) -> sparse.csr_array:
    """(w, s): 1 where an unknown of the mesh is one of the nodes' components, in their order."""
    mine = (nodes[:, None] * d + np.arange(d)).ravel()
    columns = np.flatnonzero(np.isin(mine, unknowns))
    order = np.argsort(unknowns, kind="stable")
    rows = order[np.searchsorted(unknowns[order], mine[columns])]
    ones = np.ones(len(rows))
    return sparse.csr_array((ones, (rows, columns)), shape=(len(unknowns), len(mine)))


def _made(scene: Scene, of: Callable[[Material], Material]) -> Scene:
    regions = tuple(replace(r, material=of(r.material)) for r in scene.regions)
    return replace(scene, material=of(scene.material), regions=regions)


def _stiffer(m: Material, times: float) -> Material:
    """With so many times the bulk modulus and the same shear modulus."""
    mu, kappa = m.shear_modulus, times * m.bulk_modulus
    E, nu = 9 * kappa * mu / (3 * kappa + mu), (3 * kappa - 2 * mu) / (2 * (3 * kappa + mu))
    return replace(m, E=E, nu=nu)


# --- its steps ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class PrimarySolver:
    """A region's solver with a law beyond the linear one, once every T s; `walk` is its step.

    Explicit rules take the law's force where the region is; eq 3 and statics where it will be, by
    Newton's method on A u+ + r(u+) = the right side of the linear body.
    """

    base: RegionSolver
    law: Beyond
    T: float
    A: sparse.csr_array
    node: Ints
    places: Floats
    kept: list[Factor | Fronts] = field(default_factory=list)

    def next(self, u: Floats, before: Floats, f: Floats) -> Floats:
        """Return a step of a region that remembers nothing."""
        return self.walk(u, before, f, self.law.rest())[0]

    def walk(self, u: Floats, before: Floats, f: Floats, memory: Any) -> tuple[Floats, Any]:
        """u+ (w,) and what is remembered then. Raises `UnsettledError`."""
        if isinstance(self.base, SemiImplicit):
            new = self._settled(self.base, u, before, f, self.law.after(memory, self.T))
        else:
            new = self.base.next(u, before, f - self.law.after(memory, 0.0).force(u))
        if self.law.after(memory, self.T).inverted(new):
            raise UnsettledError("the primary region has inverted cells; take a smaller dt")
        return new, self.law.advanced(memory, new, self.T)

    def _settled(
        self, base: SemiImplicit, u: Floats, before: Floats, f: Floats, law: Response
    ) -> Floats:
        right = f + base.inertia * (2 * u - before) + base.damping * before
        new, last = u, np.inf
        for _ in range(_MOST):
            parts = (self.A @ new, law.force(new), -right)
            residual = np.sum(parts, axis=0)
            size, acting = float(np.linalg.norm(residual)), sum(map(np.linalg.norm, parts))
            if size <= _TOLERANCE * acting + self.law.rounding:
                return new
            # The last factorisation, as long as it shrinks the residual (Shamanskii 1967)
            if size > _CONTRACTION * last or not self.kept:
                J = sparse.csr_array(self.A + law.tangent(new))
                self.kept[:] = [factorise(J, self.node, self.places)]
            new, last = self._corrected(new, self.kept[0].solve(residual), law), size
        raise UnsettledError(
            f"no equilibrium of the primary region after {_MOST} Newton iterations"
        )

    def _corrected(self, u: Floats, step: Floats, law: Response) -> Floats:
        for halved in range(_HALVINGS + 1):
            new = u - step / 2**halved
            if not law.inverted(new):
                return np.asarray(new)
        raise UnsettledError(
            f"a Newton correction inverts cells even at 1/{2**_HALVINGS} of its size"
        )


def primary_solver(
    base: RegionSolver, law: Beyond, body: RegionMatrices, wide: Ints, T: float
) -> PrimarySolver:
    """`base` on the unknowns `wide` (w,) of the body, with the law."""
    A = sparse.csr_array(body.K[wide][:, wide])
    if isinstance(base, SemiImplicit):
        A = sparse.csr_array(A + sparse.diags_array(base.inertia + base.damping))
    return PrimarySolver(base, law, T, A, body.node[wide], body.places)
