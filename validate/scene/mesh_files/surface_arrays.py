"""Closed surfaces (STL, OBJ, PLY) filled with tetrahedra. The only file that imports pytetwild."""

import signal
from collections.abc import Iterator
from contextlib import chdir, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.errors import SceneError

LIBRARIES = ("pytetwild.pytetwild", "trimesh")
_SAME = 1e-7  # of the body's size: corners of triangles that are one point
_MOST = 2_000_000  # triangles
ENVELOPE = 1e-3  # of the diagonal: how far the filled body's surface may lie off
_SECONDS = 4  # for reading, and one more for each MB


def arrays(path: Path, edge: float = 0.0, within: float = ENVELOPE) -> dict[str, NDArray[Any]]:
    """Points (n, 3) and cells (e, 4) of edges of about `edge` (0: a twentieth of the body's
    diagonal), in the surface's own unit; `open` and `triangles` of the surface.

    The filled body's surface lies `within` that share of the diagonal.

    Raises `SceneError` for a surface that is not closed: what is inside is then anybody's guess.
    """
    from pytetwild.pytetwild import tetrahedralize

    points, triangles = _joined(*_surface(path))
    # How many edges do not belong to two triangles.
    ends = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    _, counts = np.unique(ends, axis=0, return_counts=True)
    loose = int((counts != 2).sum())
    if loose or not len(triangles):
        raise SceneError(
            f"{loose} open or doubled edges in {len(triangles)} triangles: the surface is not "
            "closed; repair it first"
        )
    triangles, turned = _oriented(points, triangles)
    with TemporaryDirectory(prefix="validate-") as folder, chdir(folder):  # it leaves files there
        nodes, cells = tetrahedralize(
            points, triangles.astype(np.int32), edge_length_abs=edge or None, epsilon=within,
            num_threads=1, quiet=True,
        )  # fmt: skip
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    return {
        "points": np.asarray(nodes, dtype=np.float64),
        "cells.tetra": np.asarray(cells, dtype=np.int64),
        "triangles": np.array(len(triangles)),
        "turned": np.array(turned),
        "enclosed": np.array(_signed_volume(points, triangles)),
        "may_differ": np.array(
            (float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()) / 2)
            * within
            * float(np.linalg.norm(np.ptp(points, axis=0)))
        ),
    }


def _surface(path: Path) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Corners and triangles, as the file has them; what it says of looks is left out."""
    import trimesh

    with _within(_SECONDS + path.stat().st_size // 2**20):
        mesh = trimesh.load_mesh(path, process=False, skip_materials=True)
    triangles = np.asarray(getattr(mesh, "faces", ()), dtype=np.int64).reshape(-1, 3)
    if not len(triangles):
        raise SceneError("the file has no triangles, so it is not a surface")
    if len(triangles) > _MOST:
        raise SceneError(f"{len(triangles)} triangles, the limit is {_MOST}; simplify it")
    points = np.asarray(mesh.vertices, dtype=np.float64)
    if not np.isfinite(points).all():
        raise SceneError(
            f"{int((~np.isfinite(points)).sum())} coordinates are not numbers; the file is damaged"
        )
    return points, triangles


@contextmanager
def _within(seconds: int) -> Iterator[None]:
    """Ends a reader that hangs, as some do on a cut file; meshing may take longer."""

    def late(*_: object) -> None:
        raise SceneError(f"its reader took over {seconds} s; the file is truncated or damaged")

    signal.signal(signal.SIGALRM, late)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)


def _joined(
    points: NDArray[np.float64], triangles: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Points once each, as STL has them once a triangle; triangles without an area are dropped."""
    grid = _SAME * float(np.ptp(points, axis=0).max())
    key = np.rint(points / max(grid, 1e-300)).astype(np.int64)
    _, first, again = np.unique(key, axis=0, return_index=True, return_inverse=True)
    joined = again.ravel()[triangles]
    flat = (joined == np.roll(joined, 1, axis=1)).any(axis=1)
    return points[first], joined[~flat]


def _oriented(
    points: NDArray[np.float64], triangles: NDArray[np.int64]
) -> tuple[NDArray[np.int64], int]:
    """Triangles of a closed surface all the same way round, the outside out, and how many were not.

    Neighbours run along their common edge in opposite ways. Of each shell the greater part stays as
    it is, so that the walls of a void still point into it.
    """
    # Which triangles (t,) run against the greater part of their shell.
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    edges = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    order = np.lexsort(np.sort(edges, axis=1).T).reshape(-1, 2)  # every edge has two triangles
    ends, (one, other) = edges[order, 0], (order // 3).T
    against = ends[:, 0] == ends[:, 1]
    # Each triangle twice, one way and the other: what can be reached is the same way round.
    n = len(triangles)
    to = np.where(against, other + n, other), np.where(against, other, other + n)
    rows, columns = np.concatenate([one, one + n]), np.concatenate(to)
    reach = coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(2 * n, 2 * n))
    _, labels = connected_components(reach, directed=False)
    first = np.minimum(labels[:n], labels[n:])  # a shell's name
    wrong = labels[:n] != first
    share = np.bincount(first, wrong) / np.maximum(np.bincount(first), 1)
    wrong = np.asarray(np.where(share[first] > 0.5, ~wrong, wrong))
    if _signed_volume(points, _turned(triangles, wrong)) < 0:
        wrong = ~wrong
    return _turned(triangles, wrong), int(wrong.sum())


def _turned(triangles: NDArray[np.int64], which: NDArray[np.bool_]) -> NDArray[np.int64]:
    return np.where(which[:, None], triangles[:, ::-1], triangles)


def _signed_volume(points: NDArray[np.float64], triangles: NDArray[np.int64]) -> float:
    """Volume inside the surface, by the divergence theorem; below 0 where the inside is out."""
    a, b, c = np.moveaxis(points[triangles] - points[0], 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)
