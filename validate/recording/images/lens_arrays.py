"""Camera calibration files (OpenCV YAML, XML, JSON; ROS YAML), read by OpenCV in a subprocess.

The YAML of ROS' camera_calibration lacks OpenCV's first line.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.errors import RecordingError
from validate.files import read_text

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

    text = _text(path)
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


def _text(path: Path) -> str:
    text = read_text(path, _MOST)
    plain = text.lstrip()
    return text if plain.startswith(("%YAML", "<", "{")) else f"%YAML:1.0\n---\n{plain}"


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
