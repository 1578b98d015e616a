"""Pixels of DICOM images by pydicom in a subprocess; JPEG by Pillow, lossless by GDCM.

Colour is made grey by ITU-R BT.601's luma, as a screen's operator sees it.
"""

import zlib
from collections import Counter
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pydicom
from numpy.typing import NDArray
from pydicom.pixels.processing import apply_color_lut
from pydicom.pixels.utils import iter_pixels, pixel_array
from pydicom.uid import (
    DeflatedExplicitVRLittleEndian,
    JPEG2000TransferSyntaxes,
    JPEGLossless,
    JPEGLosslessSV1,
    JPEGLSLossless,
    JPEGLSNearLossless,
    JPEGTransferSyntaxes,
)

from validate.errors import RecordingError, UsageError
from validate.files import read_bytes
from validate.recording.images.dicom import files_of
from validate.recording.images.image import luma
from validate.recording.images.sequence import MAX_PIXELS

_LACKS = ("missing dependencies", "does not support")  # as a codec says that it is none for these
_LOSSLESS = (JPEGLossless, JPEGLosslessSV1, JPEGLSLossless, JPEGLSNearLossless)
_HALF = "YBR_FULL_422"  # half of the colours
_META = 144  # bytes before the group of meta information that states its length, and of that
_PACKED = 2**28  # bytes of a file that is packed as a whole
_BY_PLACE = (0x3004000C, 0x00540080)  # GridFrameOffsetVector, SliceVector
_CM = 3  # PS3.3 C.8.5.5.1.15: physical units, cm
_CONFIG = pydicom.config
_CONFIG.settings.reading_validation_mode = _CONFIG.IGNORE


def arrays(path: Path) -> dict[str, NDArray[Any]]:
    """`images` (n, h, w) in grey of 8 or 16 bits, `t` (n,) s or none, `timed` by what, `regions`
    (k, 8), `spacing` (x, y) mm or none, `told` texts key by key; of a folder its one series.

    A region is left, top, right, bottom (px), the sides of a pixel x, y (m, NaN: no length), its
    spatial format and data type. Raises `RecordingError` for what is no such image, or no series.
    """
    sets = _series(path) if path.is_dir() else [_read(path)]
    if len(sets) == 1:
        # Refuse images of one file that lie behind each other: by the vector that counts them
        # (PS3.3 C.7.6.6.1), their dimensions or places (C.7.6.16, C.7.6.17), or a distance
        # without times.
        ds = sets[0]
        count = int(ds.get("NumberOfFrames") or 1)
        frames = ds.get("PerFrameFunctionalGroupsSequence", ())
        places = {str(p.get("ImagePositionPatient")) for f in frames
                  for p in f.get("PlanePositionSequence", ())}  # fmt: skip
        distance = float(ds.get("SpacingBetweenSlices") or 0)
        why = {
            "spaced by distance": ds.get("FrameIncrementPointer") in _BY_PLACE,
            "organised in 3D": ds.get("DimensionOrganizationType") == "3D",
            f"of {len(places)} places": len(places) > 1,
            f"{distance:g} mm between slices, without times": distance > 0
            and not len(_times(ds, count)[0]),
        }
        found = next((text for text, holds in why.items() if holds), "")
        if count > 1 and found:
            raise RecordingError(f"{count} slices of a volume ({found}), not images over time")
    images = _images(sets)
    t, timed = _moments(sets) if len(sets) > 1 else _times(sets[0], len(images))
    ds = sets[0]
    # Between rows and columns, mm: of the image, or of all its frames alike.
    shared = (m for s in ds.get("SharedFunctionalGroupsSequence", ())
              for m in s.get("PixelMeasuresSequence", ()))  # fmt: skip
    spacing = next(shared, ds).get("PixelSpacing") or ()
    return {
        "images": images,
        "t": t,
        "timed": np.array(timed),
        "regions": np.array([_region(r) for r in ds.get("SequenceOfUltrasoundRegions", ())]),
        "spacing": np.array(list(spacing)[::-1], dtype=np.float64),
        "told": np.array([f"{k}: {ds.get(k)}" for k in _TOLD if ds.get(k) not in (None, "")]),
    }


def _read(path: Path) -> pydicom.Dataset:
    _require_few_bytes(path)
    ds = pydicom.dcmread(path)
    if "PixelData" not in ds:
        raise RecordingError(f"no image in it: {ds.get('SOPClassUID', 'no class')}")
    return ds


def _series(folder: Path) -> list[pydicom.Dataset]:
    """The files of a folder in the order of their instance numbers, one image each, all of one
    series and of one place."""
    sets = [_read(file) for file in files_of(folder)]
    series = Counter(str(ds.get("SeriesInstanceUID")) for ds in sets)
    if len(series) > 1:
        raise RecordingError(
            f"{len(series)} series in one folder, of {sorted(series.values())} files; put each "
            f"into a separate folder"
        )
    many = sum(int(ds.get("NumberOfFrames") or 1) > 1 for ds in sets)
    if many and len(sets) > 1:
        raise RecordingError(f"{many} files of several images each; import them one by one")
    places = {str(ds.get("ImagePositionPatient") or ds.get("SliceLocation")) for ds in sets}
    if len(places) > 1:
        raise RecordingError(
            f"{len(sets)} images of {len(places)} places: slices of a volume, not images over time"
        )
    numbers = [ds.get("InstanceNumber") for ds in sets]
    if None in numbers or len(set(numbers)) < len(sets):
        raise RecordingError(f"{len(set(numbers))} instance numbers of {len(sets)} files")
    return sorted(sets, key=lambda ds: int(ds.InstanceNumber))


def _moments(sets: list[pydicom.Dataset]) -> tuple[NDArray[np.float64], str]:
    """Seconds (n,) of one image each, by the first field that all have and that goes forward."""
    for field in ("AcquisitionDateTime", "AcquisitionTime", "ContentTime"):
        try:
            t = np.array([_second(str(ds[field].value)) for ds in sets])
        except (KeyError, ValueError):
            continue
        if (np.diff(t) > 0).all():
            return t - t[0], field
    return np.zeros(0), "nothing"


def _second(text: str) -> float:
    """Of a time HHMMSS.F, or of a date before it, in its day (PS3.5 6.2, TM and DT)."""
    clock = text.partition("+")[0].partition(".")
    digits = clock[0][-6:]
    seconds = int(digits[:2]) * 3600 + int(digits[2:4]) * 60 + int(digits[4:6])
    return seconds + float(f"0.{clock[2] or 0}")


def _require_few_bytes(path: Path) -> None:
    """Raises `RecordingError` for a file that is packed as a whole and unpacks to too much: its
    library unpacks it before it looks at it."""
    meta = pydicom.filereader.read_file_meta_info(path)
    if meta.get("TransferSyntaxUID") != DeflatedExplicitVRLittleEndian:
        return
    packed = read_bytes(path)[_META + int(meta.get("FileMetaInformationGroupLength", 0)) :]
    unpack, size = zlib.decompressobj(-zlib.MAX_WBITS), 0
    while packed and not unpack.eof and size <= _PACKED:
        size += len(unpack.decompress(packed, 2**20))
        packed = unpack.unconsumed_tail
    if size > _PACKED:
        raise RecordingError(f"it unpacks to over {_PACKED} bytes; save it without deflate")


_TOLD = ("Modality", "Manufacturer", "ManufacturerModelName", "TransducerData", "NumberOfFrames",
         "PhotometricInterpretation")  # fmt: skip


def _images(sets: list[pydicom.Dataset]) -> NDArray[Any]:
    count = sum(int(ds.get("NumberOfFrames") or 1) for ds in sets)
    shape = (count, int(sets[0].Rows), int(sets[0].Columns))
    if int(np.prod(shape)) > MAX_PIXELS:
        raise RecordingError(f"{shape} pixels, the limit is {MAX_PIXELS}; split the sequence")
    sizes = {(int(ds.Rows), int(ds.Columns)) for ds in sets}
    if len(sizes) > 1:
        raise RecordingError(f"images of different sizes {sorted(sizes)}")
    out = np.empty(shape, np.uint8)
    made = 0
    for made, image in enumerate((_grey(ds, i) for ds in sets for i in _frames(ds)), start=1):
        if made > count:
            raise RecordingError(f"more images than the {count} that its header declares; damaged")
        if made == 1:
            out = out.astype(image.dtype)
        out[made - 1] = image
    if made != count:
        raise RecordingError(f"{made} of {count} images can be read: truncated or damaged")
    return out


def _frames(ds: pydicom.Dataset) -> Iterator[NDArray[Any]]:
    name = ds.file_meta.TransferSyntaxUID.name if ds.file_meta.get("TransferSyntaxUID") else "none"
    try:
        if ds.PhotometricInterpretation == _HALF and not ds["PixelData"].is_undefined_length:
            # Its library loses count of such images from the second on when it goes through them.
            count = int(ds.get("NumberOfFrames") or 1)
            yield from (pixel_array(ds, index=i) for i in range(count))
        else:
            # By this library, whatever else is installed; "" for pydicom's own.
            syntax, codec = ds.file_meta.get("TransferSyntaxUID"), ""
            if syntax in _LOSSLESS:
                import_module("gdcm")  # its absence is told with what to install
                codec = "gdcm"
            elif syntax in (*JPEGTransferSyntaxes, *JPEG2000TransferSyntaxes):
                codec = "pillow"
            yield from iter_pixels(ds, decoding_plugin=codec)
    except (NotImplementedError, RuntimeError) as error:
        lacks = any(words in str(error) for words in _LACKS)
        if lacks or isinstance(error, NotImplementedError):
            instead = "decompress it first, as with `dcmdjpeg x.dcm y.dcm` or `gdcmconv --raw`"
            if "MPEG" in name or "HEVC" in name:
                instead = ("they are a video: extract it, as with `gdcmraw -i x.dcm -o x.mp4`, and "
                           "import that")  # fmt: skip
            raise UsageError(
                f"its pixels are in '{name}', which no permissively licensed library decodes; "
                f"{instead}"
            ) from None
        raise


def _grey(ds: pydicom.Dataset, image: NDArray[Any]) -> NDArray[Any]:
    if ds.PhotometricInterpretation == "PALETTE COLOR":
        # Colours of a 16-bit table hold 8 bits: in their upper byte, or in the lower one where a
        # program wrote them so, or in the other byte order.
        image = apply_color_lut(image, ds)
        if image.dtype == np.uint16:
            plain = ds.get("RedPaletteColorLookupTableData")  # else it is stored in segments
            table = image if plain is None else np.frombuffer(plain, "<u2")
            image = (image >> (8 if int(table.max(initial=0)) > 255 else 0)).astype(np.uint8)
    if image.dtype not in (np.uint8, np.uint16, np.int16):
        raise RecordingError(f"pixels of {image.dtype}; those of 8 and 16 bits are read")
    if image.ndim == 3:
        image = luma(image)
    if ds.PhotometricInterpretation == "MONOCHROME1":
        return np.asarray(2 ** int(ds.BitsStored) - 1 - image, dtype=image.dtype)
    return image


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
