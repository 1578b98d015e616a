"""Compressed images of cameras (PNG, JPEG, TIFF, BMP) as grey images, by Pillow.

For images of others: ours are PNG, grey, and checked chunk by chunk in `image`.
"""

import io
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from validate.errors import RecordingError
from validate.recording.images.image import MAX_SIDE, demosaiced, luma

# --- Images as cameras send them, unpacked bytes with the name of their encoding, made grey.
#
# Names as ROS 2 (`sensor_msgs/image_encodings`) and Foxglove (`RawImage`) write them. Numbers
# that are no brightness (32FC1: distances) are no image here.

_CHANNELS = {"mono8": 1, "8UC1": 1, "rgb8": 3, "bgr8": 3, "8UC3": 3, "rgba8": 4, "bgra8": 4}
_DEEP_ENCODINGS = {"mono16": 1, "16UC1": 1, "rgb16": 3, "bgr16": 3, "rgba16": 4, "bgra16": 4}
_BRIGHTNESS = {"yuv422": 1, "uyvy": 1, "yuv422_yuy2": 0, "yuyv": 0}  # its byte of every pair
_BAYER = {f"bayer_{order}{bits}": (order.upper(), bits // 8)
          for order in ("rggb", "bggr", "gbrg", "grbg") for bits in (8, 16)}  # fmt: skip


@dataclass(frozen=True)
class RawImage:
    """Rows of `step` bytes; numbers of two bytes end with the lower one where `big`."""

    encoding: str
    height: int
    width: int
    step: int
    data: bytes
    big: bool


def grey(image: RawImage) -> NDArray[Any]:
    """Return the image (h, w), uint8 or uint16; colour by its luma.

    Raises `RecordingError` for an encoding of other kinds, and too few bytes.
    """
    if image.encoding in _BRIGHTNESS:
        return _numbers(image, 2, 1)[..., _BRIGHTNESS[image.encoding]].copy()
    if image.encoding in _BAYER:
        order, size = _BAYER[image.encoding]
        return demosaiced(np.ascontiguousarray(_numbers(image, 1, size)[..., 0]), order)
    if image.encoding in _CHANNELS:
        return _luma(_numbers(image, _CHANNELS[image.encoding], 1), image.encoding)
    if image.encoding in _DEEP_ENCODINGS:
        return _luma(_numbers(image, _DEEP_ENCODINGS[image.encoding], 2), image.encoding)
    raise RecordingError(
        f"encoding '{image.encoding}'; expected grey, colour or bayer of 8 or 16 bits, or yuv422"
    )


def _numbers(image: RawImage, channels: int, size: int) -> NDArray[Any]:
    """Numbers (h, w, channels) of `size` bytes, without what fills the rows."""
    wide, height, step = image.width * channels * size, image.height, image.step
    if step < wide or len(image.data) < height * step or min(height, image.width) < 1:
        raise RecordingError(
            f"{len(image.data)} bytes for {image.width} x {height} px of {channels}; truncated"
        )
    rows = np.frombuffer(image.data, np.uint8, height * step).reshape(height, step)
    numbers = np.ascontiguousarray(rows[:, :wide]).view(f"{'>' if image.big else '<'}u{size}")
    return numbers.reshape(height, image.width, channels).astype(f"u{size}")


def _luma(pixels: NDArray[Any], encoding: str) -> NDArray[Any]:
    if pixels.shape[-1] == 1:
        return np.ascontiguousarray(pixels[..., 0])
    colour = pixels[..., 2::-1] if encoding.startswith("b") else pixels[..., :3]
    return luma(colour)


# -------------------------------------------------------------------------------------------------

FORMATS = ("PNG", "JPEG", "TIFF", "BMP")
# Whatever Pillow raises on damage; a bomb is none of its other errors.
_DAMAGE = (OSError, ValueError, SyntaxError, Warning, EOFError, MemoryError,
           Image.DecompressionBombError)  # fmt: skip
_DEEP = "I;16"  # Pillow's mode, in either order of bytes


def decode_picture(data: bytes) -> NDArray[Any]:
    """Return the image (h, w) uint8, colour by ITU-R BT.601's luma; uint16 of grey so deep.

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
