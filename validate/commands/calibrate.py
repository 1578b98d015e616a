"""`validate calibrate`: image plane of a tracked probe from targets in its images."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from validate.arrays import Floats
from validate.commands.arguments import complain
from validate.commands.digitise import known_places, number, rows_of
from validate.commands.display import say, table
from validate.commands.recordings import written
from validate.commands.tool_poses import tool_poses
from validate.errors import UsageError
from validate.places import try_file
from validate.recording.mcap.write import write_recording
from validate.recording.readers import read_recording
from validate.recording.types import Frames, Recording
from validate.register.tools.image_plane import (
    ImagePlane,
    KnownTarget,
    SeenPoints,
    by_target,
    image_plane,
)

_GROSS = 0.05  # of the image's diagonal: what marking by hand never misses by
_LARGEST = 5e-3  # m: no scanner's or camera's pixel on tissue is wider
_APART = 0.5  # of the images' period: a pose later than that is not that of the image


def calibrate(
    file: Path, out: Path, points: Path, targets: Path, unit: str | None, probe: str, topic: str
) -> None:
    """Finds where the images `topic` lie on the tracked `probe`, and writes them with that."""
    try_file(out)
    recording = read_recording(file)
    frames = recording.frame(topic)
    # Outlines carry a pose and metres of their own, which would be those of before
    old = [name for name, c in recording.contours.items() if c.images in ("", topic)]
    if old:
        raise UsageError(
            f"outlines {old} would keep the old pose of '{topic}': calibrate first, then run "
            "`validate outline`"
        )
    known = {t.name: t for t in known_places(targets, unit)}
    seen = _seen(recording, frames, probe, known, points)
    found = image_plane(seen)
    size = max(found.m_per_px)
    if size > _LARGEST:
        raise UsageError(
            f"a pixel would be {1e3 * size:.4g} mm wide, above {1e3 * _LARGEST:g} mm: check the "
            "unit of the targets"
        )
    _told(seen, found, frames)
    frame = probe.partition("To")[0] or probe
    placed = replace(frames, m_per_px=found.m_per_px, pose=found.pose.matrix, frame=frame)
    metadata = {**recording.metadata, f"image_plane/{topic}": _record(seen, found, frames)}
    streams = {**recording.frames, topic: placed}
    done = replace(recording, frames=streams, metadata=metadata)
    write_recording(done, out)
    written(done, out)


def _told(seen: SeenPoints, found: ImagePlane, frames: Frames) -> None:
    table(
        f"{len(seen.px)} points in {len(np.unique(seen.image))} images",
        ["target", "points", "rms error, mm"],
        [[name, str(n), f"{1e3 * off:.3g}"] for name, n, off in by_target(seen, found.off)],
    )
    for key, text in _record(seen, found, frames).items():
        say(f"{key}: {text}", indent="  ")
    far = max(by_target(seen, found.off), key=lambda row: row[2])
    wide = float(np.hypot(*(np.array(frames.images[0].shape[::-1]) * found.m_per_px)))
    if found.rms > _GROSS * wide:
        complain(
            f"the residual of the points is {1e3 * found.rms:.3g} mm in an image of "
            f"{1e3 * wide:.3g} mm, "
            f"largest at '{far[0]}': check for swapped targets and for the frame of the targets"
        )


def _record(seen: SeenPoints, found: ImagePlane, frames: Frames) -> dict[str, str]:
    height, width = frames.images[0].shape
    places = {"middle": (width / 2, height / 2), "lower right": (width - 1, height - 1)}
    sds = (f"{1e3 * found.sd(np.array(px)):.3g} mm at the {w}" for w, px in places.items())
    images = len(np.unique(seen.image))
    predicted = f"{1e3 * found.predicted:.3g} mm" if np.isfinite(found.predicted) else "not known"
    return {
        "fitted": f"rms {1e3 * found.rms:.3g} mm of {len(seen.px)} points in {images} images",
        "predicted": f"rms {predicted}, each image from the others",
        "pixel": " x ".join(f"{1e3 * s:.6g} mm" for s in found.m_per_px),
        "sd": ", ".join(sds),
    }


def _seen(
    recording: Recording, frames: Frames, probe: str, known: dict[str, KnownTarget], file: Path
) -> SeenPoints:
    rows = rows_of(file, ("image", "u", "v", "target"))
    if not rows:
        raise UsageError(f"{file.name}: the file has no marked points; add one row per point")
    turns, shifts = _poses(recording, frames, probe)
    px, image, targets = [], [], []
    for row in rows:
        name = (row["target"] or "").strip()
        if name not in known:
            raise UsageError(f"{file.name}: no target '{name}'; there are {', '.join(known)}")
        said = number(file, row, "image")
        at = int(said)
        if said != at or not (0 <= at < len(frames.t) and np.isfinite(shifts[at]).all()):
            raise UsageError(
                f"{file.name}: image {said:g}: expected 0 to {len(frames.t) - 1}, with a pose; "
                f"{int(np.isfinite(shifts[:, 0]).sum())} images have a pose of '{probe}'"
            )
        px.append([number(file, row, c) for c in "uv"])
        image.append(at)
        targets.append(known[name])
    i = np.array(image)
    return SeenPoints(np.array(px), i, tuple(targets), turns[i], shifts[i])


def _poses(recording: Recording, frames: Frames, probe: str) -> tuple[Floats, Floats]:
    """The probe's rotations (n, 3, 3) and places (n, 3) m at the images, NaN where it was not
    seen."""
    t, turned, moved = tool_poses(recording, probe)
    near = np.abs(t[None] - frames.t[:, None])
    at, period = (
        near.argmin(axis=1),
        float(np.median(np.diff(frames.t))) if len(frames.t) > 1 else 0,
    )
    late = near[np.arange(len(at)), at] > max(_APART * period, 1e-9)
    R, T = turned[at].copy(), moved[at].copy()
    R[late], T[late] = np.nan, np.nan
    return R, T
