"""Wall of a dark region in polar coordinates: speckle statistics, closed path, wall position.

Every pixel weighs in by how much likelier it is inside than outside (Gaussian grey levels of the
region and of its surroundings, the latter from ray to ray, so that a shadow weighs little), divided
by the size of a speckle, so that costs are natural logarithms of probabilities.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from validate.arrays import Floats, Ints, rms
from validate.recording.images.image import blurred, sampled

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
        cost = _cost(polar, radii, levels, grey.speckle)
        slope = 2 * np.pi / RAYS * _STEPS  # grid steps of a climb of one radius per radian
        chosen = closed_path(cost, _STIFFNESS * (2 * np.pi / RAYS) / slope**2)
        path = gaussian_filter1d(radii[chosen], 1.4, mode="wrap")
        centre, path = recentred(centre, path)
        radius = rms(path)
    evidence = -float(cost[np.arange(RAYS), chosen].sum())
    return Wall(centre, path, levels, evidence, _missing(grey, centre, path))


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


def _cost(polar: Floats, radii: Floats, levels: Levels, speckle: float) -> Floats:
    """Cost (RAYS, m) in nats of a wall at each grid radius: region on both sides, and edge."""
    step = radii[1] - radii[0]
    outside = np.maximum(levels.outside, levels.inside + 0.3 * levels.sd_outside)[:, None]
    near = -0.5 * ((polar - levels.inside) / levels.sd_inside) ** 2 - np.log(levels.sd_inside)
    far = -0.5 * ((polar - outside) / levels.sd_outside) ** 2 - np.log(levels.sd_outside)
    bright = polar > outside
    likelier = np.clip(np.where(bright, -_CLIP, near - far), -_CLIP, _CLIP)
    likelier = np.where(np.isnan(polar), 0.0, likelier)
    cells = radii[None, :] * step * (2 * np.pi / RAYS) / speckle
    return np.asarray(-np.cumsum(likelier * cells, axis=1))


def _missing(grey: Grey, centre: Floats, path: Floats) -> float:
    around = grey.at(centre + 1.03 * path[:, None] * DIRECTIONS)
    return float(np.isnan(around).mean())
