"""How far the links are to be trusted: linked backward, and on a pair whose links are known.

The known pair has the real particles before, moved as the links say (local quadratics, so that the
motion is smooth), with the noise that was found and a share lost on either side.
"""

from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from validate.arrays import Floats, Ints
from validate.compare.exhibit import Entry, NumberTable
from validate.papers.gel.pair import cloud, motion
from validate.recording.types import Recording
from validate.register.link import link
from validate.register.scattered import local_fit, noise

_LOST, _SMOOTH, _LAYERS = 0.05, 80, 5
_UM = 1e6


def checked_links(recording: Recording, files: tuple[Path, Path], voxel: float) -> NumberTable:
    """Shares of linked, of confirmed and of wrong links, layer by layer."""
    before, after = (cloud(path, voxel)[0] for path in files)
    x, u = motion(recording)
    rows, partners = (np.asarray(cKDTree(c).query(p)[1]) for c, p in ((before, x), (after, x + u)))
    back = dict(link(after, before).pairs.tolist())
    linked_back = np.array([back.get(j, -1) for j in partners])
    known, wrong, of = _known(before, x, u)
    edges = np.linspace(before[:, 2].min(), before[:, 2].max() + 1e-12, _LAYERS + 1)
    told: list[tuple[Entry, ...]] = []
    for a, b in [*pairwise(edges), (edges[0], edges[-1])]:
        layer = _between(x, a, b)
        theirs = _between(known, a, b)
        told.append((
            f"{_UM * a:.1f} to {_UM * b:.1f}", int(_between(before, a, b).sum()),
            _percent(layer.sum(), _between(before, a, b).sum()),
            _percent((linked_back == rows)[layer].sum(), layer.sum()),
            _percent(((linked_back != rows) & (linked_back >= 0))[layer].sum(), layer.sum()),
            _percent(theirs.sum(), _between(of, a, b).sum()),
            _percent(wrong[theirs].sum(), theirs.sum()),
        ))  # fmt: skip
    return NumberTable(
        "links", "Links, by height before",
        ("z (µm)", "particles (1)", "linked (%)", "found backward too (%)",
         "otherwise backward (%)", "known pair: linked (%)", "known pair: wrong (%)"),
        tuple(told),
        note="The known pair: these particles moved by the measured motion with its noise, "
             f"{_LOST:.0%} lost before and after; a particle of it can be linked where its "
             "partner is there.",
    )  # fmt: skip


def _known(before: Floats, x: Floats, u: Floats) -> tuple[Floats, NDArray[np.bool_], Floats]:
    """Places of linked particles of a known pair, which links are wrong, and the places of those
    that could be linked."""
    rng = np.random.default_rng(1)
    _, sd = noise(x, u)
    moved = before + local_fit(x, u, before, _SMOOTH, robust=True).values
    moved += sd * rng.standard_normal(before.shape)
    order = rng.permutation(np.flatnonzero(rng.random(len(before)) > _LOST))
    partner: Ints = np.full(len(before), -1)
    partner[order] = np.arange(len(order))
    kept = rng.random(len(before)) > _LOST
    one, partner = before[kept], partner[kept]
    pairs = link(one, moved[order]).pairs
    return one[pairs[:, 0]], partner[pairs[:, 0]] != pairs[:, 1], one[partner >= 0]


def _between(x: Floats, low: float, high: float) -> NDArray[np.bool_]:
    return np.asarray((x[:, 2] >= low) & (x[:, 2] < high))


def _percent(some: int, of: int) -> float | None:
    return round(100 * int(some) / int(of), 2) if of else None
