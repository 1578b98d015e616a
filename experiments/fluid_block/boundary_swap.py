"""Boundary swap of paper 000: force and displacement of an unknown change places.

For forces on all kept unknowns u = A f. An unknown whose displacement is given instead changes
places with its force by a principal pivot, a rank-one update of the dense matrix. Rounding adds up
over many pivots: it is measured on random states and, beyond a limit, the matrix is made afresh.
"""

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats, Ints
from validate.errors import SceneError

_EVERY = 64  # pivots between two measurements of the drift
_DRIFT = 1e-11  # of the largest displacement: beyond it the matrix is made afresh
_VANISHES = 1e-13  # of the unknown's own compliance: the others hold it already


class Swapped:
    """The mixed matrix T (m, m) of a compliance A (m, m) m/N: y = T x, where x is the force of an
    unknown that is free and the displacement of one that is `driven`, and y the other of the two.

    It changes in place: a tick has no time for copies. `pivots`, `refactorisations` and
    `worst_drift` say what was done.
    """

    def __init__(self, A: Floats, seed: int = 0) -> None:
        self.A, self.T = A, A.copy()
        self.driven: NDArray[np.bool_] = np.zeros(len(A), dtype=bool)
        self.pivots = self.refactorisations = 0
        self.worst_drift = 0.0
        self._random = np.random.default_rng(seed)

    def swap(self, unknown: int) -> None:
        """Give the unknown's displacement instead of its force, or its force again.

        Raises `SceneError` where the unknowns driven already hold it, or nothing moves it.
        """
        pivot = float(self.T[unknown, unknown])
        own = float(self.A[unknown, unknown])
        least = _VANISHES * (own if not self.driven[unknown] else 1 / own if own else np.inf)
        if not pivot > least:
            raise SceneError(
                f"unknown {unknown} cannot be driven: its compliance is {pivot:.1e} m/N "
                f"together with the driven unknowns, {own:.1e} m/N alone"
            )
        self._pivot(unknown)
        self.driven[unknown] = not self.driven[unknown]
        self.pivots += 1
        if self.pivots % _EVERY == 0 and self.drift() > _DRIFT:
            self.refactor()

    def _pivot(self, i: int) -> None:
        """The principal pivot of T at i, in place."""
        p, row = 1 / self.T[i, i], self.T[i].copy()
        column = self.T[:, i] * p
        self.T -= column[:, None] * row
        self.T[:, i], self.T[i] = column, -row * p
        self.T[i, i] = p

    def solve(self, given: Floats) -> tuple[Floats, Floats]:
        """Displacements (m,) m and forces (m,) N, from `given` (m,): m where driven, N else."""
        found = self.T @ given
        u = np.where(self.driven, given, found)
        return u, np.where(self.driven, found, given)

    def drift(self) -> float:
        """Return the largest |u - A f| over the largest |u| of a random state: what rounding has
        left."""
        given = self._random.standard_normal(len(self.A))
        size = np.sqrt(np.diag(self.A))
        given *= np.where(self.driven, size, np.divide(1, size, out=np.zeros_like(size),
                                                       where=size > 0))  # fmt: skip
        u, f = self.solve(given)
        scale = float(np.abs(u).max(initial=0.0))
        found = float(np.abs(u - self.A @ f).max(initial=0.0)) / scale if scale else 0.0
        self.worst_drift = max(self.worst_drift, found)
        return found

    def refactor(self) -> None:
        """T from A by one factorisation over what is driven."""
        self.T = mixed(self.A, np.flatnonzero(self.driven))
        self.refactorisations += 1


def mixed(A: Floats, driven: Ints) -> Floats:
    """Return the matrix of `Swapped` at once: [[A_ff - A_fd X, X^T], [-X, A_dd^-1]], X = A_dd^-1
    A_df."""
    T = A.copy()
    if not len(driven):
        return T
    rest = np.setdiff1d(np.arange(len(A)), driven)
    inverse = np.linalg.inv(A[np.ix_(driven, driven)])
    X = inverse @ A[np.ix_(driven, rest)]
    T[np.ix_(driven, driven)] = (inverse + inverse.T) / 2
    T[np.ix_(driven, rest)] = -X
    T[np.ix_(rest, driven)] = X.T
    T[np.ix_(rest, rest)] -= A[np.ix_(rest, driven)] @ X
    return T
