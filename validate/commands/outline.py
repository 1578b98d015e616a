"""`validate outline`: outlines in a recording's images, or third-party ones, as a stream."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from validate.commands.arguments import complain
from validate.commands.display import say
from validate.commands.progress import progress
from validate.errors import RecordingError, UsageError
from validate.files import safe_name
from validate.places import try_file
from validate.recording.mcap.write import write_recording
from validate.recording.outlines.outline import (
    EXPERTS,
    Hint,
    RivalRegion,
    followed,
)
from validate.recording.outlines.third_party_outlines import foreign_outlines
from validate.recording.readers import read_recording
from validate.recording.types import Contours, Frames
from validate.report.charts.style import png
from validate.report.scenes.outline_images import PlaceSaid, outlines_over
from validate.units import in_si, split

_SHOWN = 6  # images of the picture
_SURE = 0.75  # confidence below which it is said


def outline(
    file: Path, out: Path | None, topic: str, name: str, drawn: Path | None, given: dict[str, Any]
) -> None:
    """Add the outlines of the images `topic` to the recording in `file` as the stream `name`."""
    recording = read_recording(file)
    if out is None:
        if recording.unread:  # not a stream here: it would be lost in the same file
            raise UsageError(
                f"{file.name} has {len(recording.unread)} topics that are not read and would be "
                "lost: write to another file, -o OUT.mcap"
            )
        out = file
    try_file(out)
    if not topic and len(recording.frames) != 1:
        raise UsageError(
            f"{recording.name}: images {sorted(recording.frames)}; choose one: --topic NAME"
            if recording.frames
            else f"{recording.name}: no images; it has {sorted(recording.streams)}"
        )
    images = topic or next(iter(recording.frames))
    frames = recording.frame(images)
    # Outlines that this command made may be made again
    if name in recording.streams and f"found/{name}" not in recording.metadata:
        raise UsageError(f"{recording.name} already has a stream '{name}': choose --name OTHER")
    marks: tuple[PlaceSaid, ...] = ()
    if drawn is None:
        contours, told, marks = _found(frames, images, given)
    else:
        contours, told = _drawn(drawn, frames, images, given)
    records = {**recording.metadata, f"found/{name}": {"images": images, **told}}
    streams = {**recording.contours, name: contours}
    write_recording(replace(recording, contours=streams, metadata=records), out)
    for key, text in told.items():
        say(f"{key}: {text}", indent="  ")
    # Some images, evenly, with their outlines; in the first one the given place, and what else
    # might be meant
    at = np.unique(np.linspace(0, len(contours.t) - 1, _SHOWN).round().astype(int))
    shown = [(f"outline {i}", float(contours.t[i])) for i in at]
    _, picture = outlines_over(frames, contours, shown, "evenly spaced in time", "", marks=marks)
    place = out.with_name(f"{out.stem}-{safe_name(name)}.png")
    try:
        place.write_bytes(png(picture))
    except OSError as error:
        raise RecordingError(f"{place}: cannot be written ({error.strerror})") from error
    say(f"{place}: {len(at)} images with their outlines: check them", indent="  ")
    say(
        f"{out}: {name} ({len(contours.t)} outlines); {out.stat().st_size / 1e3:.0f} kB",
        indent="  ",
    )


def _found(
    frames: Frames, images: str, given: dict[str, Any]
) -> tuple[Contours, dict[str, str], tuple[PlaceSaid, ...]]:
    for option in ("sd", "unit", "label"):
        if given[option]:
            raise UsageError(f"--{option} is for third-party outlines; give it with --from FILE")
    # From the first pixel's centre, m
    centre: Any = None
    if (text := given["centre"]) is not None:
        parts = text.split(",")
        if len(parts) != 2:
            raise UsageError(f"--centre {text}: expected X,Y as 120px,80px or 12mm,20mm")
        centre = np.array([_length("--centre", p, frames, axis=i) for i, p in enumerate(parts)])
    radius = _length("--radius", given["radius"], frames)
    hint = Hint(centre, radius, given["shape"], given["bright"])
    with progress("outlines") as report:
        found = followed(frames, hint, images, report, given["confidence"])
    if found.rivals:
        named = "; ".join(f"{r.words} ({r.share:.2f} of the contrast)" for r in found.rivals)
        complain(
            f"{len(found.rivals)} other regions are as distinct as the outline: {named}; to choose "
            "one, give --centre X,Y"
        )
    if found.confidence.min() < _SURE:
        complain(f"confidence falls to {found.confidence.min():.2f}: check the picture")
    if found.without:
        i, why = next(iter(found.without.items()))
        complain(f"{len(found.without)} images have no outline and are left out, first {i}: {why}")
    # What was said, a radius alone about the outline, and the other regions
    marks = []
    if centre is not None or radius is not None:
        place = found.contours.outlines[0].mean(axis=0) if centre is None else centre
        marks = [PlaceSaid("as given", place, radius, True)]
    others = (*found.rivals, *found.beside)
    marks += [PlaceSaid("another region", r.centre, r.radius) for r in others]
    sd, c = found.contours.sd, found.confidence
    assert found.contours.each is not None
    own = 1e3 * found.contours.each[:, 0]
    told = {
        "confidence": f"{c.min():.2f} to {c.max():.2f}",
        "sd": f"{1e3 * sd:.3g} mm ({own.min():.3g} to {own.max():.3g}), {EXPERTS:.2f} times "
        "that of the wall on twins, the error of experts' outlines in other data: assumed, not "
        "measured on these images",
        "searched": f"{'bright' if hint.bright else 'dark'} region, {hint.shape}, from "
        + ("the given centre" if hint.centre is not None else "the most distinct disc"),
        "rivals": _named(found.rivals),
    }
    if found.beside:
        told["near the given centre"] = _named(found.beside)
    if found.without:
        told["left out"] = ", ".join(map(str, found.without))
    return found.contours, told, tuple(marks)


def _named(regions: tuple[RivalRegion, ...]) -> str:
    return "; ".join(f"{r.words}: {r.share:.2f}" for r in regions) or "none"


def _drawn(
    path: Path, frames: Frames, images: str, given: dict[str, Any]
) -> tuple[Contours, dict[str, str]]:
    useless = [k for k in ("centre", "radius", "bright") if given[k]]
    if useless:
        raise UsageError(f"--{useless[0]} is for searched outlines; leave it out with --from")
    if given["sd"] is None:
        raise UsageError(
            f"{path.name} does not contain the uncertainty of its outlines along their normal; "
            f"give "
            "it, as --sd 0.3mm or 2px"
        )
    sd = _length("--sd", given["sd"], frames)
    unit, label = given["unit"] or "px", given["label"] or ""
    contours = foreign_outlines(path, frames, images, sd or 0.0, unit, label)
    told = {"drawn by others": path.name, "sd": f"{given['sd']}, as given"}
    return contours, {**told, "label": label} if label else told


def _length(option: str, text: str | None, frames: Frames, axis: int = 0) -> float | None:
    if text is None:
        return None
    number, unit = split(text.strip()) or (np.nan, "")
    metres = number * frames.m_per_px[axis] if unit == "px" else None
    value = in_si(number, unit, "m") if unit not in ("px", "") else metres
    if value is None or not np.isfinite(value) or (value <= 0 and option != "--centre"):
        raise UsageError(f"{option} {text}: expected a length with its unit, as 8mm or 80px")
    return float(value)
