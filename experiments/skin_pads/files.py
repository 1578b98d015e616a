"""The files of aflahelouneg/inverse_identification_soft_tissue as one recording.

A folder holds matrices of numbers: points and two marks per pad in pixels over the images, the
pad's displacement (mm) and force (no unit) on a clock of its own, some of the points once more in
mm, and a Gmsh script with the geometry. Nothing has a time stamp: images are paired with samples of
the force by how far the pads had come apart, and times are numbers of samples.

Files of points: x0.dat, y0.dat (k, 1) at rest, xt.dat, yt.dat (k, nt) in the images. Files of the
marks: the same with _ref_1 (moving pad) and _ref_2 (fixed pad). The marks are read as

1. a history, where they have as many states as the points;
2. named points of the field, where at rest they lie on points at its two edges (one mark a row or a
   column). The pads then follow these points;
3. not at all with `pads.follow=edges`: the pads follow the points at the two edges. The authors'
   second recording (bimaterial, with a keloid) needs this: its field is a grid from pad to pad, and
   its files of marks belong to the first recording.

Points that the pads follow are not compared. Two marks of a pad are 24 mm apart, which is the
scale; in cases 2 and 3 the scale is `pads.window`, or comes from points given in mm.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Literal

import numpy as np

from validate.arrays import Floats
from validate.errors import RecordingError
from validate.files import read_bytes, read_text
from validate.recording.types import Markers, Recording, Signal, Source

from .edge_points import Marks, Points, edges, named_points

FORCE = "force unit"  # that of the files is not known
Follow = Literal["marks", "edges"]
WINDOW = (
    24e-3  # m between the two marks of a pad, the extensometer's window in the authors' scripts
)
_LARGEST = 64_000_000  # bytes of a file of numbers
_POINTS = ("x0.dat", "y0.dat", "xt.dat", "yt.dat")
_MARKS = ("x0", "y0", "xt", "yt")
_GEO = {"L": "body.length", "H": "body.width", "l_pad": "body.pad_length",
        "h_pad": "body.pad_width", "dL_pad": "body.gap"}  # fmt: skip


@dataclass(frozen=True)
class Tracked:
    """Points (nt, k, 2) and middles of the two pads (nt, 2, 2), px, at rest first."""

    points: Floats
    pads: Floats
    window: float  # px between the outermost marks of a pad at rest
    window_m: float | None = None  # the same in m, where it is known
    followed: tuple[Points, Points] | None = None  # points that are the marks of the pads

    @property
    def compared(self) -> Points:
        """Numbers of the points that no pad follows."""
        every = np.arange(self.points.shape[1])
        return every if self.followed is None else np.setdiff1d(every, np.hstack(self.followed))

    @property
    def pulled(self) -> Floats:
        """How much further apart than at rest the pads are (nt,), px."""
        apart = np.linalg.norm(self.pads[:, 1] - self.pads[:, 0], axis=1)
        return np.asarray(apart - apart[0])


def read_folder(
    folder: Path,
    signs: tuple[float, float],
    follow: Follow = "marks",
    window: float | None = None,
) -> Recording:
    """The recording of a folder; `signs` of displacement and force make pulling apart positive.

    `follow`: whether the pads follow their marks or the points at the edges of the field; `window`
    m between the outermost marks of a pad at rest (None: 24 mm for two marks).

    Raises `RecordingError` for files that are missing, no numbers, or do not belong together, for
    pads that approach each other, and where no image can be paired.
    """
    seen = _tracked(folder, follow)
    u, f = (signs[i] * numbers(folder / name).ravel()
            for i, name in enumerate(("u_moving_pad.dat", "f_moving_pad.dat")))  # fmt: skip
    if len(u) != len(f) or len(u) < 20:
        raise RecordingError(
            f"{folder}: {len(u)} displacements, {len(f)} forces; 20 of both needed"
        )
    _require_apart(folder, u, f)
    scale, by = _scale(folder, seen, window)
    toe = _toe(folder, u)
    pulled = scale * seen.pulled
    t, matched = paired(folder, pulled, 1e-3 * u - toe)
    names = tuple(f"p{i + 1:04d}" for i in seen.compared)
    points, pads = (scale * x[: len(t)] for x in (seen.points[:, seen.compared], seen.pads))
    samples = np.arange(len(u), dtype=np.float64)
    return Recording(
        folder.name,
        _source(folder),
        0,
        markers={
            "points": Markers(t, names, points, jitter(points), "camera"),
            "pads": Markers(t, ("moving", "fixed"), pads, jitter(pads), "camera"),
        },
        signals={
            "displacement": Signal(samples, 1e-3 * u[:, None], "m", 0.0, "machine"),
            "force": Signal(samples, f[:, None], FORCE, jitter(f[:, None, None]), "machine"),
        },
        metadata={
            "pairing": {
                "images": f"{matched} of {len(pulled) - 1}",
                "by": "pad displacement; neither images nor force have time stamps",
                "times": "number of the force's sample, as seconds",
            },
            "scale": {"m_per_px": f"{scale:.8g}", "by": by},
            "zero": {"displacement_m": f"{toe:.8g}"},
            "geometry": _geometry(folder),
            **_followed(seen),
        },
    )


def _followed(seen: Tracked) -> Mapping[str, Mapping[str, str]]:
    if seen.followed is None:
        return {}
    moving, fixed = map(len, seen.followed)
    return {
        "pads": {
            "follow": f"{moving} and {fixed} edge points of the field, by their median; "
            "these points are not compared"
        }
    }


def numbers(path: Path) -> Floats:
    """A matrix (rows, columns) of finite numbers; raises `RecordingError` naming the file."""
    if not path.is_file():
        raise RecordingError(f"no {path.name} in {path.parent}; pass --set data=FOLDER with it")
    try:
        found = np.loadtxt(BytesIO(read_bytes(path, _LARGEST)), ndmin=2)
    except ValueError as error:
        raise RecordingError(f"{path.name}: no matrix of numbers ({error})"[:200]) from error
    if found.size == 0 or not np.isfinite(found).all():
        bad = int((~np.isfinite(found)).sum())
        raise RecordingError(f"{path.name}: {found.size} numbers, {bad} of them not finite")
    return np.asarray(found, dtype=np.float64)


def _tracked(folder: Path, follow: Follow) -> Tracked:
    """Read points and pads; raises `RecordingError` where the marks belong to other images."""
    points = _states("points", *(numbers(folder / name) for name in _POINTS))
    if follow == "edges":
        return _on_points(points, edges(points))
    files = [_oriented(*(numbers(folder / f"{a}_ref_{pad}.dat") for a in _MARKS)) for pad in (1, 2)]
    if all(1 + xt.shape[1] == len(points) for _, _, xt, _ in files):
        marks = [_states(f"marks of pad {pad}", *m) for pad, m in enumerate(files, start=1)]
        window = float(np.mean([np.linalg.norm(np.ptp(m[0], axis=0)) for m in marks]))
        two = all(m.shape[1] == 2 for m in marks)
        middle = np.stack([m.mean(axis=1) for m in marks], axis=1)
        return Tracked(points, middle, window, WINDOW if two else None)
    return _on_points(points, named_points(folder.name, points, files))


def _oriented(*files: Floats) -> Marks:
    """The files of a pad's marks with one mark a row; at rest they are a column or a row."""
    x0, y0, xt, yt = files
    if x0.shape[0] == 1 < x0.shape[1] == xt.shape[1]:
        return x0.T, y0.T, xt.T, yt.T
    return x0, y0, xt, yt


def _on_points(points: Floats, pads: tuple[Points, Points]) -> Tracked:
    """Pads that follow points of the field: by their median, as single points may be spurious."""
    rest = points[0]
    moved = [np.median(points[:, pad] - rest[pad], axis=1) for pad in pads]
    middle = [rest[pad].mean(axis=0) + m for pad, m in zip(pads, moved, strict=True)]
    window = float(np.mean([np.linalg.norm(np.ptp(rest[pad], axis=0)) for pad in pads]))
    return Tracked(points, np.stack(middle, axis=1), window, followed=pads)


def _states(what: str, x0: Floats, y0: Floats, xt: Floats, yt: Floats) -> Floats:
    """(1 + nt, k, 2) px of points at rest (k, 1) and in nt images (k, nt)."""
    if x0.shape != y0.shape or xt.shape != yt.shape or x0.shape != (len(xt), 1):
        shapes = [a.shape for a in (x0, y0, xt, yt)]
        raise RecordingError(f"{what}: files of shapes {shapes}; (k, 1) twice and (k, nt) twice")
    x, y = (np.hstack([a, b]) for a, b in ((x0, xt), (y0, yt)))
    return np.ascontiguousarray(np.stack([x, y], axis=2).swapaxes(0, 1))


def _require_apart(folder: Path, u: Floats, f: Floats) -> None:
    """Signs are declared, and tested: pulled apart, displacement and force both rise."""
    for name, y in (("displacement", u), ("force", f)):
        if np.median(y[-10:]) - np.median(y[:10]) <= 0:
            raise RecordingError(
                f"{folder.name}: the {name} goes from {np.median(y[:10]):.4g} to "
                f"{np.median(y[-10:]):.4g}; expected positive values as the pads separate: "
                f"pass --set signs.{name}=-1"
            )


def _scale(folder: Path, seen: Tracked, window: float | None) -> tuple[float, str]:
    """m per px from `window` m, else from points that the folder has in mm as well, else from the
    distance of two marks of a pad; raises `RecordingError` where none of these is known."""
    first = sorted(folder.glob("*xt_dic_0000.out")) if window is None else []
    if not first:
        length = seen.window_m if window is None else window
        if length is None or seen.window == 0:
            raise RecordingError(
                f"{folder.name}: no scale: the outermost marks of a pad are {seen.window:.1f} px "
                "apart, and no file has this length (only two marks of a pad are 24 mm apart): "
                "pass it with its unit, as in --set pads.window=8mm, or add the points in mm "
                "(processed_xt_dic_0000.out)"
            )
        by = "marks" if window is None else "pads.window: marks"
        return length / seen.window, f"{by} {1e3 * length:g} mm apart, {seen.window:.1f} px"
    mm = numbers(first[0])
    ratios = np.ptp(mm, axis=0) / np.ptp(seen.points[0], axis=0)
    if abs(ratios[0] / ratios[1] - 1) > 0.01:
        raise RecordingError(
            f"{first[0].name}: {ratios[0]:.5g} mm per px along x, {ratios[1]:.5g} along y; these "
            "are not the points of x0.dat and y0.dat"
        )
    return 1e-3 * float(ratios.mean()), f"{len(mm)} points given in mm, {first[0].name}"


def _toe(folder: Path, u: Floats) -> float:
    """m of displacement from which the authors count: where their own curve begins, else 0."""
    found = sorted(folder.glob("*ux_pad_mov.out"))
    return 1e-3 * float(u.max() - np.abs(numbers(found[0])).max()) if found else 0.0


def paired(folder: Path, pulled: Floats, d: Floats) -> tuple[Floats, int]:
    """Sample at which each state was reached, rest first, and how many images have one.

    `pulled` (nt,) m as the images have it, d (ns,) m as the machine has it, both from their zero.
    Raises `RecordingError` where no image can be paired.
    """
    reached, wanted = np.maximum.accumulate(d), np.maximum.accumulate(pulled)
    if pulled[-1] <= 0:
        raise RecordingError(
            f"{folder.name}: the pads come {-1e3 * pulled[-1]:.3g} mm nearer to each other in the "
            "images; pad 1 must be the one that moves away from pad 2"
        )
    inside = wanted <= reached[-1]
    matched = int(inside[1:].sum())
    if matched == 0:
        raise RecordingError(
            f"{folder.name}: 0 of {len(pulled) - 1} images matched: the pads are "
            f"{1e3 * pulled[1]:.3g} mm apart in the first and the machine ends at "
            f"{1e3 * reached[-1]:.3g} mm; check scale and unit"
        )
    return np.searchsorted(reached, wanted[inside]).astype(np.float64), matched


def jitter(x: Floats) -> float:
    """Noise sd of (nt, k, c) that moves smoothly, from second differences in time, robustly."""
    if len(x) < 3:
        return 0.0
    return float(1.4826 * np.median(np.abs(np.diff(x, 2, axis=0))) / np.sqrt(6))


def _geometry(folder: Path) -> Mapping[str, str]:
    """Lengths m of the Gmsh script by parameter; plain assignments alone are read."""
    scripts = sorted(folder.glob("*.geo"))
    if not scripts:
        return {}
    text = re.sub(r"//[^\n]*", "", read_text(scripts[0])[:100_000])
    found = dict(re.findall(r"\b(\w+)\s*=\s*([0-9.]+)\s*;", text))
    return {path: f"{1e-3 * float(found[n]):.9g}" for n, path in _GEO.items() if n in found}


def _source(folder: Path) -> Source:
    """The folder's hash is that of its files of numbers, by name."""
    whole, size = sha256(), 0
    for path in sorted((*folder.glob("*.dat"), *folder.glob("*.out"), *folder.glob("*.geo"))):
        content = read_bytes(path)
        whole.update(path.name.encode() + content)
        size += len(content)
    return Source(str(folder), whole.hexdigest(), size, "integrity cannot be verified: plain text")
