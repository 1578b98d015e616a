"""Pictures as cameras and recorders pack them (PNG, JPEG, TIFF, BMP), made grey. Owns Pillow here.

For images of others: ours are PNG, grey, and checked chunk by chunk in `image`.
"""

import io
import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from validate.errors import RecordingError
from validate.recording.images.image import MAX_SIDE

FORMATS = ("PNG", "JPEG", "TIFF", "BMP")
# Whatever Pillow raises on damage; a bomb is none of its other errors.
_DAMAGE = (OSError, ValueError, SyntaxError, Warning, EOFError, MemoryError,
           Image.DecompressionBombError)  # fmt: skip
_DEEP = "I;16"  # Pillow's mode, in either order of bytes


def decode_picture(data: bytes) -> NDArray[Any]:
    """The image (h, w) uint8, colour by ITU-R BT.601's luma; uint16 of grey so deep.

    Raises `RecordingError` for a picture of another format, over `MAX_SIDE`, deeper, cut or
    damaged.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # of bombs and of broken tags
            with Image.open(io.BytesIO(data), formats=FORMATS) as opened:
                _require_small(opened)
                if opened.mode.startswith(_DEEP):
                    return np.asarray(opened).astype(np.uint16)
                return np.asarray(opened.convert("L"), dtype=np.uint8).copy()
    except UnidentifiedImageError:
        raise RecordingError(
            f"{len(data)} bytes are not an image; expected {', '.join(FORMATS)}"
        ) from None
    except RecordingError:
        raise
    except _DAMAGE as error:
        raise RecordingError(f"damaged image ({' '.join(str(error).split())[:120]})") from None


def _require_small(picture: Image.Image) -> None:
    width, height = picture.size
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        raise RecordingError(f"image of {width} x {height} px, allowed 1..{MAX_SIDE} per side")
    if picture.mode in ("I", "F"):
        raise RecordingError(f"an image of mode {picture.mode}: over 16 bits; save 16-bit grey")
