"""Wall of a dark region in an image: rough search, closed path in polar coordinates, wall position.

Every pixel weighs in by how much likelier it is inside than outside (Gaussian grey levels of the
region and of its surroundings, the latter from ray to ray, so that a shadow weighs little),
divided by the size of a speckle, so that costs are natural logarithms of probabilities.

Position of a blurred wall, corrected for blur.

A path between grey levels lies inward of the wall, because the logarithm lifts the skirt of the
point spread. The wall of the scatterers is where half of the power is left: 3.01 dB below the
level of the brighter side. A grey level's dB are known from the speckle itself, whose log
envelope has a standard deviation of 5.57 dB whatever the dynamic range, so no setting of the
scanner is needed. Where that level would lie below the middle of both sides (low contrast) the
middle is taken, and towards the middle where the scanner smoothed the logarithm too, which blurs
evenly to both sides: the skewness of log speckle tells how much.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d, label

from validate.arrays import Floats, Ints, rms
from validate.recording.images.image import blurred, correlated, sampled, shrunk

# --- The cheapest closed path over a polar map, by dynamic programming.

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


# -------------------------------------------------------------------------------------------------

RAYS = 120
ANGLES = np.arange(RAYS) * (2 * np.pi / RAYS)
DIRECTIONS = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)
_STEPS = 60  # of the radius within the rough radius
_REACH = 2.2  # rough radii
_STIFFNESS = 25.0  # nats per radian of a path that climbs one radius per radian
_SURROUND = (360.0, 360.0, 60.0, 25.0, 25.0)  # deg of the wall that share one outer level, by round
_CLIP = 3.0  # nats a pixel can weigh at most
LOG_SPECKLE_SD = 5.57  # dB of fully developed speckle: 10 pi / (sqrt(6) ln 10)
HALF_POWER = 10 * np.log10(2)  # dB


@dataclass(frozen=True)
class Levels:
    """Grey levels: inside, sd inside, outside per ray (RAYS,), sd outside about that level.

    The skewness of both sides tells raw log speckle (-1.14) from speckle that was smoothed (0).
    """

    inside: float
    sd_inside: float
    outside: Floats
    sd_outside: float
    skew_inside: float
    skew_outside: float

    @property
    def contrast(self) -> Floats:
        """(RAYS,) difference outside - inside in standard deviations of both."""
        spread = np.sqrt((self.sd_inside**2 + self.sd_outside**2) / 2)
        return np.asarray((self.outside - self.inside) / spread)


@dataclass(frozen=True)
class Wall:
    """A closed path: centre (2,) m, radius (RAYS,) m, and the grey levels beside it."""

    centre: Floats
    radius: Floats
    levels: Levels
    evidence: float  # nats: log likelihood of the inside as dark region over that as surroundings
    missing: float  # share of the rays whose wall lies outside the image


@dataclass(frozen=True)
class Grey:
    """An image as floats with pixel size (x, y) m and area of a speckle m^2."""

    image: Floats
    m_per_px: tuple[float, float]
    speckle: float

    def at(self, places: Floats) -> Floats:
        """Values at places (..., 2) m; NaN outside."""
        x, y = (places[..., i] / self.m_per_px[i] for i in (0, 1))
        return sampled(self.image, x, y)


def speckle_area(image: Floats, m_per_px: tuple[float, float]) -> float:
    """Area m^2 within which grey levels go together: the sum of the autocorrelation's main lobe."""
    rough = image - blurred(image, (4.0, 4.0))
    spectrum = np.abs(np.fft.rfft2(rough)) ** 2
    correlation = np.fft.fftshift(np.fft.irfft2(spectrum, s=image.shape))
    middle = tuple(n // 2 for n in image.shape)
    lobe = correlation[middle[0] - 6 : middle[0] + 7, middle[1] - 6 : middle[1] + 7]
    peak = float(correlation[middle]) or 1.0
    cells = float(lobe[lobe > 0.2 * peak].sum() / peak)
    return max(cells, 1.0) * m_per_px[0] * m_per_px[1]


def trace(grey: Grey, centre: Floats, radius: float, rounds: int = len(_SURROUND)) -> Wall:
    """Return the wall of the dark region about a rough centre (2,) m and radius m.

    Each round finds the path for the levels beside the last one; two tell a region from none.
    """
    path = np.full(RAYS, radius)
    for surround in _SURROUND[:rounds]:
        step = radius / _STEPS
        radii: Floats = np.arange(1.0, int(_REACH * _STEPS) + 1.0) * step
        polar = grey.at(centre + radii[None, :, None] * DIRECTIONS[:, None, :])
        levels = levels_beside(polar, radii, path, surround)
        # Cost (RAYS, m) in nats of a wall at each grid radius: region on both sides, and edge.
        step = radii[1] - radii[0]
        outside = np.maximum(levels.outside, levels.inside + 0.3 * levels.sd_outside)[:, None]
        near = -0.5 * ((polar - levels.inside) / levels.sd_inside) ** 2 - np.log(levels.sd_inside)
        far = -0.5 * ((polar - outside) / levels.sd_outside) ** 2 - np.log(levels.sd_outside)
        bright = polar > outside
        likelier = np.clip(np.where(bright, -_CLIP, near - far), -_CLIP, _CLIP)
        likelier = np.where(np.isnan(polar), 0.0, likelier)
        cells = radii[None, :] * step * (2 * np.pi / RAYS) / grey.speckle
        cost = np.asarray(-np.cumsum(likelier * cells, axis=1))
        slope = 2 * np.pi / RAYS * _STEPS  # grid steps of a climb of one radius per radian
        chosen = closed_path(cost, _STIFFNESS * (2 * np.pi / RAYS) / slope**2)
        path = gaussian_filter1d(radii[chosen], 1.4, mode="wrap")
        centre, path = recentred(centre, path)
        radius = rms(path)
    evidence = -float(cost[np.arange(RAYS), chosen].sum())
    around = grey.at(centre + 1.03 * path[:, None] * DIRECTIONS)
    return Wall(centre, path, levels, evidence, float(np.isnan(around).mean()))


def recentred(centre: Floats, path: Floats) -> tuple[Floats, Floats]:
    """Return the path about its own centroid: new centre, new radii (RAYS,)."""
    points = centre + path[:, None] * DIRECTIONS
    area = path**2
    shift = (2 / 3) * (area[:, None] * path[:, None] * DIRECTIONS).sum(axis=0) / area.sum()
    shift = shift * min(1.0, 0.5 * path.min() / max(float(np.linalg.norm(shift)), 1e-12))
    away = points - (centre + shift)
    angle = np.unwrap(np.arctan2(away[:, 1], away[:, 0]))
    order = np.argsort(np.mod(angle, 2 * np.pi))
    radius = np.linalg.norm(away, axis=1)
    at = np.mod(angle, 2 * np.pi)[order]
    return centre + shift, np.interp(ANGLES, at, radius[order], period=2 * np.pi)


def levels_beside(polar: Floats, radii: Floats, path: Floats, surround: float) -> Levels:
    """Levels of a polar map (RAYS, m) inside and beside a path (RAYS,) m.

    The outer level is averaged over `surround` deg of the wall.
    """
    share = radii[None, :] / path[:, None]
    seen = ~np.isnan(polar)
    weight = radii[None, :] * seen
    within, beside = seen & (share < 0.8), weight * ((share > 1.12) & (share < 1.6))
    values = np.where(seen, polar, 0.0)
    dark = values[within] if within.any() else np.zeros(1)
    inside = float(np.median(dark))
    sd_inside = 1.4826 * float(np.median(np.abs(dark - inside)))
    width = surround / 360 * RAYS / 2
    count = gaussian_filter1d(beside.sum(axis=1), width, mode="wrap")
    total = gaussian_filter1d((beside * values).sum(axis=1), width, mode="wrap")
    outside = total / np.maximum(count, 1e-9 * max(float(count.max()), 1e-30))
    residual = values - outside[:, None]
    mass = max(float(beside.sum()), 1e-30)
    sd_outside = max(float(np.sqrt((beside * residual**2).sum() / mass)), 1.0)
    skew_outside = float((beside * residual**3).sum() / mass) / sd_outside**3
    off = dark - dark.mean()
    skew_inside = float((off**3).mean()) / max(float(off.std()), 1.0) ** 3
    sd_inside = max(sd_inside, 0.35 * sd_outside, 1.0)
    return Levels(inside, sd_inside, outside, sd_outside, skew_inside, skew_outside)


_SPAN = 0.35  # of the radius, to both sides of the path
_SAMPLES = 71
_RAW_SKEW = 0.8  # log speckle has 1.14, less what the texture of tissue takes
_SMOOTHED = 0.35  # of the step from the brighter side: blurred before and after the logarithm
_MOST = 1.5  # speckle sizes; a blur is not wider


@dataclass(frozen=True)
class Placed:
    """Points (RAYS, 2) m on the wall and their mean outward move m from the path."""

    points: Floats
    moved: float


def placed(grey: Grey, wall: Wall, bright: bool) -> Placed:
    """Return the wall's points moved from the path to where half of the power is left."""
    points = wall.centre + wall.radius[:, None] * DIRECTIONS
    # Outward normals (k, 2) of a closed outline with growing polar angle.
    tangent = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    tangent = tangent / np.linalg.norm(tangent, axis=1, keepdims=True)
    normals = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)
    s = np.linspace(-_SPAN, _SPAN, _SAMPLES) * float(wall.radius.mean())
    profile = grey.at(points[:, None, :] + s[None, :, None] * normals[:, None, :])
    # Share 0..1 of the step from inside to outside at which the wall lies.
    levels = wall.levels
    step = max(float(np.mean(levels.outside)) - levels.inside, 1e-9)
    spread = levels.sd_inside if bright else levels.sd_outside
    skew = levels.skew_inside if bright else -levels.skew_outside
    raw = float(np.clip(skew / _RAW_SKEW, 0, 1))
    below = raw * min(HALF_POWER / LOG_SPECKLE_SD * spread / step, 0.5) + (1 - raw) * _SMOOTHED
    level = float(below if bright else 1 - below)
    across = normals[:, 0] ** 2  # 1: the wall faces sideways, 0: it faces along depth
    sideways = _crossing(profile, s, wall, level, across)
    along = _crossing(profile, s, wall, level, 1 - across)
    most = _MOST * float(np.sqrt(grey.speckle))
    sideways, along = (float(np.clip(m, -most, most)) for m in (sideways, along))
    move = across * sideways + (1 - across) * along
    there = points + move[:, None] * normals
    # Whether polar angles of (k, 2) grow: a wall moved along normals that cross folds.
    away = there - wall.centre
    one, next_ = away, np.roll(away, -1, axis=0)
    if not bool((one[:, 0] * next_[:, 1] > one[:, 1] * next_[:, 0]).all()):
        there = points + move[:, None] * DIRECTIONS
    return Placed(there, float(move.mean()))


def _crossing(profile: Floats, s: Floats, wall: Wall, level: float, weight: Floats) -> float:
    """Where the weighted mean profile passes `level`, m from the path, nearest to it."""
    seen = ~np.isnan(profile)
    step = np.maximum(wall.levels.outside - wall.levels.inside, 0)[:, None] * seen
    rise = np.where(seen, profile - wall.levels.inside, 0) * weight[:, None]
    mean = rise.sum(axis=0) / np.maximum((step * weight[:, None]).sum(axis=0), 1e-9)
    mean = gaussian_filter1d(mean, 1.0, mode="nearest")
    above = mean >= level
    passes = np.flatnonzero(~above[:-1] & above[1:])
    if not len(passes):
        return 0.0
    places = s[passes] + (s[1] - s[0]) * (level - mean[passes]) / (mean[passes + 1] - mean[passes])
    return float(min(places.tolist(), key=abs))


_SIDE = 88  # px of the longer side while searching
_SECTORS = 8
_SMALLEST, _GROWTH = 4.0, 1.25  # px of the shrunk image; factor from radius to radius


@dataclass(frozen=True)
class Candidate:
    """A disc darker than what surrounds it: centre (2,) px and radius m, both of the image."""

    centre: Floats  # m
    radius: float  # m
    score: float


def candidates(image: Floats, m_per_px: tuple[float, float], most: int = 4) -> list[Candidate]:
    """Return the best dark discs of an image (h, w), the best first, none inside another one's
    middle.

    A disc's score is how much darker its mean is than the third darkest of eight sectors around it
    (so two may lie in a shadow), in standard deviations of the image, times the root of its radius.
    """
    # The image with square pixels of the returned size m.
    sizes = np.array(image.shape) * np.array(m_per_px[::-1])
    scale = max(float(sizes.max()) / _SIDE, *m_per_px)
    rows, columns = (max(round(s / scale), 1) for s in sizes)
    small = shrunk(image, (rows, columns))
    spread = float(small.std()) or 1.0
    found: list[Candidate] = []
    largest = 0.46 * min(small.shape)
    radius = _SMALLEST
    while radius <= largest:
        reach = int(np.ceil(1.55 * radius))
        y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
        away, angle = np.hypot(x, y), np.mod(np.arctan2(y, x), 2 * np.pi)
        disc = (away <= 0.85 * radius).astype(np.float64)
        ring = (away >= 1.15 * radius) & (away <= 1.55 * radius)
        sector = np.floor(angle / (2 * np.pi / _SECTORS)).astype(int)
        parts = [(ring & (sector == k)).astype(np.float64) for k in range(_SECTORS)]
        disc, sectors = disc / disc.sum(), [p / max(p.sum(), 1.0) for p in parts]
        inside = correlated(small, disc)
        around = np.sort(np.stack([correlated(small, s) for s in sectors]), axis=0)
        score = (
            (0.5 * around[2] + 0.5 * around[2:].mean(axis=0) - inside) / spread * np.sqrt(radius)
        )
        margin = int(np.ceil(0.9 * radius))
        score[:margin], score[-margin:] = -np.inf, -np.inf
        score[:, :margin], score[:, -margin:] = -np.inf, -np.inf
        best: list[Candidate] = []
        for place in np.argsort(score, axis=None)[::-1][:200]:
            row, column = np.unravel_index(place, score.shape)
            if score[row, column] <= 1e-6 or len(best) == 4:
                break
            centre = (np.array([column, row]) + 0.5) * scale
            if all(np.linalg.norm(centre - b.centre) > radius * scale for b in best):
                best.append(Candidate(centre, radius * scale, float(score[row, column])))
        found += best
        radius *= _GROWTH
    kept: list[Candidate] = []
    for c in sorted(found, key=lambda c: -c.score):
        near = (np.linalg.norm(c.centre - k.centre) < 0.5 * max(c.radius, k.radius) for k in kept)
        if not any(near):
            kept.append(c)
        if len(kept) == most:
            break
    return kept


def scanned(image: Floats) -> Floats:
    """Return the image (h, w) with the grey of what was scanned in place of what was not: all of
    one level from a corner on, as outside of a sector probe's fan. A search would find that
    first."""
    parts, _ = label(image == image.min())
    corners = {int(parts[i, j]) for i in (0, -1) for j in (0, -1)} - {0}
    outside = np.isin(parts, sorted(corners))
    if not outside.any() or outside.all():
        return image
    return np.where(outside, image[~outside].mean(), image)
