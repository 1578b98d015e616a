"""Reader of nominal stress against stretch: one curve, or a plane of two stretches."""

import hashlib
from pathlib import Path

import numpy as np

from validate.arrays import Floats
from validate.errors import RecordingError
from validate.recording.tables.blocks import parse_tables
from validate.recording.tables.table import Table, whole_file
from validate.recording.tables.vocabulary import words
from validate.recording.types import Recording, Signal, Source
from validate.units import si_factor

_LONGEST = 20.0  # no rubber reaches it
_ROUNDING = 1e-9  # of the largest stress


def read_stretch_stress(path: Path, unit: str | None = None) -> Recording:
    """Columns named "stretch" and "stress", one of each or two, in the file's order.

    Returns signals `stretch` (n, k) and `stress` (n, k) Pa; such files have no time, the number of
    the row stands for it. `unit` is that of the stress: what the header says otherwise. Raises
    `RecordingError` for other columns, a stress without a unit, one whose sign is not the
    stretch's, and stretches that are not above 0.
    """
    data = whole_file(path)
    try:
        tables = parse_tables(data)
        if len(tables) != 1:
            raise RecordingError(f"{len(tables)} tables; export one curve per file")
        stretch, stress, said = _curve(tables[0], unit)
    except RecordingError as error:
        raise RecordingError(f"{path.name}: {error}") from error
    digest, rows = hashlib.sha256(data).hexdigest(), np.arange(len(stretch), dtype=np.float64)
    return Recording(
        path.stem,
        Source(path.name, digest, len(data), "text file: integrity not provable"),
        0,
        signals={
            "stretch": Signal(rows, stretch, "1", 0.0, "specimen"),
            "stress": Signal(rows, stress, "Pa", 0.0, "specimen"),
        },
        metadata={"provenance": {"file": path.name, "sha256": digest, "stress unit": said}},
    )


def _curve(table: Table, unit: str | None) -> tuple[Floats, Floats, str]:
    """Stretches and nominal stresses Pa (n, k), tension positive, and where their unit is from."""
    stretches, stresses = (
        [c for c in table.columns if word in words(c.name)] for word in ("stretch", "stress")
    )
    if not len(stretches) == len(stresses) in (1, 2):
        labels = ", ".join(repr(c.label) for c in table.columns)
        raise RecordingError(
            f"{len(stretches)} columns of stretch and {len(stresses)} of stress among {labels}; "
            "expected one of each, or two of each; rename or remove columns"
        )
    units = {unit or c.unit or "" for c in stresses}
    if len(units) != 1 or "" in units:
        raise RecordingError(
            f"'{stresses[0].label}' has no unit; give it with --set unit=MPa (moduli follow it, "
            "relative errors do not)"
        )
    said = units.pop()
    stress = np.stack([table.numbers(c) for c in stresses], axis=1) * si_factor(said, "stress")
    stretch = np.stack([table.numbers(c) for c in stretches], axis=1)
    if stretch.min() <= 0:
        at = int(np.argmin(stretch.min(axis=1)))
        raise RecordingError(
            f"line {table.lines[at]}: stretch {stretch.min():g}; a stretch is above 0 and 1 at rest"
        )
    if stretch.max() > _LONGEST:
        raise RecordingError(
            f"stretch {stretch.max():g}: above {_LONGEST:g}; is it a strain in per cent?"
        )
    turned = (stress[:, 0] * (stretch[:, 0] - 1) < -_ROUNDING * np.abs(stress).max()).sum()
    if 2 * turned > len(stress):
        raise RecordingError(
            f"stress and stretch - 1 differ in sign in {turned} of {len(stress)} rows; "
            "in tension stress is positive and stretch above 1; correct the signs"
        )
    return stretch, stress, said if unit else f"{said}, from the header"
