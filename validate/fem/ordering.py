"""Nested dissection of a mesh graph by coordinates: the elimination order that keeps fill low."""

import numpy as np
from scipy import sparse

from validate.arrays import Floats, Ints

_LEAF = 48  # nodes; below this the order within hardly matters


def nested_dissection(graph: sparse.csr_array, places: Floats) -> Ints:
    """A permutation (n,) of the nodes: halves first, their separator last, recursively.

    `graph` (n, n) links neighbouring nodes, `places` (n, d) m are their coordinates.
    Source: George (1973), with coordinate bisection.
    """
    side = np.zeros(len(places), dtype=np.int8)
    order: list[Ints] = []
    _dissect(graph, places, np.arange(len(places)), side, order)
    return np.concatenate(order)


def _dissect(
    graph: sparse.csr_array, places: Floats, nodes: Ints, side: np.ndarray, order: list[Ints]
) -> None:
    if len(nodes) <= _LEAF:
        order.append(nodes)
        return
    low, high = _halves(places, nodes)
    separator = _touching(graph, low, high, side)
    inner = low[~separator]
    for part in (inner, high):
        if len(part):
            _dissect(graph, places, part, side, order)
    order.append(low[separator])


def _halves(places: Floats, nodes: Ints) -> tuple[Ints, Ints]:
    x = places[nodes]
    along = x[:, int(np.argmax(np.ptp(x, axis=0)))]
    ranks = np.argsort(along, kind="stable")
    half = len(nodes) // 2
    # Nodes level with the median stay together, so that a grid is cut along its own planes.
    below = along <= along[ranks[half - 1]]
    if below.all():
        below = np.zeros(len(nodes), dtype=bool)
        below[ranks[:half]] = True
    return nodes[below], nodes[~below]


def _touching(graph: sparse.csr_array, low: Ints, high: Ints, side: np.ndarray) -> np.ndarray:
    side[high] = 1
    rows = graph[low]
    hits = np.concatenate([[0], np.cumsum(side[rows.indices])])
    side[high] = 0
    return np.asarray(hits[rows.indptr[1:]] > hits[rows.indptr[:-1]])
