"""A sweep of B-mode images across an inclusion of known shape."""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.recording.types import Frames
from validate.twin.ultrasound import Scanner, Target

_ANGLES = np.linspace(0, 2 * np.pi, 180, endpoint=False)


@dataclass(frozen=True)
class LeaningCapsule:
    """A capsule of elliptic sections whose axis leans: image coordinates x, y; z along the sweep.

    centre (3,) m, half axes of the section (2,) m, length m with its ends, lean (2,) is the move of
    the section's centre per m of z. The ends are half-ellipsoids as high as the section's radius.
    """

    centre: tuple[float, float, float]
    axes: tuple[float, float]
    length: float
    lean: tuple[float, float] = (0.0, 0.0)

    @property
    def cap(self) -> float:
        """Height of an end, m."""
        return float(np.sqrt(self.axes[0] * self.axes[1]))

    @property
    def volume(self) -> float:
        """m^3; leaning does not change it."""
        return float(np.pi * self.cap**2 * (self.length - 2 * self.cap + 4 / 3 * self.cap))

    def scale(self, z: Floats) -> Floats:
        """Size of the section at z (n,) relative to the largest; 0 beyond the ends."""
        over = np.maximum(np.abs(z - self.centre[2]) - (self.length / 2 - self.cap), 0) / self.cap
        return np.asarray(np.sqrt(np.maximum(1 - over**2, 0)))

    def section(self, z: float) -> Floats | None:
        """Outline (180, 2) m at z; None beyond the ends."""
        scale = float(self.scale(np.array([z]))[0])
        if scale == 0:
            return None
        middle = np.array(self.centre[:2]) + (z - self.centre[2]) * np.array(self.lean)
        ring = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1) * np.array(self.axes)
        return np.asarray(middle + scale * ring)

    def surface(self, along: int = 60) -> Floats:
        """Points (along * 180, 3) m, denser at the ends."""
        half = self.length / 2
        z = self.centre[2] - half * np.cos(np.linspace(0, np.pi, along + 2)[1:-1])
        rings = [(self.section(float(s)), s) for s in z]
        return np.concatenate(
            [np.column_stack([r, np.full(len(r), s)]) for r, s in rings if r is not None]
        )


def sweep_frames(
    shape: LeaningCapsule,
    positions: Floats,
    scanner: Scanner,
    pose: Floats,
    seed: int,
    *,
    level: float = -25.0,
    shadow: float = 6.0,
) -> Frames:
    """One image at each position (n,) m along z, one a second, in the frame "phantom"."""
    rng = np.random.default_rng(seed)
    images = tuple(
        scanner.b_mode(Target(shape.section(float(z)), level=level, shadow=shadow), rng)
        for z in positions
    )
    scale = (scanner.m_per_px, scanner.m_per_px)
    return Frames(np.arange(len(positions), dtype=float), images, scale, pose, "phantom")
