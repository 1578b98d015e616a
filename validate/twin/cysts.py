"""Random cyst-like frames of known outline: what the contour extraction is measured on."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats
from validate.twin.ultrasound import Scanner, Target, b_mode

LEVELS = (-12.0, -18.0, -24.0, -30.0)  # dB of the inclusion below tissue
SHADOWS = (0.0, 6.0, 12.0)  # dB in the middle of an edge shadow
_SIZE = 30e-3  # m, both sides of the image
_ANGLES = np.linspace(0, 2 * np.pi, 240, endpoint=False)


@dataclass(frozen=True)
class CystFrame:
    """An image (h, w) uint8 with its pixel size (x, y) m and true outline (240, 2) m."""

    image: NDArray[np.uint8]
    m_per_px: tuple[float, float]
    outline: Floats
    level: float
    shadow: float


def cyst_frame(seed: int, level: float, shadow: float) -> CystFrame:
    """A frame of `level` and `shadow` dB; size, shape, place, scanner and tissue are drawn.

    Equal radius 2.5-8 mm, axes ratio down to 0.6 with a bulge or two, pixels 0.07-0.15 mm, point
    spread 0.08-0.18 x 0.2-0.45 mm, 50-75 dB shown, tissue uneven by 1.5 dB, 3 dB brighter behind;
    every second frame has another region 12 dB below tissue, every third a bright plate at the top.
    """
    rng = np.random.default_rng([seed, int(-10 * level), int(10 * shadow)])
    radius = float(rng.uniform(2.5e-3, 8e-3))
    room = _SIZE / 2 - 1.45 * radius
    centre = _SIZE / 2 + rng.uniform(-1, 1, 2) * room * np.array([1.0, 0.8])
    outline = cyst_outline(centre, radius, rng)
    m_per_px = float(rng.uniform(0.07e-3, 0.15e-3))
    scanner = Scanner(
        width=round(_SIZE / m_per_px),
        height=round(_SIZE / m_per_px),
        m_per_px=m_per_px,
        axial=float(rng.uniform(0.08e-3, 0.18e-3)),
        lateral=float(rng.uniform(0.2e-3, 0.45e-3)),
        dynamic_range=float(rng.uniform(50, 75)),
    )
    corner = np.where(centre > _SIZE / 2, 3.5e-3, _SIZE - 3.5e-3)
    apart = float(np.linalg.norm(corner - centre)) > 1.45 * radius + 3e-3
    target = Target(
        outline,
        level=level,
        shadow=shadow,
        enhancement=3.0,
        texture=1.5,
        second=cyst_outline(corner, 2e-3, rng) if seed % 2 and apart else None,
        plate=0.6e-3 if seed % 3 == 0 else None,
    )
    image = b_mode(scanner, target, rng)
    return CystFrame(image, (m_per_px, m_per_px), outline, level, shadow)


def cyst_outline(centre: Floats, radius: float, rng: np.random.Generator) -> Floats:
    """A star-shaped outline (240, 2) m: a tilted ellipse with harmonics 2 to 5."""
    ratio, tilt = rng.uniform(0.6, 1.0), rng.normal(0, 0.4)
    along, across = np.cos(_ANGLES - tilt), np.sin(_ANGLES - tilt)
    r = radius / np.sqrt(ratio * along**2 + across**2 / ratio)
    for k in range(2, 6):
        height, phase = 0.1 * rng.normal() / k**1.5, rng.uniform(0, 2 * np.pi)
        r = r * (1 + height * np.cos(k * _ANGLES + phase))
    return np.asarray(centre + r[:, None] * np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1))
