"""Solvers of J x = b for many b and one J, the main cost of a step.

Iterative ones stop at a residual of `tolerance` |b|, which is no bound of the error: at 1e-6 the
solution of a soft, nearly incompressible body is off by 6e-6 to 3e-3.

Gauss-Seidel sweeps over a sparse matrix: compiled kernel, and plain loops as reference.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Protocol, runtime_checkable

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, cg, splu

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.fem.kernels.jit_cache import compiled
from validate.fem.linear_solvers.factor import factorise


def sweeps_loops(
    indptr: Ints, indices: Ints, data: Floats, b: Floats, x: Floats, count: int
) -> None:
    """`count` forward sweeps in place over x (m,) for A x = b; A in rows, its diagonal present."""
    for _ in range(count):
        for i in range(len(b)):
            rest, pivot = b[i], 1.0
            for k in range(indptr[i], indptr[i + 1]):
                j = indices[k]
                if j == i:
                    pivot = data[k]
                else:
                    rest -= data[k] * x[j]
            x[i] = rest / pivot


sweeps = compiled(nogil=True, error_model="numpy")(sweeps_loops)


SolverName = Literal[
    "prefactored",
    "gaussian_elimination",
    "dense_solve",
    "sparse_lu",
    "dense_inverse",
    "gauss_seidel",
    "cg",
]
TOLERANCE = 1e-6  # of the residual: with it paper 002's "several thousand" iterations come out
MAX_ITERATIONS = 100_000
_CHECKED = 10  # sweeps between two looks at the residual, which costs as much as a sweep
DENSE_LIMIT = 4000  # unknowns: 128 MB of matrix, and slower than the sparse factor long before


class Solver(Protocol):
    """`solve` takes b (m,) or (m, k)."""

    def solve(self, b: Floats) -> Floats: ...


@dataclass(frozen=True)
class Solved:
    """x (m,), the iterations it took, and whether the residual is small."""

    x: Floats
    iterations: int
    converged: bool


@runtime_checkable
class Iterative(Protocol):
    """A solver that starts from a guess."""

    def solve_from(self, b: Floats, guess: Floats) -> Solved: ...


@dataclass(frozen=True)
class GaussSeidel:
    """Forward sweeps in the order of the unknowns (paper 002, section VI)."""

    J: sparse.csr_array
    tolerance: float = TOLERANCE

    def solve(self, b: Floats) -> Floats:
        return _by_columns(self, b)

    @cached_property
    def _rows(self) -> tuple[Ints, Ints]:
        return self.J.indptr.astype(np.int64), self.J.indices.astype(np.int64)

    def solve_from(self, b: Floats, guess: Floats) -> Solved:
        """Iterations are counted in tens: the residual is looked at after every tenth sweep."""
        x, J, small = guess.copy(), self.J, self.tolerance * float(np.linalg.norm(b))
        done = 0
        while float(np.linalg.norm(b - J @ x)) > small:
            if done >= MAX_ITERATIONS:
                return Solved(x, done, False)
            sweeps(*self._rows, J.data, b, x, _CHECKED)
            done += _CHECKED
        return Solved(x, done, True)


@dataclass(frozen=True)
class ConjugateGradient:
    """Conjugate gradients with the diagonal as preconditioner."""

    J: sparse.csr_array
    tolerance: float = TOLERANCE

    def solve(self, b: Floats) -> Floats:
        return _by_columns(self, b)

    def solve_from(self, b: Floats, guess: Floats) -> Solved:
        done: list[int] = []
        scale = 1 / self.J.diagonal()
        by_diagonal = LinearOperator(self.J.shape, matvec=lambda r: scale * r, dtype=np.float64)
        x, left = cg(
            self.J, b, guess, rtol=self.tolerance, maxiter=MAX_ITERATIONS, M=by_diagonal,
            callback=lambda _: done.append(1),
        )  # fmt: skip
        return Solved(np.asarray(x), len(done), left == 0)


def _by_columns(solver: Iterative, b: Floats) -> Floats:
    columns = [solver.solve_from(c, np.zeros_like(c)) for c in np.atleast_2d(b.T)]
    if not all(s.converged for s in columns):
        raise SceneError(f"no solution in {MAX_ITERATIONS} iterations; use solver = prefactored")
    return np.stack([s.x for s in columns], axis=-1).reshape(b.shape)


@dataclass(frozen=True)
class Diagonal:
    """A diagonal J by the inverses (m,) of its entries."""

    inverse: Floats

    def solve(self, b: Floats) -> Floats:
        return (self.inverse * b.T).T


@dataclass(frozen=True)
class GaussianElimination:
    """Textbook elimination of the dense J (m, m), pivot by pivot, done anew at every solve.

    The baseline of paper 001 ("Gauss elimination"); no pivoting, J is positive definite.
    """

    J: Floats

    def solve(self, b: Floats) -> Floats:
        A, x = self.J.copy(), np.array(b, dtype=np.float64)
        m = len(A)
        for k in range(m):
            share = A[k + 1 :, k] / A[k, k]
            A[k + 1 :, k + 1 :] -= np.multiply.outer(share, A[k, k + 1 :])
            x[k + 1 :] -= np.multiply.outer(share, x[k])
        for k in reversed(range(m)):
            x[k] = (x[k] - A[k, k + 1 :] @ x[k + 1 :]) / A[k, k]
        return x


@dataclass(frozen=True)
class DenseSolve:
    """LAPACK's factorisation of the dense J at every solve."""

    J: Floats

    def solve(self, b: Floats) -> Floats:
        return np.asarray(np.linalg.solve(self.J, b))


@dataclass(frozen=True)
class SparseLU:
    """SuperLU's factorisation of J at every solve."""

    J: sparse.csc_array

    def solve(self, b: Floats) -> Floats:
        return np.asarray(splu(self.J).solve(b))


@dataclass(frozen=True)
class DenseInverse:
    """The inverse of J (m, m), made once; a solve is a product."""

    inverse: Floats

    def solve(self, b: Floats) -> Floats:
        return np.asarray(self.inverse @ b)


def solver_of(
    name: SolverName,
    J: sparse.csr_array,
    node: Ints,
    places: Floats,
    tolerance: float = TOLERANCE,
) -> Solver:
    """Return the solver by name; unknown i belongs to node `node[i]` at `places[node[i]]` m.

    Raises `SceneError` for a J that is not positive definite (the prefactored one sees it), or a
    dense one above 4000 unknowns.
    """
    if name == "prefactored":
        return factorise(J, node, places)
    if name == "sparse_lu":
        return SparseLU(sparse.csc_array(J))
    if name in ("gauss_seidel", "cg"):
        kind = GaussSeidel if name == "gauss_seidel" else ConjugateGradient
        return kind(J, tolerance)
    if J.shape[0] > DENSE_LIMIT:
        raise SceneError(
            f"{name} with {J.shape[0]} unknowns: a dense matrix may have at most "
            f"{DENSE_LIMIT}; use solver = prefactored"
        )
    dense = J.toarray()
    if name == "gaussian_elimination":
        return GaussianElimination(dense)
    return DenseSolve(dense) if name == "dense_solve" else DenseInverse(np.linalg.inv(dense))
