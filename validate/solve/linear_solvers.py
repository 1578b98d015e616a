"""Ways to solve J x = b again and again for one J: what a step costs is mostly this choice."""

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.fem.factor import factorise

SolverName = Literal[
    "prefactored", "gaussian_elimination", "dense_solve", "sparse_lu", "dense_inverse"
]
DENSE_LIMIT = 4000  # unknowns: 128 MB of matrix, and slower than the sparse factor long before


class Solver(Protocol):
    """`solve` takes b (m,) or (m, k)."""

    def solve(self, b: Floats) -> Floats: ...


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


def solver_of(name: SolverName, J: sparse.csr_array, node: Ints, places: Floats) -> Solver:
    """The solver by name; unknown i belongs to node `node[i]` at `places[node[i]]` m.

    Raises `SceneError` for a J that is not positive definite (the prefactored one sees it), or a
    dense one above 4000 unknowns.
    """
    if name == "prefactored":
        return factorise(J, node, places)
    if name == "sparse_lu":
        return SparseLU(sparse.csc_array(J))
    if J.shape[0] > DENSE_LIMIT:
        raise SceneError(
            f"{name} with {J.shape[0]} unknowns: at most {DENSE_LIMIT} as a dense matrix; "
            "use solver = prefactored"
        )
    dense = J.toarray()
    if name == "gaussian_elimination":
        return GaussianElimination(dense)
    return DenseSolve(dense) if name == "dense_solve" else DenseInverse(np.linalg.inv(dense))
