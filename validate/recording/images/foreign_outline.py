"""Outlines that others drew in the images of a recording: masks, tables of points, polygons.

Masks are PNG files (one, or a folder, numbered) or an array (n, h, w) in .npy or .npz: what is not
zero is inside, and the outline runs half a pixel outside the outermost pixels' centres. Tables are
CSV with the columns frame, x, y; polygons JSON as LabelMe (`shapes`) or COCO (`annotations`) has
them. Points of tables and polygons are pixels, centres whole numbers, unless a unit is said.
"""

import csv
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import contourpy
import numpy as np

from validate.arrays import Floats
from validate.errors import RecordingError, UsageError
from validate.recording.images.image import decode_png
from validate.recording.types import Contours, Frames
from validate.units import in_si

MAX_FILE = 256 * 2**20  # bytes
KINDS = (".png", ".npy", ".npz", ".csv", ".json")
Outlines = Mapping[int, Floats]


def foreign_outlines(
    path: Path, frames: Frames, images: str, sd: float, unit: str = "px"
) -> Contours:
    """Outlines in `path` for the images of topic `images`; `sd` m along the normal, as its author
    says, `unit` that of points in tables and polygons.

    Raises `UsageError` for another kind of file, `RecordingError` naming file and image: masks of
    another size, several regions or none in one, fewer than 3 points, images that are not there.
    """
    found = _read(path, frames)
    beyond = [i for i in found if not 0 <= i < len(frames.images)]
    if beyond or not found:
        raise RecordingError(
            f"{path.name}: outlines of {len(found)} images, "
            + (f"image {beyond[0]} among them" if beyond else "none")
            + f"; '{images}' has the images 0 to {len(frames.images) - 1}"
        )
    scale = _scale(path, frames, unit)
    at = sorted(found)
    outlines = tuple(found[i] * scale for i in at)
    return Contours(frames.t[at], outlines, sd, frames.pose, frames.frame, images)


def _scale(path: Path, frames: Frames, unit: str) -> Floats:
    metres = None if unit == "px" else in_si(1.0, unit, "m")
    if unit != "px" and metres is None:
        raise UsageError(f"unit {unit} of {path.name}: px, or a length as mm")
    drawn = path.is_dir() or path.suffix.lower() in (".png", ".npy", ".npz")
    return np.array(frames.m_per_px if metres is None or drawn else (metres, metres))


def _read(path: Path, frames: Frames) -> Outlines:
    kind = ".png" if path.is_dir() else path.suffix.lower()
    if kind not in KINDS:
        raise UsageError(f"{path.name}: outlines come as {', '.join(KINDS)} or a folder of PNG")
    try:
        if not path.is_dir() and path.stat().st_size > MAX_FILE:
            raise RecordingError(f"{path.name}: {path.stat().st_size} bytes, limit {MAX_FILE}")
        if kind == ".csv":
            return _table(path)
        return _polygons(path) if kind == ".json" else _masks(path, frames)
    except OSError as error:
        raise RecordingError(f"{path.name}: cannot be read ({error.strerror})") from error


# --- masks ----------------------------------------------------------------------------------------


def _masks(path: Path, frames: Frames) -> Outlines:
    masks = _pictures(path) if path.is_dir() or path.suffix.lower() == ".png" else _array(path)
    shape, found = frames.images[0].shape, {}
    for i, mask in enumerate(masks):
        if mask.shape != shape:
            raise RecordingError(f"{path.name}: mask {i} is {mask.shape}, its image {shape}")
        if mask.any():
            found[i] = _edge(mask != 0, f"{path.name}: mask {i}")
    return found


def _pictures(path: Path) -> list[Any]:
    files = sorted(path.glob("*.png")) if path.is_dir() else [path]
    return [decode_png(file.read_bytes()) for file in files]


def _array(path: Path) -> Any:
    try:
        masks = np.load(path, allow_pickle=False)
        if not isinstance(masks, np.ndarray):
            with masks as archive:
                held = {name: archive[name] for name in archive.files}
            if len(held) != 1:
                raise RecordingError(f"{path.name}: arrays {sorted(held)}; keep the masks alone")
            masks = next(iter(held.values()))
    except (ValueError, EOFError, BadZipFile) as error:
        raise RecordingError(f"{path.name}: no array of masks ({error})") from None
    if masks.ndim not in (2, 3):
        raise RecordingError(f"{path.name}: {masks.shape}, expected masks (n, h, w) or (h, w)")
    return masks if masks.ndim == 3 else masks[None]


def _edge(inside: Any, what: str) -> Floats:
    """The edge (k, 2) px of the one region of a mask."""
    padded = np.pad(inside.astype(np.float64), 1)
    lines = contourpy.contour_generator(z=padded).lines(0.5)
    if len(lines) != 1:
        raise RecordingError(f"{what}: {len(lines)} closed lines, expected one region, no holes")
    return np.asarray(lines[0])[:-1] - 1


# --- points ---------------------------------------------------------------------------------------


def _table(path: Path) -> Outlines:
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        rows = csv.DictReader(file)
        names = [str(name).strip().lower() for name in rows.fieldnames or ()]
        if not {"frame", "x", "y"} <= set(names):
            raise RecordingError(f"{path.name}: columns {names}, expected frame, x, y")
        rows.fieldnames = names
        return _grouped(path, ((r["frame"], (r["x"], r["y"])) for r in rows))


def _polygons(path: Path) -> Outlines:
    try:
        told = json.loads(path.read_text(encoding="utf-8-sig", errors="replace"))
        if "annotations" in told:
            return _coco(path, told)
        shapes = [
            s["points"] for s in told["shapes"] if s.get("shape_type", "polygon") == "polygon"
        ]
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise RecordingError(f"{path.name}: neither LabelMe nor COCO polygons ({error})") from None
    if len(shapes) != 1:
        raise RecordingError(f"{path.name}: {len(shapes)} polygons, expected one")
    return _grouped(path, ((0, p) for p in shapes[0]))


def _coco(path: Path, told: Any) -> Outlines:
    """One polygon an image, images in the order in which the file lists them."""
    order = {image["id"]: i for i, image in enumerate(told["images"])}
    points = (
        (order[note["image_id"]], pair)
        for note in told["annotations"]
        for pair in np.reshape(note["segmentation"][0], (-1, 2)).tolist()
    )
    ids = [note["image_id"] for note in told["annotations"]]
    if len(ids) > len(set(ids)):
        raise RecordingError(f"{path.name}: two polygons in one image, expected one")
    return _grouped(path, points)


def _grouped(path: Path, points: Iterable[tuple[Any, Any]]) -> Outlines:
    """Points by image, in their order; COCO and LabelMe count from a pixel's corner or centre alike
    to half a pixel, which is not corrected."""
    found: dict[int, list[tuple[float, float]]] = {}
    for image, (x, y) in points:
        try:
            found.setdefault(int(image), []).append((float(x), float(y)))
        except (TypeError, ValueError):
            raise RecordingError(f"{path.name}: frame {image}, ({x}, {y}) are no numbers") from None
    return {i: np.array(p) for i, p in found.items()}
