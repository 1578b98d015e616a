"""A force between the answers of a slower simulation: the polynomial through the last of them.

Paper 003, section 3.5, names "force extrapolation" for tissues too large for 1 kHz and leaves the
rule to others. Of order p (0 held, 1 linear, 2 quadratic) it is exact for a force that is such a
polynomial of time, and else off by f^(p+1) times the distances in time over (p+1)!.
"""

from typing import Literal, get_args

import numpy as np

from validate.arrays import Floats
from validate.errors import UsageError

Extrapolation = Literal["hold", "linear", "quadratic"]
NAMES: tuple[Extrapolation, ...] = get_args(Extrapolation)


def answers_of(name: Extrapolation) -> int:
    """How many of the last answers it takes; as long as there are fewer, those that are there."""
    return NAMES.index(name) + 1


def extrapolated(t: Floats, y: Floats, at: float) -> Floats:
    """The polynomial through y (m, d) at distinct times t (m,) s, at the time `at` s: (d,)."""
    return np.asarray(_weights(t, at) @ y)


def _weights(t: Floats, at: float) -> Floats:
    """Lagrange's, (m,); they add up to one."""
    apart = t[:, None] - t
    np.fill_diagonal(apart, 1.0)
    beyond = np.tile(at - t, (len(t), 1))
    np.fill_diagonal(beyond, 1.0)
    return np.asarray((beyond / apart).prod(axis=1))


def between_answers(y: Floats, every: int, late: int, name: Extrapolation) -> Floats:
    """What ticks 0, 1, .. give of a force y (nt, d) that is read at every so many of them and
    answered `late` ticks after; the first answer stands before it is there.

    Raises `UsageError` for an answer that is later than the next reading.
    """
    require_schedule(every, late)
    given, most = np.empty_like(y), answers_of(name)
    for k in range(len(y)):
        last = max(k - late, 0) // every
        read = every * np.arange(max(0, last + 1 - most), last + 1)
        given[k] = extrapolated(read.astype(np.float64), y[read], float(k))
    return given


def require_schedule(every: int, late: int) -> None:
    """Raises `UsageError` for ticks between readings and of answers that do not fit."""
    if not (every >= 1 and 0 <= late <= every):
        raise UsageError(
            f"a reading every {every} ticks that is answered {late} ticks later: expected at "
            "least 1, and an answer no later than the next reading"
        )
