"""Rough search for dark closed regions in an image: discs against the sectors of a ring."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import label

from validate.arrays import Floats
from validate.recording.images.image import correlated, shrunk

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
    small, scale = _isotropic(image, m_per_px)
    spread = float(small.std()) or 1.0
    found: list[Candidate] = []
    largest = 0.46 * min(small.shape)
    radius = _SMALLEST
    while radius <= largest:
        found += _of_radius(small, radius, spread, scale)
        radius *= _GROWTH
    return _apart(sorted(found, key=lambda c: -c.score), most)


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


def _isotropic(image: Floats, m_per_px: tuple[float, float]) -> tuple[Floats, float]:
    """The image with square pixels of the returned size m."""
    sizes = np.array(image.shape) * np.array(m_per_px[::-1])
    scale = max(float(sizes.max()) / _SIDE, *m_per_px)
    rows, columns = (max(round(s / scale), 1) for s in sizes)
    return shrunk(image, (rows, columns)), scale


def _of_radius(small: Floats, radius: float, spread: float, scale: float) -> list[Candidate]:
    disc, sectors = _kernels(radius)
    inside = correlated(small, disc)
    around = np.sort(np.stack([correlated(small, s) for s in sectors]), axis=0)
    score = (0.5 * around[2] + 0.5 * around[2:].mean(axis=0) - inside) / spread * np.sqrt(radius)
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
    return best


def _kernels(radius: float) -> tuple[Floats, list[Floats]]:
    reach = int(np.ceil(1.55 * radius))
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    away, angle = np.hypot(x, y), np.mod(np.arctan2(y, x), 2 * np.pi)
    disc = (away <= 0.85 * radius).astype(np.float64)
    ring = (away >= 1.15 * radius) & (away <= 1.55 * radius)
    sector = np.floor(angle / (2 * np.pi / _SECTORS)).astype(int)
    parts = [(ring & (sector == k)).astype(np.float64) for k in range(_SECTORS)]
    return disc / disc.sum(), [p / max(p.sum(), 1.0) for p in parts]


def _apart(found: list[Candidate], most: int) -> list[Candidate]:
    kept: list[Candidate] = []
    for c in found:
        near = (np.linalg.norm(c.centre - k.centre) < 0.5 * max(c.radius, k.radius) for k in kept)
        if not any(near):
            kept.append(c)
        if len(kept) == most:
            break
    return kept
