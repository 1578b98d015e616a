"""B-mode images made in another way than by `validate.twin`.

Point scatterers, lines of radio-frequency echoes, their envelope, and a scan conversion. A linear
probe or a sector one, whose image is black outside of its fan; the point spread grows away from
the focus.
"""

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.ndimage import map_coordinates
from scipy.signal import fftconvolve, hilbert

SOUND, DEPTH, NEAR, FOCUS = 1540.0, 45e-3, 3e-3, 25e-3  # m/s, m
WIDTH, LINES = 40e-3, 192  # of the linear probe
ANGLE, ARC, RAYS = np.deg2rad(60), 20e-3, 160  # of the sector probe, whose lines begin on an arc
SCATTERERS = 60_000
_NOISE = -38.0  # dB below tissue


@dataclass(frozen=True)
class Scan:
    """What is drawn for one seed; `level` dB of the inclusion, None: there is none."""

    sector: bool
    level: float | None
    hz: float
    m_per_px: float
    size: float  # radius, m
    kind: str
    grey: tuple[float, float]  # dynamic range and gain, dB

    @staticmethod
    def of(seed: int, rng: np.random.Generator) -> "Scan":
        level = None if seed % 10 == 9 else (-30.0, -15.0, -9.0, -20.0)[seed // 6 % 4]
        kind = ("circle", "ellipse", "irregular")[seed // 2 % 3]
        hz, size = rng.choice([3.5e6, 5e6, 7.5e6]), rng.uniform(3.5e-3, 9e-3)
        grey = rng.choice([50.0, 60.0, 70.0]), rng.uniform(-25, -10)
        return Scan(seed % 2 == 1, level, hz, rng.choice([1e-4, 1.5e-4, 2e-4]), size, kind, grey)


def scanned(seed: int) -> tuple[np.ndarray, np.ndarray | None, Scan]:
    """The image (h, w) uint8, the inclusion's outline (k, 2) m from its first pixel, its scan."""
    rng = np.random.default_rng(seed)
    scan = Scan.of(seed, rng)
    place, echo = _scatterers(scan, rng)
    outline = None
    if scan.level is not None:
        outline = _border(scan, rng)
        inside = shapely.contains_xy(shapely.Polygon(outline), place)
        echo = np.where(inside, echo * 10 ** (scan.level / 20), echo)
    db = _echoes(scan, place, echo, rng)
    image, origin = _converted(
        scan, np.clip(255 * (1 + (db + scan.grey[1]) / scan.grey[0]), 0, 255)
    )
    return image, None if outline is None else outline - origin, scan


def _scatterers(scan: Scan, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    if scan.sector:
        r = np.sqrt(rng.uniform((ARC + NEAR) ** 2, (ARC + DEPTH) ** 2, SCATTERERS))
        a = rng.uniform(-ANGLE / 2, ANGLE / 2, SCATTERERS) * 1.05
        place = np.stack([r * np.sin(a), r * np.cos(a) - ARC], axis=1)
    else:
        x = rng.uniform(-WIDTH / 2, WIDTH / 2, SCATTERERS) * 1.1
        place = np.stack([x, rng.uniform(NEAR, DEPTH, SCATTERERS)], axis=1)
    return place, rng.normal(size=SCATTERERS)


def _border(scan: Scan, rng: np.random.Generator) -> np.ndarray:
    s = np.linspace(0, 2 * np.pi, 240, endpoint=False)
    middle = np.array([rng.uniform(-6e-3, 6e-3), rng.uniform(17e-3, 30e-3)])
    r = np.full_like(s, scan.size)
    if scan.kind == "irregular":
        for k in (2, 3, 4, 5):
            r += scan.size * rng.normal(0, 0.06 / k) * np.cos(k * s + rng.uniform(0, 2 * np.pi))
    axes = (rng.uniform(1, 1.3), rng.uniform(0.7, 1)) if scan.kind == "ellipse" else (1, 1)
    turn = rng.uniform(0, np.pi)
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    return middle + np.stack([axes[0] * r * np.cos(s), axes[1] * r * np.sin(s)], axis=1) @ R.T


def _on_lines(scan: Scan, x: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Line and depth m of places."""
    if scan.sector:
        return (np.arctan2(x, z + ARC) / ANGLE + 0.5) * (RAYS - 1), np.hypot(x, z + ARC) - ARC
    return (x / WIDTH + 0.5) * (LINES - 1), z


def _echoes(
    scan: Scan, place: np.ndarray, echo: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Envelope of every line, dB of tissue."""
    lines, rate = RAYS if scan.sector else LINES, 8 * scan.hz
    line, depth = _on_lines(scan, *place.T)
    pitch = (depth + ARC) * ANGLE / (RAYS - 1) if scan.sector else WIDTH / (LINES - 1)
    spread = SOUND / scan.hz * 1.1 * (1 + np.abs(depth - FOCUS) / 20e-3) / pitch
    sample = 2 * depth / SOUND * rate
    first, rest = np.floor(sample).astype(int), sample % 1
    rf = np.zeros((int(2 * DEPTH / SOUND * rate), lines))
    echo = echo * 10 ** (-2.25e-7 * scan.hz * depth)
    for off in range(-6, 7):
        at = np.round(line).astype(int) + off
        part = echo * np.exp(-0.5 * ((at - line) / np.maximum(spread, 0.5)) ** 2)
        ok = (at >= 0) & (at < lines) & (first >= 0) & (first < len(rf) - 1)
        np.add.at(rf, (first[ok], at[ok]), (part * (1 - rest))[ok])
        np.add.at(rf, (first[ok] + 1, at[ok]), (part * rest)[ok])
    t = np.arange(-40, 41) / rate
    pulse = np.exp(-0.5 * (t * scan.hz * 0.93) ** 2) * np.cos(2 * np.pi * scan.hz * t)
    rf = fftconvolve(rf, pulse[:, None], mode="same")
    tissue = rf[len(rf) // 4 : len(rf) // 2].std()
    rf += rng.normal(0, tissue * 10 ** (_NOISE / 20), rf.shape)
    return 20 * np.log10(np.abs(hilbert(rf, axis=0)) / tissue + 1e-9)


def _converted(scan: Scan, grey: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The image (h, w) uint8, black where no line is, and the place m of its first pixel."""
    px = scan.m_per_px
    if scan.sector:
        top = ARC * np.cos(ANGLE / 2) - ARC - 2e-3
        corner, size = np.array([-1.05 * (ARC + DEPTH) * np.sin(ANGLE / 2), top]), (DEPTH + ARC)
        wide = -2 * corner[0]
    else:
        corner, size, wide = np.array([-WIDTH / 2, 0.0]), DEPTH, WIDTH
    x, z = np.meshgrid(corner[0] + (np.arange(int(wide / px)) + 0.5) * px,
                       corner[1] + (np.arange(int(size / px)) + 0.5) * px)  # fmt: skip
    line, depth = _on_lines(scan, x, z)
    sample = 2 * depth / SOUND * 8 * scan.hz
    image = map_coordinates(grey, [sample, line], order=1)
    rows, lines = grey.shape
    image[(line < 0) | (line > lines - 1) | (sample < 0) | (sample > rows - 1)] = 0
    return np.rint(image).astype(np.uint8), corner + 0.5 * px
