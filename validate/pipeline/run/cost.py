"""Computing time of a body's runs, estimated from its unknowns before a solve.

CPU time of one core of an AMD EPYC, of blocks of 1 000 to 47 000 unknowns (linear and
quadratic tetrahedra, hexahedra of 8 and 27 nodes): assembly goes with N, a factor in space with N^2
(George 1973). Elements differ by a factor of two to either side.
"""

from collections.abc import Sequence
from typing import TypeVar

from validate.fem.linear_solvers.factor import solvable_bytes
from validate.memory import free_memory

_Level = TypeVar("_Level")

#: Shares of the time of a first answer, s: the judged runs, the meshes of u_num, uncertain inputs.
RUNS, MESHES, INPUTS = 12.0, 16.0, 8.0
FEWEST_STATES = 8
#: Unknowns that cost as much as one of nodal mean dilatation, whose rows reach two cells far:
#: measured on blocks of 2 000 to 28 000 unknowns (2.7 times the time of other tetrahedra).
NODAL_MEAN = 1.75


def linear_seconds(unknowns: float) -> float:
    """Return the time s of one linear static solution with all its load steps."""
    return 2e-5 * unknowns + 1.6e-9 * unknowns**2


def newton_seconds(unknowns: float) -> float:
    """Return the time s of one load step at large strain, of two factorisations."""
    return 4e-5 * unknowns + 18e-9 * unknowns**2


def affordable(
    levels: Sequence[_Level], unknowns: Sequence[float], *, budget: bool
) -> tuple[_Level, ...]:
    """Return the levels of a mesh file whose systems fit into the memory and, where there is a
    `budget`, into the time of a first answer."""
    limit = MESHES if budget else None
    pairs = zip(levels, unknowns, strict=True)
    return tuple(level for level, N in pairs if fits(N, linear_seconds(N), limit))


def states_within(seconds: float, unknowns: float, wanted: int) -> int:
    """Return how many load steps at large strain fit, from `FEWEST_STATES` to `wanted`."""
    fit = int(seconds / newton_seconds(unknowns))
    return max(min(FEWEST_STATES, wanted), min(wanted, fit))


def fits(unknowns: float, seconds: float, limit: float | None) -> bool:
    """Return whether a system in space fits into the memory, and its run into the limit s."""
    free = free_memory()
    if free is not None and solvable_bytes(unknowns, 3) >= free:
        return False
    return limit is None or seconds <= limit
