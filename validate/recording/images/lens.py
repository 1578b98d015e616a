"""Lens distortion: correction of images by the camera's calibration.

Camera calibration files (OpenCV YAML, XML, JSON; ROS YAML), read by OpenCV in a subprocess.

The YAML of ROS' camera_calibration lacks OpenCV's first line.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.errors import RecordingError, UsageError
from validate.files import read_text
from validate.recording.formats.subprocess_decoder import decoded
from validate.recording.images.image import Pixels, undistorted
from validate.recording.reader import Options, require_readable

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
    found = decoded("validate.recording.images.lens", path)
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
