"""Third-party outlines of the images of a recording: masks, tables of points, polygons.

Masks are PNG files (a folder, numbered; one for a single image), an array (n, h, w) in .npy or
.npz, or an NRRD (w, h, n), as segmentations are stored: what is not zero is inside, and the outline
runs half a pixel outside the outermost pixels' centres; an image without an outline has an empty
mask. Tables are CSV with the columns frame, x, y;
polygons JSON as LabelMe (`shapes`, a file an image) or COCO (`annotations`) has them. Of masks of
several values, and of polygons of several labels, one is said: by its number or name. There are as
many masks or files as images, in the order of the numbers in their names: fewer would leave open
whose they are. Points of tables and polygons are pixels, centres whole numbers, unless a unit is
said.
"""

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import contourpy
import numpy as np

from validate.arrays import Floats
from validate.errors import RecordingError, UsageError
from validate.files import buffered, json_value, npz_arrays, read_bytes, read_text
from validate.recording.formats.subprocess_decoder import decoded
from validate.recording.images.image import decode_png
from validate.recording.images.png_stack import number_key, numbered
from validate.recording.types import Contours, Frames
from validate.units import in_si

MAX_FILE = 256 * 2**20  # bytes
_BEYOND = 0.1  # of its size an outline may leave the image: what is cut by its edge is drawn so
_MOST = 64  # regions: pictures have more levels
KINDS = (".png", ".npy", ".npz", ".nrrd", ".csv", ".json")
_POLYGON = "polygon"
Outlines = Mapping[int, Floats]


def foreign_outlines(
    path: Path, frames: Frames, images: str, sd: float, unit: str = "px", label: str = ""
) -> Contours:
    """Outlines in `path` for the images of topic `images`; `sd` m along the normal, as its author
    says, `unit` that of points in tables and polygons, `label` the region of several.

    Raises `UsageError` for another kind of file, and where several regions leave open which is
    meant, `RecordingError` naming file and image: masks of
    another size, several regions or none in one, fewer than 3 points, images that are not there,
    points beyond the image, polygons of images of another size, shapes that are no polygons.
    """
    found = _read(path, frames, label)
    beyond = [i for i in found if not 0 <= i < len(frames.images)]
    if beyond or not found:
        raise RecordingError(
            f"{path.name}: outlines of {len(found)} images, "
            + (f"image {beyond[0]} among them" if beyond else "none")
            + f"; '{images}' has the images 0 to {len(frames.images) - 1}"
        )
    metres = None if unit == "px" else in_si(1.0, unit, "m")
    if unit != "px" and metres is None:
        raise UsageError(f"unit {unit} of {path.name}: expected px, or a unit of length as mm")
    drawn = path.is_dir() or path.suffix.lower() in (".png", ".npy", ".npz", ".nrrd")
    scale = np.array(frames.m_per_px if metres is None or drawn else (metres, metres))
    at = sorted(found)
    outlines = tuple(found[i] * scale for i in at)
    # No point far off its image: then the unit is another, or the images are.
    for i, outline in zip(at, outlines, strict=True):
        places, size = outline / frames.m_per_px, np.array(frames.images[i].shape[1::-1])
        out = ~np.all((places > -_BEYOND * size) & (places < (1 + _BEYOND) * size), axis=1)
        if out.any():
            x, y = places[out][0]
            raise RecordingError(
                f"{path.name}: image {i}: a point at ({x:.4g}, {y:.4g}) px, the image is "
                f"{size[0]} x {size[1]}: check the size of the images it was drawn in, and --unit"
            )
    return Contours(frames.t[at], outlines, sd, frames.pose, frames.frame, images)


def _read(path: Path, frames: Frames, label: str) -> Outlines:
    try:
        files = numbered(path, (".png", ".json")) if path.is_dir() else [path]
        kind = files[0].suffix.lower()
        if kind not in KINDS:
            raise UsageError(f"{path.name}: outlines come as {', '.join(KINDS)} or a folder")
        if (size := sum(file.stat().st_size for file in files)) > MAX_FILE:
            raise RecordingError(f"{path.name}: {size} bytes, limit {MAX_FILE}")
        if kind == ".json":
            return _polygons(path, files, frames, label)
        if kind != ".csv":
            return _edges(path, files, frames, label)
        if label:
            raise UsageError(f"--label {label}: {path.name} has no labels; leave it out")
        text = read_text(path, MAX_FILE, "utf-8-sig")
    except OSError as error:
        raise RecordingError(f"{path.name}: cannot be read ({error.strerror})") from error
    rows = csv.DictReader(io.StringIO(text, newline=""))
    names = [str(name).strip().lower() for name in rows.fieldnames or ()]
    if not {"frame", "x", "y"} <= set(names):
        raise RecordingError(f"{path.name}: columns {names}, expected frame, x, y")
    rows.fieldnames = names
    return _grouped(path, ((r["frame"], (r["x"], r["y"])) for r in rows))


# --- masks ----------------------------------------------------------------------------------------


def _meant(path: Path, label: str, regions: Sequence[tuple[str, str]]) -> int:
    """Which of the regions, each by name and value, is said, or the only one."""
    there = ", ".join(n if n == v else f"{n} ({v})" for n, v in regions)
    if label:
        at = [i for i, known in enumerate(regions) if label in known]
        if not at:
            raise UsageError(f"--label {label}: not in {path.name}; there are {there}")
        return at[0]
    if len(regions) > 1:
        raise UsageError(
            f"{path.name}: {len(regions)} regions, {there}: choose one, as --label {regions[0][0]}"
        )
    return 0


def _of_names(path: Path, label: str, names: Iterable[str]) -> str:
    """The name that is said, or the only one; of nothing drawn the one that is said."""
    regions = [(name, name) for name in dict.fromkeys(names)]
    return regions[_meant(path, label, regions)][0] if regions else label


def _require_each(path: Path, count: int, what: str, images: int) -> None:
    if count != images:
        raise RecordingError(
            f"{path.name}: {count} {what} for {images} images do not show which belongs to which "
            f"image; give one per image (an empty mask for no outline), or a CSV of frame, x, y"
        )


def _edges(path: Path, files: list[Path], frames: Frames, label: str) -> Outlines:
    """The edges (k, 2) px of masks (n, h, w), or (h, w) of one image."""
    kind, named = files[0].suffix.lower(), dict[str, int]()
    masks: Any
    if kind == ".png":
        masks = [decode_png(read_bytes(file, MAX_FILE)) for file in files]
    elif kind == ".nrrd":
        # x first, as it is stored; the values of regions by name, as 3D Slicer has them.
        held = decoded("validate.recording.images.nrrd", path)
        masks = held["pixels"]
        if masks.ndim not in (2, 3) or masks.dtype.kind not in "biu":
            raise RecordingError(
                f"{path.name}: {masks.shape} {masks.dtype}, expected masks (w, h, n) or (w, h) "
                "of whole numbers"
            )
        texts = dict(zip(held["keys"].tolist(), held["texts"].tolist(), strict=True))
        for key, text in texts.items():
            name = f"{key.removesuffix('LabelValue')}Name"
            if key.endswith("LabelValue") and name in texts and text.isdigit():
                named[texts[name]] = int(text)
        masks = masks.T if masks.ndim == 3 else masks.T[None]
    else:
        masks = _array(path)
    # The masks of one region: of the only value that is not zero, or of that which is said.
    values = sorted({float(v) for mask in masks for v in np.unique(mask) if v})
    if len(values) > _MOST:
        raise RecordingError(
            f"{path.name}: {len(values)} values, not a mask of regions: use 0 and one other value"
        )
    names = {v: name for name, v in named.items()}
    regions = [(names.get(int(v), f"{v:g}"), f"{v:g}") for v in values]
    meant = values[_meant(path, label, regions)] if values else 0
    masks = [mask == meant for mask in masks] if values else masks
    _require_each(path, len(masks), "masks", len(frames.images))
    shape, found = frames.images[0].shape, {}
    for i, mask in enumerate(masks):
        if mask.shape != shape:
            raise RecordingError(f"{path.name}: mask {i} is {mask.shape}, its image {shape}")
        if mask.any():
            padded = np.pad(mask.astype(np.float64), 1)
            lines = contourpy.contour_generator(z=padded).lines(0.5)
            if len(lines) != 1:
                raise RecordingError(
                    f"{path.name}: mask {i}: {len(lines)} closed lines, expected one region, no "
                    "holes"
                )
            found[i] = np.asarray(lines[0])[:-1] - 1
    return found


def _array(path: Path) -> Any:
    if path.suffix.lower() == ".npz":
        held = npz_arrays(path, MAX_FILE)
        if len(held) != 1:
            raise RecordingError(f"{path.name}: arrays {sorted(held)}; keep only the masks")
        masks = next(iter(held.values()))
    else:
        try:
            masks = np.load(buffered(path, MAX_FILE), allow_pickle=False)
        except (ValueError, EOFError) as error:
            raise RecordingError(f"{path.name}: no array of masks ({error})") from None
    if masks.ndim not in (2, 3):
        raise RecordingError(f"{path.name}: {masks.shape}, expected masks (n, h, w) or (h, w)")
    return masks if masks.ndim == 3 else masks[None]


# --- points ---------------------------------------------------------------------------------------


def _polygons(path: Path, files: list[Path], frames: Frames, label: str) -> Outlines:
    images = len(frames.images)
    try:
        told = [json_value(read_text(f, MAX_FILE, "utf-8-sig")) for f in files]
        if "annotations" in told[0] and len(told) == 1:
            return _coco(path, told[0], frames, label)
        _require_each(path, len(files), "files of polygons", images)
        for i, one in enumerate(told):
            _require_size(path, i, (one.get("imageWidth"), one.get("imageHeight")), frames)
        closed = [s for one in told for s in one["shapes"] if _kind(s) == _POLYGON]
        others = [s for one in told for s in one["shapes"]]
        meant = _of_names(path, label, map(_label, others if label or not closed else closed))
        each = ((i, _shape(path, one, meant)) for i, one in enumerate(told))
        return _grouped(path, ((i, p) for i, points in each for p in points))
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise RecordingError(f"{path.name}: neither LabelMe nor COCO polygons ({error})") from None


def _kind(shape: Any) -> str:
    return str(shape.get("shape_type", _POLYGON))


def _require_size(path: Path, i: int, told: tuple[Any, Any], frames: Frames) -> None:
    """The size (w, h) px of an image, where it is told, is that of ours."""
    h, w = frames.images[i].shape
    if None not in told and told != (w, h):
        raise RecordingError(
            f"{path.name}: drawn in an image of {told[0]} x {told[1]} px, image {i} is {w} x {h}: "
            "draw in the images as they were recorded"
        )


def _label(shape: Any) -> str:
    return str(shape.get("label") or "")


def _shape(path: Path, told: Any, label: str) -> Any:
    """The points of the polygon of a LabelMe file; none where it has no shape of that label."""
    closed = [s for s in told["shapes"] if _label(s) == label]
    if kinds := [kind for kind in map(_kind, closed) if kind != _POLYGON]:
        raise RecordingError(
            f"{path.name}: '{label}' is drawn as {kinds[0]}, expected polygons in all images"
        )
    if len(closed) > 1:
        raise RecordingError(f"{path.name}: {len(closed)} polygons in one image, expected one")
    return closed[0]["points"] if closed else []


def _coco(path: Path, told: Any, frames: Frames, label: str) -> Outlines:
    """One polygon an image, images in the order of the numbers in their files' names."""
    _require_each(path, len(told["images"]), "images", len(frames.images))
    listed = sorted(told["images"], key=_number)
    for a, b in pairwise(listed):
        if _number(a) == _number(b):
            raise RecordingError(
                f"{path.name}: '{a['file_name']}' and '{b['file_name']}' have the same number: "
                f"their order is not known; number them"
            )
    for i, image in enumerate(listed):
        _require_size(path, i, (image.get("width"), image.get("height")), frames)
    order = {image["id"]: i for i, image in enumerate(listed)}
    names = {c["id"]: str(c["name"]) for c in told.get("categories", ())}
    drawn = [(names.get(n.get("category_id"), ""), n) for n in told["annotations"]]
    meant = _of_names(path, label, (name for name, _ in drawn))
    chosen = [n for name, n in drawn if name == meant]
    if any(isinstance(n["segmentation"], dict) for n in chosen):
        raise RecordingError(
            f"{path.name}: '{meant}' is drawn as masks (RLE), expected polygons; save the masks "
            f"as PNG, one per image, and name their folder"
        )
    polygons = [(order[n["image_id"]], p) for n in chosen for p in n["segmentation"]]
    if len(polygons) > len({i for i, _ in polygons}):
        raise RecordingError(f"{path.name}: several polygons in one image, expected one")
    pairs = ((i, pair) for i, p in polygons for pair in np.reshape(p, (-1, 2)).tolist())
    return _grouped(path, pairs)


def _number(image: Any) -> tuple[int, ...]:
    return number_key(str(image["file_name"]))


def _grouped(path: Path, points: Iterable[tuple[Any, Any]]) -> Outlines:
    """Points by image, in their order; COCO and LabelMe count from a pixel's corner or centre alike
    to half a pixel, which is not corrected."""
    found: dict[int, list[tuple[float, float]]] = {}
    for image, (x, y) in points:
        try:
            found.setdefault(int(image), []).append((float(x), float(y)))
        except (TypeError, ValueError):
            raise RecordingError(
                f"{path.name}: frame {image}, ({x}, {y}) are not numbers"
            ) from None
    return {i: np.array(p) for i, p in found.items()}
