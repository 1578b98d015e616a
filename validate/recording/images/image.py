"""8-bit grey images: PNG within bounds, lens distortion, filters, area fraction of an outline.

A PNG is checked before OpenCV sees it: signature, size declared in IHDR, CRC of every chunk,
length of the unpacked pixels. OpenCV returns half an image for a cut file and prints to standard
error; only the chunks that make the picture are handed on. OpenCV is loaded by its first use: 16
MB that a recording without images is inspected without.
"""

import struct
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats
from validate.errors import RecordingError, UsageError
from validate.files import read_text
from validate.recording.formats.subprocess_decoder import decoded
from validate.recording.reader import Options, above_zero, require_readable

Pixels = NDArray[np.uint8]

MAX_SIDE = 4096  # px
_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_CHANNELS = {0: 1, 2: 3, 4: 2, 6: 4}  # PNG colour type -> samples a pixel
_MOSAIC = 4  # px a side


@dataclass(frozen=True)
class _Header:
    width: int
    height: int
    channels: int


def encode_png(image: Pixels) -> bytes:
    """Return a grey image (h, w) uint8 as PNG; raises `RecordingError` for other arrays or
    sizes."""
    import cv2

    if image.dtype != np.uint8 or image.ndim != 2:
        raise RecordingError(f"image {image.shape} {image.dtype}: expected (h, w) uint8")
    _require_size(image.shape[1], image.shape[0])
    done, data = cv2.imencode(".png", image)
    if not done:
        raise RecordingError(f"image {image.shape} cannot be encoded as PNG")
    return data.tobytes()


def decode_png(data: bytes) -> Pixels:
    """Return the grey image (h, w) uint8, read-only, of a PNG with 8 bits a sample.

    Colour is accepted where all pixels are grey (equal channels, opaque). Raises `RecordingError`
    for a damaged PNG, one over `MAX_SIDE`, interlaced, with a palette or of another depth.
    """
    import cv2

    # Header and packed pixels of a PNG whose chunks are whole.
    if not data.startswith(_SIGNATURE):
        raise RecordingError("not a PNG (wrong first bytes); only PNG images are read")
    header, parts, ended = None, list[bytes](), False
    for kind, content in _chunks(data):
        if header is None:
            header = _header(kind, content)
        elif kind == b"IDAT":
            parts.append(content)
        ended = kind == b"IEND"
    if header is None or not ended:
        raise RecordingError(f"damaged PNG: {len(data)} bytes without an end")
    packed = b"".join(parts)
    size = header.height * (1 + header.width * header.channels)
    unpacker = zlib.decompressobj()
    try:
        got = len(unpacker.decompress(packed, size + 1))
    except zlib.error as error:
        raise RecordingError(f"damaged PNG: its pixels cannot be unpacked ({error})") from None
    if got != size or not unpacker.eof:
        raise RecordingError(f"damaged PNG: {got} bytes of pixels, its header needs {size}")
    # The same picture without text, profiles and other chunks.
    start = len(_SIGNATURE) + 25
    plain = np.frombuffer(
        data[:start] + _chunk(b"IDAT", packed) + _chunk(b"IEND", b""), dtype=np.uint8
    )
    decoded = cv2.imdecode(plain, cv2.IMREAD_UNCHANGED)
    if decoded is None or decoded.shape[:2] != (header.height, header.width):
        raise RecordingError("damaged PNG: its pixels cannot be decoded")
    image = np.asarray(decoded, dtype=np.uint8)
    if image.ndim == 2:
        grey: Pixels = image
    else:
        coloured = int((image[..., 1:3] != image[..., :1]).any(axis=-1).sum())
        clear = int((image[..., 3] != 255).sum()) if image.shape[2] == 4 else 0
        if coloured or clear:
            raise RecordingError(
                f"{coloured} coloured and {clear} transparent pixels; remove the overlay and save "
                f"it as grey"
            )
        grey = np.ascontiguousarray(image[..., 0])
    grey.setflags(write=False)
    return grey


def png_size(data: bytes) -> tuple[int, int]:
    """Width and height px that the first bytes of a PNG declare; raises `RecordingError` for a PNG
    that `decode_png` does not take, or whose header fails its checksum."""
    if not data.startswith(_SIGNATURE):
        raise RecordingError("not a PNG (wrong first bytes); only PNG images are read")
    kind, content = next(_chunks(data), (b"", b""))
    header = _header(kind, content)
    return header.width, header.height


def _chunks(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    at = len(_SIGNATURE)
    while at < len(data):
        head = data[at : at + 8]
        length = int.from_bytes(head[:4], "big")
        end = at + 8 + length
        if len(head) < 8 or end + 4 > len(data):
            raise RecordingError(
                f"damaged PNG: truncated at byte {len(data)}, its chunk ends at {end}"
            )
        if zlib.crc32(data[at + 4 : end]) != int.from_bytes(data[end : end + 4], "big"):
            raise RecordingError(f"damaged PNG: wrong CRC of the chunk at byte {at}")
        yield head[4:], data[at + 8 : end]
        at = end + 4


def _header(kind: bytes, content: bytes) -> _Header:
    if kind != b"IHDR" or len(content) != 13:
        raise RecordingError("damaged PNG: it does not begin with a header")
    width, height, depth, colour, _, _, interlace = struct.unpack(">IIBBBBB", content)
    _require_size(width, height)
    if depth != 8 or colour not in _CHANNELS or interlace:
        raise RecordingError(
            f"PNG with {depth} bits, colour type {colour}, interlace {interlace}; "
            "save it as 8-bit grey, not interlaced"
        )
    return _Header(width, height, _CHANNELS[colour])


def _require_size(width: int, height: int) -> None:
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        raise RecordingError(f"image of {width} x {height} px, allowed 1..{MAX_SIDE} per side")


def _chunk(kind: bytes, content: bytes) -> bytes:
    crc = zlib.crc32(kind + content).to_bytes(4, "big")
    return len(content).to_bytes(4, "big") + kind + content + crc


def blurred(image: Floats, sd: tuple[float, float]) -> Floats:
    """Gaussian blur; sd (x, y) in pixels, 0 leaves that axis as it is."""
    import cv2

    sizes = [2 * int(np.ceil(3.5 * s)) + 1 for s in sd]
    out = cv2.sepFilter2D(
        image,
        cv2.CV_64F,
        cv2.getGaussianKernel(sizes[0], max(sd[0], 1e-3)),
        cv2.getGaussianKernel(sizes[1], max(sd[1], 1e-3)),
        borderType=cv2.BORDER_REFLECT,
    )
    return np.asarray(out, dtype=np.float64)


def shrunk(image: Floats, shape: tuple[int, int]) -> Floats:
    """Return the image (h, w) as means over the areas of `shape` (rows, columns) larger pixels."""
    import cv2

    small = cv2.resize(image, (shape[1], shape[0]), interpolation=cv2.INTER_AREA)
    return np.asarray(small, dtype=np.float64)


def correlated(image: Floats, kernel: Floats) -> Floats:
    """Return sums of the image under a centred kernel; the border pixels go on outside."""
    import cv2

    out = cv2.filter2D(image, cv2.CV_64F, kernel, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(out, dtype=np.float64)


def sampled(image: Floats, x: Floats, y: Floats) -> Floats:
    """Bilinear values at pixel places x, y (any shape); NaN outside the image."""
    import cv2

    values = cv2.remap(
        image.astype(np.float32),
        x.astype(np.float32),
        y.astype(np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    ).astype(np.float64)
    height, width = image.shape
    outside = (x < -0.5) | (y < -0.5) | (x > width - 0.5) | (y > height - 0.5)
    return np.asarray(np.where(outside, np.nan, values))


def ellipse_through(points: Floats) -> tuple[Floats, Floats, float]:
    """Centre (2,), half axes (2,) and turn rad of the least-squares ellipse of points (k, 2)."""
    import cv2

    scale = float(np.abs(points - points.mean(axis=0)).max())
    middle = points.mean(axis=0)
    plain = ((points - middle) / scale).astype(np.float32)
    (x, y), axes, degrees = cv2.fitEllipseDirect(plain)
    centre = middle + scale * np.array([x, y])
    return centre, scale * np.array(axes) / 2, float(np.deg2rad(degrees))


def demosaiced(mosaic: NDArray[Any], order: str) -> NDArray[Any]:
    """Return the luma (h, w) of an image behind colour filters, uint8 or uint16, whose first two
    rows begin with the colours of `order` ("RGGB"); raises `RecordingError` below 4 px a side."""
    import cv2

    if min(mosaic.shape) < _MOSAIC:
        raise RecordingError(f"a mosaic of {mosaic.shape}, at least {_MOSAIC} px per side")
    return np.asarray(cv2.cvtColor(mosaic, getattr(cv2, f"COLOR_Bayer{order}2GRAY")))


def undistorted(image: Pixels, K: Floats, D: Floats) -> Pixels:
    """Return the image (h, w) as a camera of the matrix K (3, 3) px without the distortion D (k,)
    sees it; what it did not see is black."""
    import cv2

    return np.asarray(cv2.undistort(image, K, D), dtype=np.uint8)


# --- Images deeper than 8 bits, made 8, and how they became so.

_LUMA = np.array([0.299, 0.587, 0.114])  # ITU-R BT.601
AS_IT_IS = "8 bits as recorded"


def luma(colour: NDArray[Any]) -> NDArray[Any]:
    """Grey (..., h, w) of red, green and blue (..., h, w, 3 or more), as an operator sees them."""
    return np.asarray(np.rint(colour[..., :3] @ _LUMA), dtype=colour.dtype)


def shallow(deep: Sequence[NDArray[Any]], options: Options) -> tuple[tuple[Pixels, ...], str]:
    """Return the images (h, w) in 8 bits, and in words how they became so: the level `white` of the
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
    # The least and the largest level; a NaN is black.
    known = [np.nan_to_num(image, nan=0.0, posinf=np.inf, neginf=-np.inf) for image in deep]
    low = float(min(image.min() for image in known))
    top = float(max(image.max() for image in known))
    if low < 0 or not np.isfinite(top):
        raise RecordingError(f"levels from {low:g} to {top:g}; save them from 0 on")
    white = above_zero(options, "white") if "white" in options else top or 1.0
    bits = "floating point" if any(image.dtype.kind == "f" for image in deep) else "16 bits"
    said = "entered" if "white" in options else "the largest"
    told = f"{bits} converted to 8: 0 to {white:g} ({said}) became 0 to 255"
    levels = (np.clip(np.nan_to_num(image) * (255 / white), 0, 255) for image in deep)
    return tuple(np.asarray(np.rint(level), dtype=np.uint8) for level in levels), told


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
            # Sorted x (2 m,) where the edges start -> end cross the line at y.
            y = row + offset
            cut = (start[:, 1] > y) != (end[:, 1] > y)
            a, b = start[cut], end[cut]
            crossings = np.sort(a[:, 0] + (y - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0]))
            for left, right in crossings.reshape(-1, 2):
                covered[row] += np.clip(right - pixels, 0, 1) - np.clip(left - pixels, 0, 1)
    return covered / lines


# --- lens distortion: correction of images by the camera's calibration ---------------------------

LIBRARIES = ("cv2",)
_MOST = 1_000_000  # bytes
_MATRIX = ("camera_matrix", "Camera_Matrix", "cameraMatrix", "K", "mtx")
_DISTORTION = ("distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "D", "dist")
_WIDTH, _HEIGHT = ("image_width", "image_Width"), ("image_height", "image_Height")
_ERROR = ("avg_reprojection_error", "Avg_Reprojection_Error")
_MODELS = ("", "plumb_bob", "rational_polynomial")


def arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Return the camera's matrix `K` (3, 3) px, distortion `D` (k,), `size` (w, h) px and
    reprojection `error` px; NaN of what is not stated. Raises `RecordingError` for other models of
    a lens."""
    import cv2

    text = read_text(path, _MOST)
    plain = text.lstrip()
    text = text if plain.startswith(("%YAML", "<", "{")) else f"%YAML:1.0\n---\n{plain}"
    file = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    model = file.getNode("distortion_model")
    if model.isString() and model.string() not in _MODELS:
        raise RecordingError(f"distortion model '{model.string()}'; expected plumb_bob or rational")
    if _number(file, ("fisheye_model",)) == 1:
        raise RecordingError("a fisheye model; expected the model of OpenCV's calibrateCamera")
    return {
        "K": _matrix(file, _MATRIX).reshape(3, 3),
        "D": _matrix(file, _DISTORTION).ravel(),
        "size": np.array([_number(file, _WIDTH), _number(file, _HEIGHT)]),
        "error": np.array(_number(file, _ERROR)),
    }


def _matrix(file: Any, names: tuple[str, ...]) -> NDArray[np.float64]:
    for name in names:
        node = file.getNode(name)
        if node.empty():
            continue
        if node.isMap() and not node.getNode("dt").empty():
            return np.asarray(node.mat(), dtype=np.float64)
        data = node.getNode("data") if node.isMap() else node  # as ROS writes it
        return np.array([data.at(i).real() for i in range(data.size())])
    raise RecordingError(f"it has no {names[0]}")


def _number(file: Any, names: tuple[str, ...]) -> float:
    found = (file.getNode(name) for name in names)
    return next((float(node.real()) for node in found if node.isReal() or node.isInt()), np.nan)


LENS = "lens"
_LENGTHS = (4, 5, 8, 12, 14)  # coefficients of OpenCV's model
_LARGEST = 10**6  # bytes of a calibration


def straightened(
    images: Sequence[Pixels], options: Options
) -> tuple[tuple[Pixels, ...], dict[str, str]]:
    """Return the images (h, w) without the distortion that the file `lens` of the options states,
    and what is told of it; as they are, and nothing, without that option.

    The file is one of OpenCV's calibration or of ROS' camera_calibration. A scale `m_per_px` then
    holds over a plane across the camera's axis. Raises `UsageError` for images of another size than
    the calibration's, `RecordingError` for a file that is none.
    """
    if LENS not in options:
        return tuple(images), {}
    path = Path(options[LENS])
    require_readable(path, _LARGEST)
    found = decoded("validate.recording.images.image", path)
    K, D, size = found["K"], found["D"], found["size"]
    if not (np.isfinite(K).all() and np.isfinite(D).all() and K[0, 0] > 0 and K[1, 1] > 0):
        raise RecordingError(f"{path.name}: focal lengths and distortion must be numbers, above 0")
    if len(D) not in _LENGTHS:
        raise RecordingError(
            f"{path.name}: {len(D)} coefficients of distortion; expected one of {_LENGTHS}"
        )
    sizes = {(image.shape[1], image.shape[0]) for image in images}
    if np.isfinite(size).all() and sizes != {tuple(int(v) for v in size)}:
        shown = ", ".join(f"{w} x {h}" for w, h in sorted(sizes))
        raise UsageError(
            f"{path.name}: calibrated for images of {size[0]:.0f} x {size[1]:.0f} px, these have "
            f"{shown}; calibrate at that size"
        )
    error = float(found["error"])
    known = f", reprojection error {error:.3g} px" if np.isfinite(error) else ""
    told = {LENS: f"straightened by {path.name} ({len(D)} coefficients{known})"}
    return tuple(undistorted(image, K, D) for image in images), told
