"""Solvers of one region (paper 004, section 4): eqs 3, 5, 6 and the static one.

All carry the displacements u now and u- one period T before. The other regions enter by their
displacements on the right side (eq 7).

Departures: the definition of eq 3 is lost in the text we have. It is taken as
(M/T^2 + C/2T + K) u+ = f + M/T^2 (2 u - u-) + C/2T u-, which gives the paper's whole-model peaks.
"""

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import eigsh

from validate.arrays import Floats, Ints
from validate.fem.linear_solvers.factor import Factor, factorise
from validate.fem.linear_solvers.frontal import Fronts

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
