"""The cheapest closed path over a polar map, by dynamic programming."""

import numpy as np

from validate.arrays import Floats, Ints

_MOVES = 4  # largest change of the radius from ray to ray, grid steps


def closed_path(cost: Floats, stiffness: float) -> Ints:
    """Grid radius (n,) per ray that minimises the sum of cost (n, m) and stiffness * change^2.

    Exact for its start radius, which is that of the open path over one and a half turns.
    """
    n, quarter = len(cost), len(cost) // 4
    longer = np.concatenate([cost[n - quarter :], cost, cost[:quarter]])
    start = int(_open_path(longer, stiffness, None)[quarter])
    return _open_path(np.concatenate([cost, cost[:1]]), stiffness, start)[:n]


def _open_path(cost: Floats, stiffness: float, fixed: int | None) -> Ints:
    """The cheapest path over all rays; with `fixed` it starts and ends at that radius."""
    n, m = cost.shape
    penalty = stiffness * np.arange(-_MOVES, _MOVES + 1) ** 2
    total = cost[0].copy()
    if fixed is not None:
        total[:] = np.inf
        total[fixed] = cost[0, fixed]
    came = np.zeros((n, m), dtype=np.int64)
    padded = np.full(m + 2 * _MOVES, np.inf)
    window = np.lib.stride_tricks.sliding_window_view(padded, 2 * _MOVES + 1)
    for i in range(1, n):
        padded[_MOVES:-_MOVES] = total
        ways = window + penalty
        choice = ways.argmin(axis=1)
        came[i] = choice - _MOVES
        total = ways[np.arange(m), choice] + cost[i]
    path = np.empty(n, dtype=np.int64)
    path[-1] = int(total.argmin()) if fixed is None else fixed
    for i in range(n - 1, 0, -1):
        path[i - 1] = path[i] + came[i, path[i]]
    return path
