"""`validate calibrate`: image plane of a tracked probe; tip of a tracked tool (`--pivot`)."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from validate.arrays import Floats
from validate.commands.arguments import complain
from validate.commands.digitise import LEAST, RADIUS, known_places, number, rows_of
from validate.commands.display import say, table
from validate.commands.recordings import written
from validate.commands.tool_poses import in_reference, tip_offset, tool_poses
from validate.errors import UsageError
from validate.places import try_file
from validate.recording.mcap.write import write_recording
from validate.recording.motion_capture.poses import TRANSLATION
from validate.recording.readers import read_recording
from validate.recording.types import Frames, Markers, Recording
from validate.register.tools.image_plane import (
    ImagePlane,
    KnownTarget,
    Pivot,
    SeenPoints,
    by_target,
    image_plane,
    pivot,
)
from validate.register.tools.landmarks import Dwell

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
    frame = probe.partition("To")[0] or probe
    placed = replace(frames, m_per_px=found.m_per_px, pose=found.pose.matrix, frame=frame)
    metadata = {**recording.metadata, f"image_plane/{topic}": _record(seen, found, frames)}
    streams = {**recording.frames, topic: placed}
    done = replace(recording, frames=streams, metadata=metadata)
    write_recording(done, out)
    written(done, out)


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
    # The probe's rotations (n, 3, 3) and places (n, 3) m at the images, NaN where it was not seen
    t, R, T = tool_poses(recording, probe)
    distance = np.abs(t[None] - frames.t[:, None])
    nearest = distance.argmin(axis=1)
    period = float(np.median(np.diff(frames.t))) if len(frames.t) > 1 else 0
    late = distance.min(axis=1) > max(_APART * period, 1e-9)
    turns, shifts = R[nearest].copy(), T[nearest].copy()
    turns[late], shifts[late] = np.nan, np.nan
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


def calibrate_tip(file: Path, out: Path, tool: str, reference: str, rough: str) -> None:
    """Finds where the tip of `tool` is, and writes its path with that.

    The whole recording turns about one point; with a `rough` tip (as 108mm,8mm,3mm), about each
    point that it is seen to stand on.
    """
    try_file(out)
    recording = read_recording(file)
    t, R, T, frame = in_reference(recording, tool, reference)
    # The poses that count, and which point each stands on
    kept, point = np.arange(len(t)), np.zeros(len(t), dtype=np.int64)
    if rough:
        parts = Dwell.of_path(t, R @ tip_offset(rough) + T, RADIUS, LEAST)
        if not parts:
            raise UsageError(
                f"the tip never stays within {1e3 * RADIUS:g} mm for {LEAST:g} s; check --tip"
            )
        kept = np.concatenate([np.arange(d.begin, d.end) for d in parts])
        point = np.repeat(np.arange(len(parts)), [d.end - d.begin for d in parts])
    found = pivot(R[kept], T[kept], point)
    for key, text in _tip_record(found).items():
        say(f"{key}: {text}", indent="  ")
    path = Markers(t, ("tip",), (R @ found.tip + T)[:, None], found.rms, frame)
    done = replace(
        recording,
        markers={**recording.markers, f"{tool}/tip": path},
        clock={**recording.clock, f"{tool}/tip": recording.clock[f"{tool}/{TRANSLATION}"]},
        metadata={**recording.metadata, f"pivot/{tool}": _tip_record(found)},
    )
    write_recording(done, out)
    written(done, out)


def _tip_record(found: Pivot) -> dict[str, str]:
    def listed(x: Floats, form: str) -> str:
        return ", ".join(format(1e3 * v, form) for v in x) + " mm"

    turns = ", ".join(f"{np.degrees(v):.3g}" for v in found.turns)
    return {
        "tip": listed(found.tip, ".5g"),
        "sd": f"{listed(found.sd, '.2g')}, from leaving out each tenth of the poses",
        "fitted": f"rms {1e3 * found.rms:.3g} mm per axis of {len(found.used)} of "
        f"{len(found.off)} poses about {len(found.points)} points",
        "turns": f"{turns} degrees rms in the three directions",
    }
