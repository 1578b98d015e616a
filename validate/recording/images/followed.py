"""An outline followed through the images of a recording, with what could be taken for it.

The first image is searched from what the user says of the place; each next one from where the
outline was last. What of the first image might be meant as well is named and lowers the confidence.
An image without an outline is left out and said; more without than with one is an error.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats, rms
from validate.errors import RecordingError
from validate.recording.images.outline import (
    Outline,
    RivalRegion,
    Shape,
    extract_outline,
    rivals_of,
)
from validate.recording.types import Contours, Frames

# Distances from experts' lines on real images over the standard deviation of the wall on twins:
# 3 px were seen where 1.8 were stated. An expert's line is not the half-power wall.
EXPERTS = 3 / 1.8
SIMILAR = 0.5  # of the outline's own strength, from which a region is a rival
_JUMP = 1.0  # radii between two images beyond which it is another region

Told = Callable[[int, int, str], None]


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
    """Outlines with their confidences (nt,) 0..1, the first image's rivals, and by the number of
    the image why it has none."""

    contours: Contours
    confidence: Floats
    rivals: tuple[RivalRegion, ...]
    without: dict[int, str]


def followed(
    frames: Frames, hint: Hint, images: str, told: Told = lambda *_: None
) -> FollowedOutline:
    """The outline in the `frames` of topic `images`; sd m is that of distances to experts' lines.

    A rival counts only where no centre was said. Raises `RecordingError` where the first search
    finds nothing, and where over half of the images have no outline.
    """
    found, without = _searched(frames, hint, told)
    if len(without) >= len(frames.images) / 2:
        i, why = next(iter(without.items()))
        raise RecordingError(
            f"{len(without)} of {len(frames.images)} images without an outline, first image {i} "
            f"(t = {frames.t[i]:.3f} s): {why}"
        )
    first = next(iter(found))
    rivals = () if hint.centre is not None else _rivals(frames, first, found[first], hint)
    contours = Contours(
        frames.t[list(found)], tuple(o.points for o in found.values()),
        EXPERTS * rms([o.sd for o in found.values()]), frames.pose, frames.frame, images,
    )  # fmt: skip
    doubt = 1 - max((r.share for r in rivals), default=0.0) / 2
    confidence = doubt * np.array([o.closed * o.contrast for o in found.values()])
    return FollowedOutline(contours, confidence, rivals, without)


def _searched(frames: Frames, hint: Hint, told: Told) -> tuple[dict[int, Outline], dict[int, str]]:
    """Outlines, and reasons for none, by the number of the image."""
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
    return found, without


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
            f"{1e3 * last.radius:.1f} mm: another one"
        )
    return outline


def _rivals(frames: Frames, i: int, outline: Outline, hint: Hint) -> tuple[RivalRegion, ...]:
    image, scale = frames.images[i], frames.m_per_px
    found = rivals_of(image, scale, outline, radius=hint.radius, bright=hint.bright)
    return tuple(replace(r, share=min(r.share, 1.0)) for r in found if r.share >= SIMILAR)
