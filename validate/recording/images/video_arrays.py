"""Grey frames of a video, decoded by OpenCV in a subprocess."""

import os
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.errors import RecordingError

LIBRARIES = ("cv2",)
MOST = 400 * 2**20  # bytes of all frames together


def arrays(path: Path, every: float = 1) -> dict[str, NDArray[Any]]:
    """`images` (nt, h, w) uint8 of every so many frames, `t` (nt,) s as the container stamps them,
    `rate` Hz as it declares it, `declared` and `decoded` counts of frames, whether any is `colour`.

    Raises `RecordingError` for a file without frames, for frames beyond `MOST` bytes, and for
    pixels that are not square.
    """
    import cv2

    declared = (cv2.CAP_PROP_FRAME_COUNT, cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)
    video = _opened(path)
    _require_square(video.get(cv2.CAP_PROP_SAR_NUM), video.get(cv2.CAP_PROP_SAR_DEN))
    count, width, height = (video.get(key) for key in declared)
    _require_few(count, width, height, every)
    images, t, made, colour = [], [], 0, False
    while video.isOpened():
        done, frame = video.read()
        if not done:
            break
        stamp = video.get(cv2.CAP_PROP_POS_MSEC)  # of the frame just read
        if made % int(every) == 0:
            shade = np.ptp(frame[::8, ::8].astype(np.int16), axis=2) if frame.ndim == 3 else [0]
            colour = colour or float(np.max(shade)) > _GREY
            images.append(cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY) if frame.ndim == 3 else frame)
            t.append(1e-3 * stamp)
        made += 1
        if sum(image.size for image in images[:1]) * len(images) > MOST:
            raise RecordingError(
                f"frames of {images[0].shape[1]} x {images[0].shape[0]} beyond {MOST} bytes after "
                f"{made}; read fewer with --map every=10, or shorten the video"
            )
    if not images:
        raise RecordingError("no frame can be decoded: truncated, damaged, or not a video")
    return {
        "images": np.stack(images),
        "t": np.array(t),
        "rate": np.array(video.get(cv2.CAP_PROP_FPS)),
        "declared": np.array(video.get(cv2.CAP_PROP_FRAME_COUNT)),
        "decoded": np.array(made),
        "colour": np.array(colour),
    }


def _opened(path: Path) -> Any:
    """The video, by a name of ours: FFmpeg takes one with % for a row of pictures. One thread: each
    takes address space, and a machine has many cores."""
    import cv2

    os.environ["OPENCV_FFMPEG_CAPTURE_OPTIONS"] = "protocol_whitelist;file"
    with TemporaryDirectory(prefix="validate-") as folder:
        link = Path(folder) / "video"
        link.symlink_to(path.resolve())
        return cv2.VideoCapture(str(link), cv2.CAP_FFMPEG, [cv2.CAP_PROP_N_THREADS, 1])


def _require_few(count: float, width: float, height: float, every: float) -> None:
    """What is declared, before anything is decoded: packed, it may be small."""
    if width * height * (count // every) > MOST:
        raise RecordingError(
            f"it declares {count:.0f} frames of {width:.0f} x {height:.0f}, beyond {MOST} bytes; "
            "take fewer: --map every=10, or cut it"
        )


def _require_square(wide: float, high: float) -> None:
    if wide > 0 and high > 0 and wide != high:
        raise RecordingError(
            f"its pixels are {wide:g}:{high:g}, not square; convert them first, as with `ffmpeg "
            f"-i IN -vf scale=iw*sar:ih,setsar=1 OUT.mp4`"
        )


_GREY = 24  # levels between channels that a codec makes of grey
