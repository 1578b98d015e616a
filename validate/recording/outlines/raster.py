"""Area fraction of every pixel inside a closed outline."""

import numpy as np

from validate.arrays import Floats


def coverage(outline: Floats, shape: tuple[int, int], lines: int = 4) -> Floats:
    """Covered share 0..1 (h, w) of each pixel by a closed outline (k, 2), x and y in pixels.

    Pixel centres lie on whole numbers. Even-odd rule; exact along x, `lines` scan lines a pixel
    along y.
    """
    height, width = shape
    covered = np.zeros(shape)
    start, end = outline, np.roll(outline, -1, axis=0)
    pixels = np.arange(width) - 0.5
    low = max(int(np.floor(outline[:, 1].min() + 0.5)), 0)
    high = min(int(np.ceil(outline[:, 1].max() + 0.5)), height)
    for row in range(low, high):
        for offset in (np.arange(lines) + 0.5) / lines - 0.5:
            crossings = _crossings(start, end, row + offset)
            for left, right in crossings.reshape(-1, 2):
                covered[row] += np.clip(right - pixels, 0, 1) - np.clip(left - pixels, 0, 1)
    return covered / lines


def _crossings(start: Floats, end: Floats, y: float) -> Floats:
    """Sorted x (2 m,) where the edges start -> end cross the line at y."""
    cut = (start[:, 1] > y) != (end[:, 1] > y)
    a, b = start[cut], end[cut]
    return np.sort(a[:, 0] + (y - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0]))
