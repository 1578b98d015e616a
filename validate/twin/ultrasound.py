"""Synthetic B-mode images: speckle of many scatterers under a point-spread function.

Complex white scatterers, weighted by the echo amplitude of the tissue and blurred by an anisotropic
Gaussian, give a circular Gaussian field, so the envelope of uniform tissue is Rayleigh distributed
(fully developed speckle: mean / sd = sqrt(pi / (4 - pi)) = 1.913; Wagner et al. 1983). Attenuation,
edge shadows and the brightening behind fluid act on the amplitude along depth; electronic noise is
added before the logarithm. Image x runs along the columns, y is depth along the rows.

Departures: one static point spread (no focus, no beam steering), shadows are straight down.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from validate.arrays import Floats
from validate.errors import SceneError
from validate.parameters import quantity
from validate.recording.images.image import coverage


@dataclass(frozen=True)
class Scanner:
    """Image size, point spread and grey scale; levels are dB of amplitude relative to tissue."""

    width: int = quantity(300, "px", "columns of the image")
    height: int = quantity(300, "px", "rows of the image (depth)")
    m_per_px: float = quantity(1e-4, "m", "pixel size, x and y")
    axial: float = quantity(0.12e-3, "m", "sd of the amplitude point spread along depth")
    lateral: float = quantity(0.25e-3, "m", "sd of the amplitude point spread across")
    attenuation: float = quantity(100.0, "dB/m", "loss that the depth gain leaves")
    gain: float = quantity(-18.0, "dB", "level of tissue at the probe below full scale")
    dynamic_range: float = quantity(60.0, "dB", "black to white")
    noise: float = quantity(-45.0, "dB", "electronic noise relative to tissue at the probe")

    def b_mode(self, target: "Target", rng: np.random.Generator) -> NDArray[np.uint8]:
        """Return the log-compressed image (height, width), 8 bits."""
        return compressed(self, envelope(self, target, rng))


@dataclass(frozen=True)
class Target:
    """What lies in the tissue; `level` dB of the inclusion (positive: bright), others below tissue.

    The inclusion throws shadows of `shadow` dB under its lateral edges, `shadow_sd` m wide, and
    brightens what lies behind it by `enhancement` dB. `second` is another dark region at
    `second_level` dB; `plate` a specular line at that depth m, `plate_level` dB.
    """

    outline: Floats | None
    level: float = quantity(-30.0, "dB", "echo of the inclusion")
    shadow: float = quantity(0.0, "dB", "loss in the middle of an edge shadow")
    shadow_sd: float = quantity(0.4e-3, "m", "half width of an edge shadow")
    enhancement: float = quantity(0.0, "dB", "brightening behind the inclusion")
    texture: float = quantity(0.0, "dB", "sd of slow changes of the tissue's level")
    texture_size: float = quantity(1.5e-3, "m", "size of these changes")
    second: Floats | None = None
    second_level: float = quantity(-12.0, "dB", "echo of the second dark region")
    plate: float | None = None
    plate_level: float = quantity(20.0, "dB", "echo of the plate")


def envelope(scanner: Scanner, target: Target, rng: np.random.Generator) -> Floats:
    """Return the detected envelope (height, width); tissue without losses has mean power 1."""
    shape = (scanner.height, scanner.width)
    field = _speckle(scanner, _amplitude(scanner, target, rng), rng)
    if target.plate is not None:
        field = field + _plate(scanner, target)
    field = field * _power_to_amplitude(_losses(scanner, target))
    noise = _power_to_amplitude(np.array(scanner.noise)) * _white(shape, rng)
    return np.asarray(np.abs(field + noise))


def compressed(scanner: Scanner, envelope: Floats) -> NDArray[np.uint8]:
    """20 log10 of the envelope; black at -dynamic_range, white at full scale."""
    level = 20 * np.log10(np.maximum(envelope, 1e-12)) + scanner.gain
    grey = 255 * (1 + level / scanner.dynamic_range)
    return np.clip(np.rint(grey), 0, 255).astype(np.uint8)


def _power_to_amplitude(db: Floats) -> Floats:
    return np.asarray(10 ** (db / 20))


def _white(shape: tuple[int, int], rng: np.random.Generator) -> NDArray[np.complex128]:
    """Circular complex noise of mean power 1."""
    real, imaginary = rng.standard_normal((2, *shape))
    return np.asarray((real + 1j * imaginary) / np.sqrt(2))


def _speckle(
    scanner: Scanner, amplitude: Floats, rng: np.random.Generator
) -> NDArray[np.complex128]:
    """Scatterers blurred by the point spread; uniform amplitude 1 gives mean power 1."""
    sd = np.array([scanner.axial, scanner.lateral]) / scanner.m_per_px
    margin = np.ceil(4 * sd).astype(int)  # speckle does not change at the border
    wide = np.pad(amplitude, [(m, m) for m in margin], mode="edge")
    field = gaussian_filter(_white(wide.shape, rng) * wide, sd, mode="constant")
    power = 1.0
    for s in sd:
        impulse = np.zeros(2 * int(np.ceil(4 * s)) + 3)
        impulse[len(impulse) // 2] = 1
        power *= (gaussian_filter(impulse, s, mode="constant") ** 2).sum()
    inner = field[margin[0] : -margin[0], margin[1] : -margin[1]]
    return np.asarray(inner / np.sqrt(power))


def _amplitude(scanner: Scanner, target: Target, rng: np.random.Generator) -> Floats:
    """Echo amplitude of the tissue with its regions; power is mixed in the pixels of a wall."""
    shape = (scanner.height, scanner.width)
    # A smooth random field of sd 1
    size = target.texture_size / scanner.m_per_px
    slow = gaussian_filter(rng.standard_normal(shape), size, mode="reflect")
    texture = target.texture * np.asarray(slow / slow.std())
    power = 10 ** (texture / 10)
    for outline, level in ((target.second, target.second_level), (target.outline, target.level)):
        if outline is not None:
            if outline.ndim != 2 or outline.shape[1] != 2 or len(outline) < 3:
                raise SceneError(f"outline {outline.shape}: expected at least 3 points (k, 2) in m")
            share = coverage(np.asarray(outline / scanner.m_per_px), shape)
            power = power * (1 - share) + 10 ** (level / 10) * share
    return np.asarray(np.sqrt(power))


def _losses(scanner: Scanner, target: Target) -> Floats:
    """dB (height, width) of two-way attenuation, shadows and brightening."""
    y, x = (np.arange(n) * scanner.m_per_px for n in (scanner.height, scanner.width))
    losses = -scanner.attenuation * np.tile(y[:, None], (1, scanner.width))
    if target.outline is None:
        return losses
    left, right = (target.outline[i] for i in np.argsort(target.outline[:, 0])[[0, -1]])
    onset = target.shadow_sd
    for edge in (left, right):
        across = np.exp(-0.5 * ((x - edge[0]) / target.shadow_sd) ** 2)
        below = 1 / (1 + np.exp(-np.clip((y - edge[1]) / onset, -50, 50)))
        losses -= target.shadow * below[:, None] * across
    bottom = float(target.outline[:, 1].max())
    middle, half = (left[0] + right[0]) / 2, (right[0] - left[0]) / 2
    behind = (y > bottom)[:, None] & (np.abs(x - middle) < 0.8 * half)
    lit = gaussian_filter(behind.astype(float), 0.15 * half / scanner.m_per_px)
    return np.asarray(losses + target.enhancement * lit)


def _plate(scanner: Scanner, target: Target) -> Floats:
    """A coherent echo of a flat plate, as wide as the axial point spread."""
    y = np.arange(scanner.height) * scanner.m_per_px
    depth = 0.0 if target.plate is None else target.plate
    echo = np.exp(-0.5 * ((y - depth) / scanner.axial) ** 2)
    level = _power_to_amplitude(np.array(target.plate_level))
    return np.tile((level * echo)[:, None], (1, scanner.width))
