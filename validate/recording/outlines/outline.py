"""Outline of an anechoic inclusion in a B-mode image or along a sequence, or why there is none.

No grey level is set by hand. A rough disc is found by comparing discs with the sectors around them
(`polar.candidates`), unless a centre and radius are given. The wall is the closed path in polar
coordinates that best parts two kinds of speckle (`polar.trace`). It is then moved to where half of
the power is left (`polar.placed`) and judged (`quality`). Refusals rest on numbers that do not
depend on the grey scale: overlap of the grey levels, evidence in nats, share of the wall that is
closed or lies outside the image.

Limits: the region must be star-shaped about its centroid; regions under about 20 speckles are lost.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import floor
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.optimize import least_squares

from validate.arrays import Floats, checked, rms
from validate.errors import RecordingError
from validate.recording.images.image import ellipse_through
from validate.recording.outlines.polar import (
    ANGLES,
    DIRECTIONS,
    RAYS,
    Grey,
    Wall,
    candidates,
    placed,
    scanned,
    speckle_area,
    trace,
)
from validate.recording.types import Contours, Frames

# --- Is a traced path the wall of a closed dark region, and how well is it known?

SD_NOISE = 1.2  # wall error / (speckle size / contrast), measured on twins
SD_BIAS = 0.2  # what is left of the wall error where contrast is high / speckle size
_SECTOR = 20.0  # deg of the wall that are judged together


@dataclass(frozen=True)
class Quality:
    """gcnr 0..1 of inside against surroundings, closed share of the wall 0..1."""

    gcnr: float
    closed: float


def quality(grey: Grey, wall: Wall) -> Quality:
    """Return the contrast of a path between dark and bright.

    gcnr is 1 - overlap of the two grey level distributions (generalised contrast-to-noise ratio,
    Rodriguez-Molares et al. 2020): 0 for alike, 1 for apart, whatever the grey scale. `closed` is
    the share of the wall whose own surroundings (20 deg of them) are brighter than the inside by
    at least a third of the outline's median contrast.
    """
    within, beside = (_band(grey, wall, *span) for span in ((0.1, 0.85), (1.1, 1.5)))
    values = beside[0]
    seen = ~np.isnan(values)
    width = _SECTOR / 360 * RAYS / 2
    total = gaussian_filter1d(np.where(seen, values, 0).sum(axis=1), width, mode="wrap")
    count = gaussian_filter1d(seen.sum(axis=1).astype(float), width, mode="wrap")
    step = total / np.maximum(count, 1e-9) - np.nanmedian(within[0])
    closed = float((step > np.median(step) / 3).mean()) if np.median(step) > 0 else 0.0
    edges = np.linspace(0, 256, 33)
    a, b = (np.histogram(v[~np.isnan(v)], edges)[0] for v in (within[0], beside[0]))
    apart = a.sum() and b.sum()
    gcnr = float(1 - np.minimum(a / a.sum(), b / b.sum()).sum()) if apart else 0.0
    return Quality(gcnr, closed)


def _band(grey: Grey, wall: Wall, low: float, high: float) -> tuple[Floats, Floats]:
    """Values (RAYS, 24) between two shares of the radius and their area weights (24,)."""
    shares = np.sqrt(np.linspace(low**2, high**2, 24))  # equal areas
    away = wall.radius[:, None, None] * shares[None, :, None] * DIRECTIONS[:, None, :]
    return grey.at(wall.centre + away), shares


def wall_sd(grey: Grey, wall: Wall) -> float:
    """Standard deviation m along the normal, rms over the wall.

    A wall between two kinds of speckle is known to a speckle's size over the contrast of both; its
    place under the blur to a part of the speckle's size. Both factors were measured on twins of
    known truth (benchmarks/contours.py prints the calibration).
    """
    contrast = np.maximum(wall.levels.contrast, 0.5)
    share = SD_NOISE**2 * float((1 / contrast**2).mean()) + SD_BIAS**2
    return float(np.sqrt(grey.speckle * share))


# --- Ellipses and circles through an outline's points, and how far points lie off a curve.


def ellipse_points(points: Floats) -> Floats:
    """Points (120, 2) on the direct least-squares ellipse (Fitzgibbon et al. 1999) of (k, 2)."""
    centre, axes, turn = ellipse_through(points)
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    around = np.stack([axes[0] * np.cos(ANGLES), axes[1] * np.sin(ANGLES)], axis=1)
    return np.asarray(centre + around @ R.T)


def circle_points(points: Floats) -> Floats:
    """Points (120, 2) on the circle of least radial distances to points (k, 2)."""
    middle = points.mean(axis=0)
    scale = float(np.linalg.norm(points - middle, axis=1).mean())

    def off(p: Floats) -> Floats:
        return np.asarray(np.linalg.norm(points - middle - scale * p[:2], axis=1) / scale - p[2])

    found = least_squares(off, [0.0, 0.0, 1.0]).x
    return np.asarray(middle + scale * found[:2] + scale * found[2] * DIRECTIONS)


def off_curve(points: Floats, curve: Floats) -> Floats:
    """Distances (k,) of points (k, 2) from the closed curve through (m, 2), along its chords.

    Of 120 points of a circle the chords lie within 0.04 % of the radius.
    """
    chord = np.roll(curve, -1, axis=0) - curve
    away = points[:, None] - curve
    share = np.clip((away * chord).sum(axis=-1) / (chord**2).sum(axis=-1), 0.0, 1.0)
    return np.asarray(np.linalg.norm(away - share[..., None] * chord, axis=-1).min(axis=1))


# -------------------------------------------------------------------------------------------------

Shape = Literal["free", "ellipse", "circle"]

MIN_GCNR = 0.63  # 1 - overlap of the grey levels of region and surroundings
MIN_EVIDENCE = 80.0  # nats
MIN_CLOSED = 0.75  # of the wall; two edge shadows take some 20 %
MAX_MISSING = 0.03  # of the wall outside the image
_ROUGH_RADIUS = 0.25  # of the shorter side, when only a centre is given


@dataclass(frozen=True)
class Outline:
    """A closed outline: points (k, 2) m in image coordinates, sd m along the normal.

    centre (2,) m and radius m (of equal area); contrast 0..1 is the generalised contrast-to-noise
    ratio; moved m is by how much the wall was moved outward from the path for the blur.
    """

    points: Floats
    sd: float
    centre: Floats
    radius: float
    contrast: float
    closed: float
    moved: float
    shape: Shape

    def __post_init__(self) -> None:
        points = checked(self.points, "outline [m]", (None, 2), error=RecordingError)
        centre = checked(self.centre, "outline centre [m]", (2,), error=RecordingError)
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "centre", centre)


def extract_outline(
    image: NDArray[np.uint8],
    m_per_px: tuple[float, float],
    *,
    centre: Sequence[float] | Floats | None = None,
    radius: float | None = None,
    shape: Shape = "free",
    bright: bool = False,
) -> Outline:
    """Return the outline of the dark (`bright`: bright) closed region in an image (h, w) uint8.

    `centre` (2,) m and `radius` m may be given roughly (a radius within a third of the true one);
    m_per_px is (x, y). `shape` "free" follows the wall, the others fit it. Raises `RecordingError`
    with the numbers where there is no such region: none found, contrast too low, open, cut by the
    border.
    """
    grey = _darkened(image, m_per_px, bright)
    refusals = []
    # The first wall that is closed, apart in grey level and large.
    for wall, judged in _walls(grey, centre, radius):
        refusal = _refusal(wall, judged)
        if not refusal:
            break
        refusals.append(refusal)
    else:
        raise RecordingError(f"no closed {'bright' if bright else 'dark'} region: {refusals[0]}")
    found = placed(grey, wall, bright)
    middle, size = _enclosed(found.points)
    sd = wall_sd(grey, wall)
    free = Outline(found.points, sd, middle, size, judged.gcnr, judged.closed, found.moved, "free")
    return free if shape == "free" else _fitted(free, shape, grey)


@dataclass(frozen=True)
class RivalRegion:
    """Another closed region of an image: centre (2,) m, radius m, and how well it parts from its
    surroundings as a share of how well the outline does."""

    centre: Floats
    radius: float
    share: float

    @property
    def words(self) -> str:
        x, y = 1e3 * self.centre
        return f"({x:.1f}, {y:.1f}) mm, radius {1e3 * self.radius:.1f} mm"


def rivals_of(
    image: NDArray[np.uint8],
    m_per_px: tuple[float, float],
    outline: Outline,
    *,
    radius: float | None = None,
    bright: bool = False,
) -> tuple[RivalRegion, ...]:
    """Other regions that would pass where no centre is given, the strongest first; arguments as of
    `extract_outline`."""
    grey = _darkened(image, m_per_px, bright)
    walls = [w for w in _walls(grey, None, radius) if not _refusal(*w)]
    others = [w for w in walls if not _beside(w[0], outline)]
    own = [_strength(*w) for w in walls if _beside(w[0], outline)]
    base = max(own or [_strength(*w) for w in others], default=1.0)
    found: list[RivalRegion] = []
    for wall, judged in sorted(others, key=lambda w: -_strength(*w)):
        if all(np.linalg.norm(wall.centre - r.centre) > r.radius for r in found):
            found.append(RivalRegion(wall.centre, rms(wall.radius), _strength(wall, judged) / base))
    return tuple(found)


def _beside(wall: Wall, outline: Outline) -> bool:
    return bool(np.linalg.norm(wall.centre - outline.centre) < outline.radius)


def _darkened(image: NDArray[np.uint8], m_per_px: tuple[float, float], bright: bool) -> Grey:
    if image.ndim != 2 or image.dtype != np.uint8 or min(image.shape) < 16:
        raise RecordingError(f"image {image.shape} {image.dtype}: expected 16 x 16 uint8 or larger")
    plain = image.astype(np.float64)
    dark = 255.0 - plain if bright else plain
    return Grey(dark, m_per_px, speckle_area(dark, m_per_px))


def _walls(
    grey: Grey, centre: Sequence[float] | Floats | None, radius: float | None
) -> Iterator[tuple[Wall, Quality]]:
    """Walls traced from every start, the most promising first, after two rounds each."""
    if radius is not None and not 0 < radius < np.inf:
        raise RecordingError(f"rough radius {radius} m: expected a positive number")
    if centre is None:
        found = candidates(scanned(grey.image), grey.m_per_px)
        starts = [(c.centre, c.radius if radius is None else radius) for c in found]
    else:
        place = checked(np.asarray(centre), "rough centre [m]", (2,), error=RecordingError)
        if np.isnan(grey.at(place[None])).any():
            height, width = 1e3 * np.array(grey.image.shape) * grey.m_per_px[::-1]
            raise RecordingError(
                f"rough centre ({1e3 * place[0]:.2f}, {1e3 * place[1]:.2f}) mm lies outside the "
                f"image of {width:.1f} x {height:.1f} mm; it is measured from the first pixel"
            )
        sides = np.array(grey.image.shape[::-1]) * np.array(grey.m_per_px)
        largest = _ROUGH_RADIUS * float(sides.min())
        radii = [largest * f for f in (0.25, 0.5, 1.0, 1.5)] if radius is None else [radius]
        starts = [(place, rough) for rough in radii]
    if not starts:
        raise RecordingError("no closed dark region: no disc is darker than its surroundings")

    def rank(start: tuple[Floats, float]) -> tuple[bool, float]:
        wall = trace(grey, *start, rounds=2)
        q = quality(grey, wall)
        return not _refusal(wall, q), _strength(wall, q)

    if len(starts) > 1:
        starts.sort(key=rank, reverse=True)
    for start in starts:
        wall = trace(grey, *start)
        yield wall, quality(grey, wall)


def _strength(wall: Wall, judged: Quality) -> float:
    return float(judged.gcnr * judged.closed * np.sqrt(max(wall.evidence, 0.0)))


def _refusal(wall: Wall, judged: Quality) -> str:
    """Why a wall is none; empty when it is."""
    radius = 1e3 * rms(wall.radius)
    place = f"at ({1e3 * wall.centre[0]:.1f}, {1e3 * wall.centre[1]:.1f}) mm, radius {radius:.1f}"
    if wall.missing > MAX_MISSING:
        return (
            f"the region {place} mm is cut by the border, {100 * wall.missing:.0f} % of its "
            f"wall lies outside; use an image that shows all of it"
        )
    if judged.gcnr < MIN_GCNR or wall.evidence < MIN_EVIDENCE:
        return (
            f"the best region {place} mm has contrast {judged.gcnr:.2f} (needs {MIN_GCNR:g}) and "
            f"evidence {wall.evidence:.0f} nats (needs {MIN_EVIDENCE:g}); give its rough centre "
            "and radius, or raise the gain"
        )
    if judged.closed < MIN_CLOSED:
        return (
            f"the best region {place} mm is closed along {100 * judged.closed:.0f} % of its wall "
            f"(needs {100 * MIN_CLOSED:g} %); give its rough centre and radius"
        )
    return ""


def _enclosed(points: Floats) -> tuple[Floats, float]:
    """Centroid (2,) and radius of the circle of equal area of a closed outline (k, 2)."""
    middle = points.mean(axis=0)
    a, b = points - middle, np.roll(points, -1, axis=0) - middle
    cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    area = float(cross.sum()) / 2
    centroid = middle + ((a + b) * cross[:, None]).sum(axis=0) / (6 * area)
    return centroid, float(np.sqrt(abs(area) / np.pi))


def _fitted(free: Outline, shape: Shape, grey: Grey) -> Outline:
    """An ellipse or circle through a free outline; what does not fit enters its sd."""
    fit, freedom = (ellipse_points, 5) if shape == "ellipse" else (circle_points, 3)
    points = fit(free.points)
    centre, radius = _enclosed(points)
    misfit = max(rms(off_curve(free.points, points)) ** 2 - free.sd**2, 0.0)
    independent = max(2 * np.pi * free.radius / (4 * np.sqrt(grey.speckle)), freedom)
    sd = float(np.sqrt(free.sd**2 * freedom / independent + misfit))
    return replace(free, points=points, sd=sd, centre=centre, radius=radius, shape=shape)


# --- tracking of an outline through the images of a recording, and its ambiguities ---------------

# Distances from experts' lines on real images over the standard deviation of the wall on twins:
# 3 px were seen where 1.8 were stated. An expert's line is not the half-power wall.
EXPERTS = 3 / 1.8
SIMILAR = 0.5  # of the outline's own strength, from which a region is a rival
_JUMP = 1.0  # radii between two images beyond which it is another region

ReportAdditions = Callable[[int, int, str], None]


@dataclass(frozen=True)
class Hint:
    """What is known of an outline: rough centre (2,) m and radius m; None where nothing is."""

    centre: Floats | None = None
    radius: float | None = None
    shape: Shape = "free"
    bright: bool = False

    def find(self, image: NDArray[np.uint8], m_per_px: tuple[float, float]) -> Outline:
        return extract_outline(
            image, m_per_px, centre=self.centre, radius=self.radius, shape=self.shape,
            bright=self.bright,
        )  # fmt: skip

    def at(self, outline: Outline) -> "Hint":
        return replace(self, centre=outline.centre, radius=outline.radius)


@dataclass(frozen=True)
class FollowedOutline:
    """Outlines with their own sd and confidence, the first image's rivals, those of its other
    regions that lie beside the place that was said, and by the number of the image why it has
    none."""

    contours: Contours
    rivals: tuple[RivalRegion, ...]
    beside: tuple[RivalRegion, ...]
    without: dict[int, str]

    @property
    def confidence(self) -> Floats:
        """(nt,) 0..1."""
        assert self.contours.each is not None
        return self.contours.each[:, 1]


def followed(
    frames: Frames,
    hint: Hint,
    images: str,
    told: ReportAdditions = lambda *_: None,
    least: float = 0.0,
) -> FollowedOutline:
    """Return the outline in the `frames` of topic `images`; sd m is that of distances to experts'
    lines.

    A region beside the centre that was said lowers no confidence. Raises `RecordingError` where the
    first search finds nothing, where over half of the images have no outline, and where rivals
    leave the first image's less confidence than `least`.
    """
    # Outlines, and reasons for none, by the number of the image.
    found: dict[int, Outline] = {}
    without: dict[int, str] = {}
    last = None
    for i, image in enumerate(frames.images):
        told(i, len(frames.images), f"image {i}")
        try:
            last = _next(image, frames.m_per_px, hint, last)
            found[i] = last
        except RecordingError as error:
            without[i] = str(error)
    if len(without) >= len(frames.images) / 2:
        i, why = next(iter(without.items()))
        raise RecordingError(
            f"{len(without)} of {len(frames.images)} images without an outline, first image {i} "
            f"(t = {frames.t[i]:.3f} s): {why}"
        )
    first = next(iter(found))
    # Other regions as distinct: those that may be meant, and those beside the centre that was
    # given, which neither hold it nor are nearer to it than the outline.
    outline = found[first]
    others = rivals_of(
        frames.images[first], frames.m_per_px, outline, radius=hint.radius, bright=hint.bright
    )
    alike = [replace(r, share=min(r.share, 1.0)) for r in others if r.share >= SIMILAR]
    rivals, beside = alike, list[RivalRegion]()
    if (centre := hint.centre) is not None:
        own = float(np.linalg.norm(outline.centre - centre))
        near = [bool(np.linalg.norm(r.centre - centre) < max(r.radius, own)) for r in alike]
        rivals = [r for r, at in zip(alike, near, strict=True) if at]
        beside = [r for r, at in zip(alike, near, strict=True) if not at]
    doubt = 1 - max((r.share for r in rivals), default=0.0) / 2
    each = np.array([(EXPERTS * o.sd, doubt * o.closed * o.contrast) for o in found.values()])
    _require_sure(tuple(rivals), float(each[0, 1]), least)
    contours = Contours(
        frames.t[list(found)], tuple(o.points for o in found.values()),
        rms(each[:, 0]), frames.pose, frames.frame, images, each,
    )  # fmt: skip
    return FollowedOutline(contours, tuple(rivals), tuple(beside), without)


def _next(
    image: NDArray[np.uint8], m_per_px: tuple[float, float], hint: Hint, last: Outline | None
) -> Outline:
    if last is None:
        return hint.find(image, m_per_px)
    outline = hint.at(last).find(image, m_per_px)
    away = float(np.linalg.norm(outline.centre - last.centre))
    if away > _JUMP * last.radius:
        raise RecordingError(
            f"the nearest region lies {1e3 * away:.1f} mm from the last outline, whose radius is "
            f"{1e3 * last.radius:.1f} mm: it is another region"
        )
    return outline


def _require_sure(rivals: tuple[RivalRegion, ...], confidence: float, least: float) -> None:
    if rivals and confidence < least:
        named = "; ".join(r.words for r in rivals)
        raise RecordingError(
            f"the outline has confidence {confidence:.2f}, but {least:g} is needed, as other "
            f"regions are as distinct: {named}; choose one (--centre X,Y) or accept it "
            f"(--confidence {floor(100 * confidence) / 100:g})"
        )
