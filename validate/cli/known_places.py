"""Tables that were marked by hand, and known places: landmarks, and wires by two places."""

import csv
import io
from pathlib import Path

import numpy as np

from validate.arrays import Floats
from validate.errors import RecordingError, UsageError
from validate.files import read_text
from validate.recording.formats.device_set import read_device_set
from validate.recording.formats.slicer import FCSV, MARKUPS
from validate.recording.mcap.read import MCAP
from validate.recording.readers import read_recording
from validate.recording.types import Markers
from validate.register.image_plane import KnownTarget
from validate.units import in_si

_MAX_TABLE = 16 * 2**20  # bytes


def known_places(file: Path, unit: str | None) -> tuple[KnownTarget, ...]:
    """Places m of a table (target, x, y, z; a wire x2, y2, z2, too) in `unit`, or of landmarks:
    FCSV and markups in their own unit (or `unit`), a device set of PLUS, a recording's points at
    one instant.

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
        return _declared(file)
    if MCAP.recognises(file):
        if unit:
            raise UsageError(
                f"--unit {unit}: {file.name} is a recording, with points in metres: leave it out"
            )
        return _landmarks(file, dict(read_recording(file).markers))
    if not unit:
        raise UsageError(f"{file.name}: the table has no unit; give it, as --unit mm")
    return _table(file, unit)


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


def _declared(file: Path) -> tuple[KnownTarget, ...]:
    held = read_device_set(file).landmarks
    if not held:
        raise UsageError(
            f"{file.name}: its PhantomDefinition has no landmarks; export them with it"
        )
    return tuple(KnownTarget(name, place) for name, place in held.items())


def _table(file: Path, unit: str) -> tuple[KnownTarget, ...]:
    factor = in_si(1.0, unit, "m")
    if factor is None:
        raise UsageError(f"--unit {unit}: expected a unit of length, as mm")
    found: dict[str, KnownTarget] = {}
    for row in rows_of(file, ("target", "x", "y", "z")):
        name = row["target"].strip()
        if name in found:
            raise RecordingError(f"{file.name}: target {name} occurs twice; keep one row")
        place = factor * np.array([number(file, row, c) for c in "xyz"])
        found[name] = KnownTarget(name, place, _along(file, row, factor, place))
    return tuple(found.values())


def _along(file: Path, row: dict[str, str], factor: float, place: Floats) -> Floats | None:
    """Direction (3,) of a wire; none of a point."""
    if not (row.get("x2") or "").strip():
        return None
    way = factor * np.array([number(file, row, c) for c in ("x2", "y2", "z2")]) - place
    if not np.linalg.norm(way):
        raise RecordingError(
            f"{file.name}: wire {row['target']} has two equal ends; give two different points"
        )
    return np.asarray(way / np.linalg.norm(way))


def rows_of(file: Path, wanted: tuple[str, ...]) -> list[dict[str, str]]:
    """The rows of a table with commas that has the `wanted` columns, among others."""
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
    """A finite number of a row's column."""
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
