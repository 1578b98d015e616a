"""How much memory a system takes, before it is taken, from its unknowns and its dimension.

Nested dissection of a mesh in space leaves O(N^(4/3)) entries, in the plane O(N log N): George
(1973), "Nested dissection of a regular finite element mesh". The numbers before them were measured
as peaks of blocks of 2 000 to 64 000 unknowns in space (P1 and P2: 252 to 317 and 296 to 635 bytes,
thin plates 140) and 2 000 to 116 000 in the plane (84 to 107): docs/conventions.md.
"""

import math

from validate.memory import free_memory, require_memory

_SPACE, _PLANE = 300.0, 100.0  # bytes of a factor per N^(4/3), N log2 N
_ASSEMBLED = {2: 2e3, 3: 13e3}  # bytes an unknown while K is assembled
_BOTH = 2.0  # L and U, where pivots of either sign are kept apart


def factor_bytes(unknowns: float, dimension: int, *, indefinite: bool = False) -> float:
    """Of a factorisation at its peak; one of a tangent that may be indefinite keeps two halves."""
    N = max(unknowns, 2.0)
    once = _SPACE * N ** (4 / 3) if dimension == 3 else _PLANE * N * math.log2(N)
    return _BOTH * once if indefinite else once


def next_to_nothing(unknowns: float, dimension: int) -> bool:
    """Whether a system a hundred times as large in memory would fit, too."""
    free = free_memory()
    return free is None or 100 * solvable_bytes(unknowns, dimension) < free


def require_solvable(unknowns: float, dimension: int, what: str) -> None:
    """Raises `MemoryShortError` where a system of so many unknowns does not fit, assembled or
    factored: asked before a mesh of a ladder is made."""
    needed = solvable_bytes(unknowns, dimension)
    require_memory(needed, f"{what} with up to {unknowns:.3g} unknowns in {dimension}-D")


def solvable_bytes(unknowns: float, dimension: int) -> float:
    """The larger of assembly and factor: the two do not peak at once."""
    return max(_ASSEMBLED[dimension] * unknowns, factor_bytes(unknowns, dimension))


def require_assembly(unknowns: float, dimension: int) -> None:
    """Raises `MemoryShortError` where the stiffness of so many unknowns does not fit."""
    require_memory(_ASSEMBLED[dimension] * unknowns, f"assembly of {unknowns:.4g} unknowns")


def require_factor(unknowns: float, dimension: int, *, indefinite: bool = False) -> None:
    """Raises `MemoryShortError` where the factor of so many unknowns does not fit."""
    needed = factor_bytes(unknowns, dimension, indefinite=indefinite)
    require_memory(needed, f"factor of {unknowns:.4g} unknowns in {dimension}-D")
