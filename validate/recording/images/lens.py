"""Lens distortion: correction of images by the camera's calibration."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from validate.errors import RecordingError, UsageError
from validate.recording.formats.subprocess_decoder import decoded
from validate.recording.images.image import Pixels, undistorted
from validate.recording.reader import Options, require_readable

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
    found = decoded("validate.recording.images.lens_arrays", path)
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
