"""Images deeper than 8 bits, made 8, and how they became so."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.errors import RecordingError
from validate.recording.formats.options import above_zero
from validate.recording.images.image import MAX_SIDE, Pixels
from validate.recording.reader import Options

_LUMA = np.array([0.299, 0.587, 0.114])  # ITU-R BT.601
AS_IT_IS = "8 bits as recorded"


def luma(colour: NDArray[Any]) -> NDArray[Any]:
    """Grey (..., h, w) of red, green and blue (..., h, w, 3 or more), as an operator sees them."""
    return np.asarray(np.rint(colour[..., :3] @ _LUMA), dtype=colour.dtype)


def shallow(deep: Sequence[NDArray[Any]], options: Options) -> tuple[tuple[Pixels, ...], str]:
    """The images (h, w) in 8 bits, and in words how they became so: the level `white` of the
    options, or the largest of all, became 255.

    Raises `RecordingError` for an image beyond `MAX_SIDE`, and levels below 0 or above all numbers;
    `UsageError` for a `white` that is no number above 0.
    """
    for image in deep:
        if max(image.shape) > MAX_SIDE:
            raise RecordingError(f"an image of {image.shape[1]} x {image.shape[0]} px, the limit "
                                 f"is {MAX_SIDE} per side")  # fmt: skip
    if all(image.dtype == np.uint8 for image in deep):
        return tuple(np.ascontiguousarray(image) for image in deep), AS_IT_IS
    low, top = _range(deep)
    if low < 0 or not np.isfinite(top):
        raise RecordingError(f"levels from {low:g} to {top:g}; save them from 0 on")
    white = above_zero(options, "white") if "white" in options else top or 1.0
    bits = "floating point" if any(image.dtype.kind == "f" for image in deep) else "16 bits"
    said = "entered" if "white" in options else "the largest"
    told = f"{bits} converted to 8: 0 to {white:g} ({said}) became 0 to 255"
    return tuple(_scaled(image, white) for image in deep), told


def _range(deep: Sequence[NDArray[Any]]) -> tuple[float, float]:
    """The least and the largest level; a NaN is black."""
    known = [np.nan_to_num(image, nan=0.0, posinf=np.inf, neginf=-np.inf) for image in deep]
    return float(min(image.min() for image in known)), float(max(image.max() for image in known))


def _scaled(image: NDArray[Any], white: float) -> Pixels:
    levels = np.clip(np.nan_to_num(image) * (255 / white), 0, 255)
    return np.asarray(np.rint(levels), dtype=np.uint8)
