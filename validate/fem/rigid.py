"""Rigid-body motions of a supported body: rank of its constraints."""

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.scene.mesh import Mesh
from validate.scene.places import nodes_of
from validate.scene.scene import Scene

_FREE = 1e-14  # square of the rows, of the largest, under a motion that nothing holds
_SHOWN = 0.3  # share of a motion's largest component from which it is named


def require_held(scene: Scene, held: Ints, more: Floats | None = None, hint: str = "") -> None:
    """Raise `SceneError` that names the rigid motions that the unknowns `held` (h,), foundations
    and the rows `more` (m, N) leave free."""
    mesh = scene.mesh
    modes, words = rigid_motions(mesh)
    # Unknowns that foundations bind to the ground
    bedded = [
        int(node) * mesh.dimension + c
        for f in scene.foundations
        if f.stiffness > 0
        for node in nodes_of(mesh, f.facets)
        for c in f.components
    ]
    rows = [modes[held], modes[bedded]]
    if more is not None:
        rows.append(more @ modes)
    every = np.vstack([*rows, np.zeros((1, len(words)))])
    _, sizes, motions = np.linalg.svd(every.T @ every)
    loose = motions[sizes <= _FREE * max(float(sizes.max()), 1e-300)]
    if len(loose):
        share = np.abs(loose).max(axis=0)
        named = ", ".join(w for w, s in zip(words, share, strict=True) if s > _SHOWN * share.max())
        raise SceneError(
            f"the body can move rigidly in {len(loose)} of {len(words)} ways ({named}): "
            f"{len(held)} unknowns are held and its stiffness matrix is not positive "
            f"definite; add a support or pin{hint}"
        )


def rigid_motions(mesh: Mesh) -> tuple[Floats, tuple[str, ...]]:
    """Translations and rotations (N, 3 or 6) of the body's size, and their names."""
    d, n = mesh.dimension, len(mesh.nodes)
    x = (mesh.nodes - mesh.nodes.mean(axis=0)) / np.ptp(mesh.nodes, axis=0).max()
    planes = [(0, 1)] if d == 2 else [(1, 2), (2, 0), (0, 1)]
    modes = np.zeros((n, d, d + len(planes)))
    for c in range(d):
        modes[:, c, c] = 1.0
    for r, (i, j) in enumerate(planes):
        modes[:, i, d + r], modes[:, j, d + r] = -x[:, j], x[:, i]
    turns = ["z"] if d == 2 else list("xyz")
    words = (*(f"along {a}" for a in "xyz"[:d]), *(f"about {a}" for a in turns))
    return modes.reshape(n * d, -1), words
