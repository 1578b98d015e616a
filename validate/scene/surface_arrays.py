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
from validate.scene.meshio_arrays import read_quietly

_SAME = 1e-7  # of the body's size: corners of triangles that are one point
_MOST = 2_000_000  # triangles
_SECONDS = 4  # for reading, and one more for each MB


def arrays(path: Path, edge: float = 0.0) -> dict[str, NDArray[Any]]:
    """Points (n, 3) and cells (e, 4) of edges of about `edge` (0: a twentieth of the body's
    diagonal), in the surface's own unit; `open` and `triangles` of the surface.

    Raises `SceneError` for a surface that is not closed: what is inside is then anybody's guess.
    """
    from pytetwild.pytetwild import tetrahedralize

    points, triangles = _joined(*_surface(path))
    loose = _open_edges(triangles)
    if loose or not len(triangles):
        raise SceneError(
            f"{loose} open or doubled edges in {len(triangles)} triangles: the surface is not "
            "closed; repair it first"
        )
    with TemporaryDirectory(prefix="validate-") as folder, chdir(folder):  # it leaves files there
        nodes, cells = tetrahedralize(
            points, triangles.astype(np.int32), edge_length_abs=edge or None, num_threads=1,
            quiet=True,
        )  # fmt: skip
    return {
        "points": np.asarray(nodes, dtype=np.float64),
        "cells.tetra": np.asarray(cells, dtype=np.int64),
        "triangles": np.array(len(triangles)),
        "enclosed": np.array(_enclosed(points, triangles)),
    }


def _surface(path: Path) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    with _within(_SECONDS + path.stat().st_size // 2**20):
        mesh = read_quietly(path, path.name)
    found = [np.asarray(b.data) for b in mesh.cells if b.type == "triangle"]
    found += [np.vstack([b.data[:, [0, 1, 2]], b.data[:, [0, 2, 3]]])
              for b in mesh.cells if b.type == "quad"]  # fmt: skip
    if not found:
        raise SceneError("no triangles in it: no surface")
    triangles = np.vstack(found).astype(np.int64)
    if len(triangles) > _MOST:
        raise SceneError(f"{len(triangles)} triangles, the limit is {_MOST}; simplify it")
    return np.asarray(mesh.points, dtype=np.float64), triangles


@contextmanager
def _within(seconds: int) -> Iterator[None]:
    """Ends a reader that hangs, as some do on a cut file; meshing may take longer."""

    def late(*_: object) -> None:
        raise SceneError(f"its reader took over {seconds} s: cut or damaged")

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


def _open_edges(triangles: NDArray[np.int64]) -> int:
    """How many edges do not belong to two triangles."""
    ends = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    _, counts = np.unique(ends, axis=0, return_counts=True)
    return int((counts != 2).sum())


def _enclosed(points: NDArray[np.float64], triangles: NDArray[np.int64]) -> float:
    """Volume inside the surface, by the divergence theorem."""
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    return float(abs(np.einsum("ij,ij->", a, np.cross(b, c))) / 6)
