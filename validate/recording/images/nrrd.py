"""Reader of NRRD with the frames of the PLUS toolkit, like a MetaImage sequence."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.errors import RecordingError
from validate.recording.formats.subprocess_decoder import decoded
from validate.recording.images.sequence import MAX_PIXELS, OPTIONS, Sequence, by_frame, recorded
from validate.recording.reader import Options, Reader, head
from validate.recording.types import Recording

_MAGIC = b"NRRD000"


def read_nrrd(path: Path, options: Options) -> Recording:
    """Transforms and images of a sequence, as `sequence.recorded` has them.

    Raises `RecordingError` for a file that is cut, damaged, no NRRD, or of other pixels than grey
    of 8 or 16 bits; `UsageError` without the library, and as `recorded`.
    """
    if not path.is_file():
        raise RecordingError(
            f"{path}: no such file" if not path.exists() else f"{path}: not a file"
        )
    if not _recognises(path):
        raise RecordingError(f"{path.name}: not an NRRD file, or truncated in its first bytes")
    found = decoded("validate.recording.images.nrrd_arrays", path)
    keys, texts = found["keys"].tolist(), found["texts"].tolist()
    x, y = found["spacing"].tolist()
    fields = by_frame(zip(keys, texts, strict=True))
    images = _images(path, found["pixels"])
    way = dict(zip(keys, texts, strict=True)).get("UltrasoundImageOrientation", "")
    times = found["times"] if len(found["times"]) == len(images) else None
    deep = str(found["deep"])
    return recorded(path, Sequence(fields, images, (x, y), "NRRD", way, times, deep), options)


def _images(path: Path, pixels: NDArray[Any]) -> tuple[NDArray[Any], ...]:
    """Images n x (h, w) of pixels (w, h, 1, n), (w, h, n) or (w, h), x first."""
    if not pixels.size:
        return ()
    if pixels.ndim == 4 and pixels.shape[2] == 1:
        pixels = pixels[:, :, 0]
    whole = pixels.dtype.kind in "iu" and (pixels.dtype == np.uint8 or pixels.itemsize == 2)
    if not whole or pixels.ndim not in (2, 3) or pixels.nbytes > MAX_PIXELS:
        raise RecordingError(
            f"{path.name}: pixels {pixels.shape} {pixels.dtype}; images of 8 or 16-bit grey, one "
            f"px deep, up to {MAX_PIXELS} bytes are read"
        )
    stack = pixels if pixels.ndim == 3 else pixels[..., None]
    return tuple(np.ascontiguousarray(image.T) for image in np.moveaxis(stack, 2, 0))


def _recognises(path: Path) -> bool:
    return head(path, len(_MAGIC)) == _MAGIC


NRRD = Reader(
    "nrrd",
    "tracked sequence (NRRD)",
    _recognises,
    read_nrrd,
    "it begins with NRRD",
    options=OPTIONS,
    extensions=(".nrrd", ".nhdr"),
)
