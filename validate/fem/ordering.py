"""Nested dissection of a mesh graph by coordinates: the elimination order that keeps fill low."""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from validate.arrays import Floats, Ints

_LEAF = 48  # nodes; below this the order within hardly matters


@dataclass(frozen=True)
class Dissection:
    """A permutation `order` (n,) of the nodes in parts: halves first, their separator last.

    Part i is `order[stops[i - 1]:stops[i]]` and separates `children[i]` parts (with all that those
    separate) before it from each other: a tree in postorder.
    """

    order: Ints
    stops: Ints
    children: tuple[int, ...]


def nested_dissection(graph: sparse.csr_array, places: Floats) -> Dissection:
    """Halves of the nodes, their halves, and so on.

    `graph` (n, n) links neighbouring nodes, `places` (n, d) m are their coordinates.
    Source: George (1973), with coordinate bisection.
    """
    side = np.zeros(len(places), dtype=np.int8)
    parts: list[tuple[Ints, int]] = []
    _dissect(graph, places, np.arange(len(places)), side, parts)
    order = np.concatenate([nodes for nodes, _ in parts])
    stops = np.cumsum([len(nodes) for nodes, _ in parts])
    return Dissection(order, stops, tuple(children for _, children in parts))


def _dissect(
    graph: sparse.csr_array,
    places: Floats,
    nodes: Ints,
    side: np.ndarray,
    parts: list[tuple[Ints, int]],
) -> None:
    if len(nodes) <= _LEAF:
        parts.append((nodes, 0))
        return
    low, high = _halves(places, nodes)
    separator = _touching(graph, low, high, side)
    halves = [half for half in (low[~separator], high) if len(half)]
    for half in halves:
        _dissect(graph, places, half, side, parts)
    parts.append((low[separator], len(halves)))


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
