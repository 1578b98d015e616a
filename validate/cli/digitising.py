"""`validate digitise`: the landmarks that the tip of a tracked tool was held on."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from validate.arrays import Floats, rms
from validate.cli.arguments import complain
from validate.cli.display import say, table
from validate.cli.known_places import known_places
from validate.cli.recordings import written
from validate.cli.tool_poses import in_reference, tip_offset
from validate.errors import UsageError
from validate.places import try_file
from validate.recording.formats.poses import TRANSLATION
from validate.recording.mcap.write import write_recording
from validate.recording.readers import read_recording
from validate.recording.types import Markers, Recording
from validate.register.digitised import Digitised
from validate.register.dwell import Dwell, dwells, sd_of_mean
from validate.register.image_plane import KnownTarget
from validate.register.landmarks import match_landmarks

RADIUS, LEAST = 3e-3, 1.0  # m, s: within which a tip that is roughly known stands, and how long
_TOUCH, _HOLDS = 0.5, 0.75e-3  # s, m: its first touch, before the tool is turned far
_SEEN = 0.5  # of the time on a place: less is told
_MATCH = 5e-3  # m: within which a place is a landmark's
_COLUMNS = ("x, mm", "y, mm", "z, mm", "from, s", "stood, s", "wander, mm")


@dataclass(frozen=True)
class HowDigitised:
    """As the options of the command; `known` landmarks in `unit` name the places."""

    tool: str
    tip: str
    reference: str = ""
    known: Path | None = None
    unit: str | None = None


def digitise(file: Path, out: Path, how: HowDigitised) -> None:
    """Finds where the tip stood, and writes those places as points at one instant, with its path.

    Known landmarks give them their names and a pose; each is then also predicted from the others.
    """
    try_file(out)
    recording = read_recording(file)
    t, R, T, frame = in_reference(recording, how.tool, how.reference)
    x = R @ tip_offset(how.tip) + T
    standing = dwells(t, x, RADIUS, LEAST)
    if not standing:
        raise UsageError(
            f"the tip of '{how.tool}' never stays within {1e3 * RADIUS:g} mm for {LEAST:g} s: "
            "check --tip"
        )
    _told_unseen(recording, how, t, standing)
    parts = tuple(d.touch(_TOUCH, _HOLDS) for d in standing)
    if how.known is None:
        found = _numbered(how, standing, parts)
    else:
        found = _named(how, (t, x), standing, parts, known_places(how.known, how.unit))
    table(f"{len(standing)} places where the tip stood still", found.columns, found.rows)
    for key, text in found.record.items():
        say(f"{key}: {text}", indent="  ")
    streams = {
        "landmarks": Markers(parts[0].t[:1], found.names, found.places[None], found.sd, frame),
        "tip": Markers(t, ("tip",), x[:, None], found.sd, frame),
    }
    done = _with(recording, how, streams, found.record)
    write_recording(done, out)
    written(done, out)


def _told_unseen(
    recording: Recording, how: HowDigitised, t: Floats, standing: tuple[Dwell, ...]
) -> None:
    """Poses without the reference, which may be those on a landmark, and places where the tip was
    hardly seen: it may have been elsewhere meanwhile."""
    poses = len(recording.signals[f"{how.tool}/{TRANSLATION}"].t)
    if len(t) < poses:
        complain(
            f"{poses - len(t)} of {poses} poses of '{how.tool}' are left out: '{how.reference}' "
            "was not visible then"
        )
    step = float(np.median(np.diff(t)))
    for d in standing:
        stood, seen = float(np.ptp(d.t)), step * (len(d.t) - 1)
        if seen < _SEEN * stood:
            complain(
                f"from {d.t[0]:.2f} s on, the tip was visible for only {seen:.2g} of "
                f"{stood:.3g} s: it may have moved in between"
            )


@dataclass(frozen=True)
class _Touched:
    """Names (k,) and places (k, 3) m of landmarks, sd m per axis; what is told and kept of them."""

    names: tuple[str, ...]
    places: Floats
    sd: float
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    record: Mapping[str, str]


def _numbered(how: HowDigitised, standing: tuple[Dwell, ...], parts: tuple[Dwell, ...]) -> _Touched:
    """By numbers, in the order in which they were touched."""
    if how.unit:
        raise UsageError(
            f"--unit {how.unit}: it is the unit of --known, which is missing; give --known"
        )
    sd = sd_of_mean(parts, standing)
    places = np.array([d.centre for d in parts])
    rows = [
        [str(i + 1), *_shown(x, d)] for i, (x, d) in enumerate(zip(places, standing, strict=True))
    ]
    record = {"tip": how.tip, "sd": f"{1e3 * sd:.2g} mm per axis"}
    names = tuple(row[0] for row in rows)
    return _Touched(names, places, sd, ("landmark", *_COLUMNS), rows, record)


def _named(
    how: HowDigitised, path: tuple[Floats, Floats], standing: tuple[Dwell, ...],
    parts: tuple[Dwell, ...], known: Sequence[KnownTarget],
) -> _Touched:  # fmt: skip
    """By the distances between them, each also predicted from the others."""
    if wires := [k.name for k in known if k.along is not None]:
        raise UsageError(
            f"{', '.join(wires)}: wires cannot be touched at a point; give landmarks that are "
            f"points"
        )
    names, body = tuple(k.name for k in known), np.array([k.place for k in known])
    match = match_landmarks(body, np.array([d.centre for d in parts]), _MATCH)
    used, whole = (tuple(group[i] for i in match.seen) for group in (parts, standing))
    found = Digitised(*path, standing, parts, names, body, match, sd_of_mean(used, whole))
    off, left = (np.linalg.norm(v, axis=1) for v in (found.residuals, found.left_out))
    rows = [
        [name, *_shown(x, d), f"{1e3 * a:.3g}", f"{1e3 * b:.3g}"]
        for name, x, d, a, b in zip(found.touched, found.places, whole, off, left, strict=True)
    ]
    columns = ("landmark", *_COLUMNS, "residual, mm", "left out, mm")
    return _Touched(found.touched, found.places, found.sd, columns, rows, _record(how, found))


def _shown(x: Floats, d: Dwell) -> list[str]:
    return [
        *(f"{1e3 * v:.2f}" for v in x),
        f"{d.t[0]:.2f}",
        f"{np.ptp(d.t):.2f}",
        f"{1e3 * d.wander:.2g}",
    ]


def _distance(off: Floats) -> str:
    return f"{1e3 * rms(np.linalg.norm(off, axis=1)):.3g} mm"


def _record(how: HowDigitised, found: Digitised) -> dict[str, str]:
    untouched = [name for name in found.names if name not in found.touched]
    none = len(found.parts) - len(found.touched)
    matrix = " ".join(f"{v:.9g}" for v in found.pose.matrix.ravel())
    return {
        "tip": how.tip,
        "sd": f"{1e3 * found.sd:.2g} mm per axis",
        "fitted": f"rms {_distance(found.residuals)} of {len(found.touched)} landmarks",
        "predicted": f"rms {_distance(found.left_out)}, each landmark from the others",
        "not touched": ", ".join(untouched) or "none",
        "places that are no landmark": str(none),
        "pose": f"{matrix} (from the landmarks' frame to the tip's frame, m, row by row)",
    }


def _with(
    recording: Recording,
    how: HowDigitised,
    streams: Mapping[str, Markers],
    record: Mapping[str, str],
) -> Recording:
    named = {f"{how.tool}/{name}": stream for name, stream in streams.items()}
    clock = recording.clock[f"{how.tool}/{TRANSLATION}"]
    return replace(
        recording,
        markers={**recording.markers, **named},
        clock={**recording.clock, **dict.fromkeys(named, clock)},
        metadata={**recording.metadata, f"landmarks/{how.tool}": record},
    )
