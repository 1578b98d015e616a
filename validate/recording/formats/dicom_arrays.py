"""What DICOM images hold, by pydicom, in a process of its own; JPEG by Pillow.

Colour is made grey by ITU-R BT.601's luma, as a screen's operator sees it.
"""

import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pydicom
from numpy.typing import NDArray
from pydicom.pixels.processing import apply_color_lut
from pydicom.pixels.utils import iter_pixels
from pydicom.uid import DeflatedExplicitVRLittleEndian

from validate.errors import RecordingError, UsageError
from validate.recording.formats.sequence import MAX_PIXELS

_LACKS = ("missing dependencies", "does not support")  # as a codec says that it is none for these
_LUMA = np.array([0.299, 0.587, 0.114])
_META = 144  # bytes before the group of meta information that states its length, and of that
_PACKED = 2**28  # bytes of a file that is packed as a whole
_CM = 3  # PS3.3 C.8.5.5.1.15: physical units, cm
_CONFIG = pydicom.config
_CONFIG.settings.reading_validation_mode = _CONFIG.IGNORE


def arrays(path: Path) -> dict[str, NDArray[Any]]:
    """`images` (n, h, w) uint8, `t` (n,) s or none, `timed` by what, `regions` (k, 8), `spacing`
    (x, y) mm or none, `told` texts key by key.

    A region is left, top, right, bottom (px), the sides of a pixel x, y (m, NaN: no length), its
    spatial format and data type. Raises `RecordingError` for what is no 8-bit image.
    """
    _require_few_bytes(path)
    ds = pydicom.dcmread(path)
    if "PixelData" not in ds:
        raise RecordingError(f"no image in it: {ds.get('SOPClassUID', 'no class')}")
    images = _images(ds)
    t, timed = _times(ds, len(images))
    return {
        "images": images,
        "t": t,
        "timed": np.array(timed),
        "regions": np.array([_region(r) for r in ds.get("SequenceOfUltrasoundRegions", ())]),
        "spacing": np.array(list(ds.get("PixelSpacing") or ())[::-1], dtype=np.float64),
        "told": np.array([f"{k}: {ds.get(k)}" for k in _TOLD if ds.get(k) not in (None, "")]),
    }


def _require_few_bytes(path: Path) -> None:
    """Raises `RecordingError` for a file that is packed as a whole and unpacks to too much: its
    library unpacks it before it looks at it."""
    meta = pydicom.filereader.read_file_meta_info(path)
    if meta.get("TransferSyntaxUID") != DeflatedExplicitVRLittleEndian:
        return
    packed = path.read_bytes()[_META + int(meta.get("FileMetaInformationGroupLength", 0)) :]
    unpack, size = zlib.decompressobj(-zlib.MAX_WBITS), 0
    while packed and not unpack.eof and size <= _PACKED:
        size += len(unpack.decompress(packed, 2**20))
        packed = unpack.unconsumed_tail
    if size > _PACKED:
        raise RecordingError(f"it unpacks to over {_PACKED} bytes; save it without deflate")


_TOLD = ("Modality", "Manufacturer", "ManufacturerModelName", "TransducerData", "NumberOfFrames",
         "PhotometricInterpretation")  # fmt: skip


def _images(ds: pydicom.Dataset) -> NDArray[np.uint8]:
    count = int(ds.get("NumberOfFrames") or 1)
    shape = (count, int(ds.Rows), int(ds.Columns))
    if int(np.prod(shape)) > MAX_PIXELS:
        raise RecordingError(f"{shape} pixels, the limit is {MAX_PIXELS}; split the sequence")
    out = np.empty(shape, np.uint8)
    made = 0
    for made, image in enumerate(_frames(ds), start=1):
        out[made - 1] = _grey(ds, image)
    if made != count:
        raise RecordingError(f"{made} of {count} images can be read: cut or damaged")
    return out


def _frames(ds: pydicom.Dataset) -> Iterator[NDArray[Any]]:
    name = ds.file_meta.TransferSyntaxUID.name if ds.file_meta.get("TransferSyntaxUID") else "none"
    try:
        yield from iter_pixels(ds)
    except (NotImplementedError, RuntimeError) as error:
        lacks = any(words in str(error) for words in _LACKS)
        if lacks or isinstance(error, NotImplementedError):
            raise UsageError(
                f"its pixels are in '{name}', which no permissively licensed library here decodes; "
                "make it uncompressed first, as by `dcmdjpeg x.dcm y.dcm` or `gdcmconv --raw`"
            ) from None
        raise


def _grey(ds: pydicom.Dataset, image: NDArray[Any]) -> NDArray[np.uint8]:
    if ds.PhotometricInterpretation == "PALETTE COLOR":
        image = _eight_bits(ds, apply_color_lut(image, ds))
    if image.dtype != np.uint8:
        raise RecordingError(
            f"pixels of {image.dtype}; only 8-bit images are read; export "
            "it as PNG or TIFF of 16 bits, which come in as image-stack"
        )
    if image.ndim == 3:
        image = np.rint(image @ _LUMA).astype(np.uint8)
    return 255 - image if ds.PhotometricInterpretation == "MONOCHROME1" else image


def _eight_bits(ds: pydicom.Dataset, image: NDArray[Any]) -> NDArray[Any]:
    """Colours of a 16-bit table hold 8 bits: in their upper byte, or in the lower one where a
    program wrote them so, or in the other byte order."""
    if image.dtype != np.uint16:
        return image
    plain = ds.get("RedPaletteColorLookupTableData")  # else it is stored in segments
    table = image if plain is None else np.frombuffer(plain, "<u2")
    return (image >> (8 if int(table.max(initial=0)) > 255 else 0)).astype(np.uint8)


def _times(ds: pydicom.Dataset, count: int) -> tuple[NDArray[np.float64], str]:
    """Seconds (n,) from the first image and the field that tells; empty where none does."""
    if count == 1:
        return np.zeros(1), "one image"
    vector = ds.get("FrameTimeVector")
    if vector is not None and len(vector) == count:
        steps = 1e-3 * np.array([0.0, *(float(v) for v in list(vector)[1:])], dtype=np.float64)
        return steps.cumsum(), "FrameTimeVector"
    for field, factor in (("FrameTime", 1e-3), ("ActualFrameDuration", 1e-3)):
        if float(ds.get(field) or 0) > 0:
            return np.arange(count, dtype=np.float64) * (factor * float(ds.get(field))), field
    for field in ("CineRate", "RecommendedDisplayFrameRate"):
        if float(ds.get(field) or 0) > 0:
            return np.arange(count, dtype=np.float64) / float(
                ds.get(field)
            ), f"{field}, the rate of display"
    return np.zeros(0), "nothing"


def _region(r: pydicom.Dataset) -> list[float]:
    unit = {_CM: 0.01}
    fx = unit.get(int(r.get("PhysicalUnitsXDirection") or 0), np.nan)
    fy = unit.get(int(r.get("PhysicalUnitsYDirection") or 0), np.nan)
    return [
        float(r.RegionLocationMinX0), float(r.RegionLocationMinY0),
        float(r.RegionLocationMaxX1), float(r.RegionLocationMaxY1),
        fx * abs(float(r.get("PhysicalDeltaX") or np.nan)),
        fy * abs(float(r.get("PhysicalDeltaY") or np.nan)),
        float(r.get("RegionSpatialFormat") or 0), float(r.get("RegionDataType") or 0),
    ]  # fmt: skip
