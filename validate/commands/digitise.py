"""`validate digitise`: landmarks of a body, touched with the tip of a tracked tool."""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from validate.arrays import Floats, rms
from validate.commands.arguments import complain
from validate.commands.display import say, table
from validate.commands.recordings import written
from validate.commands.tool_poses import in_reference, tip_offset
from validate.errors import RecordingError, UsageError
from validate.files import read_text
from validate.places import try_file
from validate.recording.formats.device_set import read_device_set
from validate.recording.formats.slicer import FCSV, MARKUPS
from validate.recording.mcap.read import MCAP
from validate.recording.mcap.write import write_recording
from validate.recording.motion_capture.poses import TRANSLATION
from validate.recording.readers import read_recording
from validate.recording.types import Markers
from validate.register.tools.image_plane import KnownTarget
from validate.register.tools.landmarks import Digitised, Dwell, sd_of_mean
from validate.units import in_si

# --- Tables that were marked by hand, and known places: landmarks, and wires by two places.

_MAX_TABLE = 16 * 2**20  # bytes


def known_places(file: Path, unit: str | None) -> tuple[KnownTarget, ...]:
    """Return the places m of a table (target, x, y, z; a wire x2, y2, z2, too) in `unit`, or of
    landmarks: FCSV and markups in their own unit (or `unit`), a device set of PLUS, a recording's
    points at one instant.

    Raises `UsageError` for a table without a unit, `RecordingError` for a file that is damaged.
    """
    for reader in (FCSV, MARKUPS):
        if reader.recognises(file):
            said = {"unit": unit} if unit else {}
            return _landmarks(file, dict(reader.read(file, said).markers))
    if file.suffix.lower() == ".xml":
        if unit:
            raise UsageError(
                f"--unit {unit}: {file.name} is a PLUS device set, in millimetres; leave --unit out"
            )
        if not (landmarks := read_device_set(file).landmarks):
            raise UsageError(
                f"{file.name}: its PhantomDefinition has no landmarks; export them with it"
            )
        return tuple(KnownTarget(name, place) for name, place in landmarks.items())
    if MCAP.recognises(file):
        if unit:
            raise UsageError(
                f"--unit {unit}: {file.name} is a recording, with points in metres: leave it out"
            )
        return _landmarks(file, dict(read_recording(file).markers))
    if not unit:
        raise UsageError(f"{file.name}: the table has no unit; give it, as --unit mm")
    factor = in_si(1.0, unit, "m")
    if factor is None:
        raise UsageError(f"--unit {unit}: expected a unit of length, as mm")
    targets: dict[str, KnownTarget] = {}
    for row in rows_of(file, ("target", "x", "y", "z")):
        name = row["target"].strip()
        if name in targets:
            raise RecordingError(f"{file.name}: target {name} occurs twice; keep one row")
        place = factor * np.array([number(file, row, c) for c in "xyz"])
        along = None  # of a point
        if (row.get("x2") or "").strip():
            way = factor * np.array([number(file, row, c) for c in ("x2", "y2", "z2")]) - place
            if not np.linalg.norm(way):
                raise RecordingError(
                    f"{file.name}: wire {row['target']} has two equal ends; give two different "
                    "points"
                )
            along = np.asarray(way / np.linalg.norm(way))
        targets[name] = KnownTarget(name, place, along)
    return tuple(targets.values())


def _landmarks(file: Path, markers: dict[str, Markers]) -> tuple[KnownTarget, ...]:
    still = {name: m for name, m in markers.items() if len(m.t) == 1}
    if len(still) != 1:
        raise UsageError(
            f"{file.name}: {len(still)} streams of points at one instant, expected 1; it has "
            f"{', '.join(markers) or 'no points'}"
        )
    (points,) = still.values()
    placed = np.isfinite(points.x[0]).all(axis=1)
    pairs = zip(points.names, points.x[0], placed, strict=True)
    return tuple(KnownTarget(name, place) for name, place, seen in pairs if seen)


def rows_of(file: Path, wanted: tuple[str, ...]) -> list[dict[str, str]]:
    """Return the rows of a table with commas that has the `wanted` columns, among others."""
    rows = csv.DictReader(
        io.StringIO(read_text(file, _MAX_TABLE, "utf-8-sig"), newline=""), restval=""
    )
    try:
        names = [str(n).strip().lower() for n in rows.fieldnames or ()]
        if not set(wanted) <= set(names):
            raise UsageError(
                f"{file.name}: columns {names}, expected {', '.join(wanted)}, separated "
                "by commas, as UTF-8 text"
            )
        rows.fieldnames = names
        return list(rows)
    except csv.Error as error:
        raise RecordingError(f"{file.name}: not a comma-separated table ({error})") from None


def number(file: Path, row: dict[str, str], name: str) -> float:
    """Return a finite number of a row's column."""
    said = row.get(name, "")
    try:
        value = float(said)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise RecordingError(
            f"{file.name}: {name} = {said[:40]!r} is not a number; correct it in the file"
        )
    return value


# -------------------------------------------------------------------------------------------------

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
    standing = Dwell.of_path(t, x, RADIUS, LEAST)
    if not standing:
        raise UsageError(
            f"the tip of '{how.tool}' never stays within {1e3 * RADIUS:g} mm for {LEAST:g} s: "
            "check --tip"
        )
    # Report poses without the reference, which may be those on a landmark, and places where the
    # tip was hardly visible: it may have been elsewhere meanwhile
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
    parts = tuple(d.touch(_TOUCH, _HOLDS) for d in standing)
    if how.known is None:
        # Numbers are their names, in the order in which they were touched
        if how.unit:
            raise UsageError(
                f"--unit {how.unit}: it is the unit of --known, which is missing; give --known"
            )
        sd = sd_of_mean(parts, standing)
        places = np.array([d.centre for d in parts])
        rows = [
            [str(i + 1), *_shown(x, d)]
            for i, (x, d) in enumerate(zip(places, standing, strict=True))
        ]
        record = {"tip": how.tip, "sd": f"{1e3 * sd:.2g} mm per axis"}
        numbers = tuple(row[0] for row in rows)
        found = _Touched(numbers, places, sd, ("landmark", *_COLUMNS), rows, record)
    else:
        found = _named(how, (t, x), standing, parts, known_places(how.known, how.unit))
    table(f"{len(standing)} places where the tip stood still", found.columns, found.rows)
    for key, text in found.record.items():
        say(f"{key}: {text}", indent="  ")
    streams = {
        "landmarks": Markers(parts[0].t[:1], found.names, found.places[None], found.sd, frame),
        "tip": Markers(t, ("tip",), x[:, None], found.sd, frame),
    }
    named = {f"{how.tool}/{name}": stream for name, stream in streams.items()}
    clock = recording.clock[f"{how.tool}/{TRANSLATION}"]
    done = replace(
        recording,
        markers={**recording.markers, **named},
        clock={**recording.clock, **dict.fromkeys(named, clock)},
        metadata={**recording.metadata, f"landmarks/{how.tool}": found.record},
    )
    write_recording(done, out)
    written(done, out)


@dataclass(frozen=True)
class _Touched:
    """Names (k,) and places (k, 3) m of landmarks, sd m per axis; what is told and kept of them."""

    names: tuple[str, ...]
    places: Floats
    sd: float
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    record: Mapping[str, str]


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
    found = Digitised.of(*path, standing, parts, names, body, _MATCH)
    whole = tuple(standing[i] for i in found.match.seen)
    off, left = (np.linalg.norm(v, axis=1) for v in (found.residuals, found.left_out))
    rows = [
        [name, *_shown(x, d), f"{1e3 * a:.3g}", f"{1e3 * b:.3g}"]
        for name, x, d, a, b in zip(found.touched, found.places, whole, off, left, strict=True)
    ]
    columns = ("landmark", *_COLUMNS, "residual, mm", "left out, mm")
    untouched = [name for name in names if name not in found.touched]
    matrix = " ".join(f"{v:.9g}" for v in found.pose.matrix.ravel())
    record = {
        "tip": how.tip,
        "sd": f"{1e3 * found.sd:.2g} mm per axis",
        "fitted": f"rms {_distance(found.residuals)} of {len(found.touched)} landmarks",
        "predicted": f"rms {_distance(found.left_out)}, each landmark from the others",
        "not touched": ", ".join(untouched) or "none",
        "places that are no landmark": str(len(parts) - len(found.touched)),
        "pose": f"{matrix} (from the landmarks' frame to the tip's frame, m, row by row)",
    }
    return _Touched(found.touched, found.places, found.sd, columns, rows, record)


def _shown(x: Floats, d: Dwell) -> list[str]:
    return [
        *(f"{1e3 * v:.2f}" for v in x),
        f"{d.t[0]:.2f}",
        f"{np.ptp(d.t):.2f}",
        f"{1e3 * d.wander:.2g}",
    ]


def _distance(off: Floats) -> str:
    return f"{1e3 * rms(np.linalg.norm(off, axis=1)):.3g} mm"
