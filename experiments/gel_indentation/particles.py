"""Two clouds of particles as one recording: files, scale, links, and checks of the links.

Links are checked backward, and on a pair whose links are known: the real particles before, moved
as the links say (local quadratics, so that the motion is smooth), with the noise that was found and
a share lost on either side.
"""

import re
from functools import lru_cache
from hashlib import sha256
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from validate.arrays import Floats, Ints
from validate.compare.exhibit import Entry, NumberTable
from validate.datasets.home import data_path, data_set_of
from validate.errors import RecordingError, UsageError
from validate.files import read_text
from validate.recording.reader import source_of
from validate.recording.readers import recognised
from validate.recording.types import Markers, Recording, Source

from .particle_linking import Linked, link, local_fit, noise

FOLDER = "field/gel-indentation"
STREAM = "particles"
_KNOWN = 0.4e-6  # m, side of a voxel of the registered pair, as its source says
_SAYS = re.compile(r"([\d.]+(?:e-?\d+)?)\s*([uµ]m|mm|nm)\s+per\s+(?:pixel|px|voxel)", re.IGNORECASE)
_UNITS = {"um": 1e-6, "µm": 1e-6, "mm": 1e-3, "nm": 1e-9}


def files(data: str | None, names: tuple[str | None, str | None], home: Path) -> tuple[Path, Path]:
    """Before and after: the files named, or the two *.mat files of the folder by their names.

    Raises `RecordingError` for a folder that is not there or holds another number of them.
    """
    folder = data_path(FOLDER, None, home, data)
    there = sorted(p for p in folder.iterdir() if p.suffix.lower() == ".mat")
    given = tuple(folder / n for n in names if n)
    if len(given) == 1 or (not given and len(there) != 2):
        raise RecordingError(
            f"{folder}: {len(there)} MATLAB files; a pair is needed: choose it, --set "
            "before=A.mat --set after=B.mat"
        )
    one, other = given or there
    return one, other


def side_of(voxel: float | None, before: Path) -> float:
    """Metres in a pixel: what is set, what a SOURCE.txt beside the file says, or what is known of
    the registered files. Raises `UsageError` where nobody says it."""
    if voxel is not None:
        return voxel
    text = before.parent / "SOURCE.txt"
    said = _SAYS.search(read_text(text)) if text.is_file() else None
    if said:
        return float(said[1]) * _UNITS[said[2].lower()]
    mark = source_of(before, "").sha256
    if any(mark == f.sha256 for f in data_set_of(FOLDER).files):
        return _KNOWN
    raise UsageError(
        f"{before.name} is in pixels of unknown size; measure it and pass --set voxel=0.4um"
    )


@lru_cache(maxsize=2)
def linked_pair(before: Path, after: Path, voxel: float) -> Recording:
    """Linked particles at 0 s (before) and 1 s (after: the instants have no times), m, with counts
    in the record `linking`. What `link` and the reader raise."""
    clouds = [cloud(path, voxel) for path in (before, after)]
    links = link(clouds[0][0], clouds[1][0])
    x = np.stack([cloud[links.pairs[:, k]] for k, (cloud, _) in enumerate(clouds)])
    sources = [source for _, source in clouds]
    markers = Markers(
        np.array([0.0, 1.0]), tuple(str(i + 1) for i in links.pairs[:, 0]), x, 0.0, "volume"
    )
    return Recording(
        name=f"{before.stem} to {after.stem}",
        source=Source(
            f"{before.name}, {after.name}",
            sha256("".join(s.sha256 for s in sources).encode()).hexdigest(),
            sum(s.bytes for s in sources),
            sources[0].integrity,
        ),
        t0_ns=0,
        markers={STREAM: markers},
        metadata={"linking": _told(links, len(clouds[0][0]), len(clouds[1][0]), voxel)},
    )


def cloud(path: Path, voxel: float) -> tuple[Floats, Source]:
    recording = recognised(path).read(path, {"unit": repr(voxel)})
    if len(recording.markers) != 1:
        raise RecordingError(f"{path.name}: {len(recording.markers)} clouds of points, one needed")
    (points,) = recording.markers.values()
    if points.x.shape[2] != 3:
        raise RecordingError(f"{path.name}: points in {points.x.shape[2]} dimensions, 3 needed")
    x = points.x[0]
    return x[np.isfinite(x).all(axis=1)], recording.source


def _told(links: Linked, before: int, after: int, voxel: float) -> dict[str, str]:
    return {
        "before": str(before),
        "after": str(after),
        "linked": str(len(links.pairs)),
        "seeds": str(links.seeds),
        "outliers_cut": str(links.cut),
        "spacing_m": repr(links.spacing),
        "voxel_m": repr(voxel),
    }


def motion(recording: Recording) -> tuple[Floats, Floats]:
    """Places before (n, 3) m of the linked particles, and their displacements (n, 3) m."""
    x = recording.marker(STREAM).x
    return x[0], x[1] - x[0]


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
