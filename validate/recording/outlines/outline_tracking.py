"""Tracking of an outline through the images of a recording, and its ambiguities.

The first image is searched from what the user says of the place; each next one from where the
outline was last. What of the first image might be meant as well is named and lowers the confidence.
An image without an outline is left out and said; more without than with one is an error.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import floor

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats, rms
from validate.errors import RecordingError
from validate.recording.outlines.outline import (
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
    rivals, beside = _rivals(frames, first, found[first], hint)
    doubt = 1 - max((r.share for r in rivals), default=0.0) / 2
    each = np.array([(EXPERTS * o.sd, doubt * o.closed * o.contrast) for o in found.values()])
    _require_sure(rivals, float(each[0, 1]), least)
    contours = Contours(
        frames.t[list(found)], tuple(o.points for o in found.values()),
        rms(each[:, 0]), frames.pose, frames.frame, images, each,
    )  # fmt: skip
    return FollowedOutline(contours, rivals, beside, without)


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


def _rivals(
    frames: Frames, i: int, outline: Outline, hint: Hint
) -> tuple[tuple[RivalRegion, ...], tuple[RivalRegion, ...]]:
    """Other regions as distinct: those that may be meant, and those beside the centre that was
    said, which neither hold it nor are nearer to it than the outline."""
    image, scale = frames.images[i], frames.m_per_px
    found = rivals_of(image, scale, outline, radius=hint.radius, bright=hint.bright)
    alike = [replace(r, share=min(r.share, 1.0)) for r in found if r.share >= SIMILAR]
    if hint.centre is None:
        return tuple(alike), ()
    said, own = hint.centre, float(np.linalg.norm(outline.centre - hint.centre))
    near = [bool(np.linalg.norm(r.centre - said) < max(r.radius, own)) for r in alike]
    meant = tuple(r for r, at in zip(alike, near, strict=True) if at)
    return meant, tuple(r for r, at in zip(alike, near, strict=True) if not at)


def _require_sure(rivals: tuple[RivalRegion, ...], confidence: float, least: float) -> None:
    if rivals and confidence < least:
        named = "; ".join(r.words for r in rivals)
        raise RecordingError(
            f"the outline has confidence {confidence:.2f}, but {least:g} is needed, as other "
            f"regions are as distinct: {named}; choose one (--centre X,Y) or accept it "
            f"(--confidence {floor(100 * confidence) / 100:g})"
        )
