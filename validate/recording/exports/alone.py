"""A log of a force or of a displacement alone, as of weights that are hung on or of a stage."""

import hashlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from validate.errors import UsageError
from validate.recording.clocks import clock_of
from validate.recording.exports.columns import Pick, left_columns, parse_mapping
from validate.recording.exports.consistency import check_time
from validate.recording.exports.repeats import without_repeats
from validate.recording.exports.stepped import timed_pick
from validate.recording.exports.table import Table
from validate.recording.formats.text_rows import ASSUMED, told_left
from validate.recording.types import Recording, Signal, Source

NONE = "none"
_UNITS = {"force": "N", "displacement": "m"}


def alone(
    path: Path, data: bytes, table: Table, mapping: Mapping[str, str], label: str, written_as: str
) -> Recording:
    """The one signal that the user did not say to be absent, with the sign that it is written with.

    Raises `UsageError` where both are said to be, and as `needed_pick` does.
    """
    roles = [role for role in _UNITS if mapping.get(role) != NONE]
    if not roles:
        raise UsageError(
            "--map force=none --map displacement=none: no column is left to read; leave one of "
            "them out"
        )
    role = roles[0]
    said = parse_mapping({k: v for k, v in mapping.items() if v != NONE}, table)
    table = without_repeats(table, said.get("time"), mapping.get("repeated"))
    time, pick = (timed_pick(name, table, said.get(name)) for name in ("time", role))
    check_time(time, table.lines)
    sign = (pick.said.sign if pick.said else None) or 1
    y = sign * pick.values[:, None] + 0.0  # no negative zeros
    stamps = np.round(time.values * 1e9).astype(np.int64)
    digest = hashlib.sha256(data).hexdigest()
    return Recording(
        name=path.stem,
        source=Source(path.name, digest, len(data), f"{written_as}: integrity not provable"),
        t0_ns=0,
        signals={role: Signal(time.values, y, _UNITS[role], 0.0, "machine")},
        clock={role: clock_of(role, None, stamps, stamps)},
        metadata={
            "header": dict(table.header),
            ASSUMED: _taken(role, time, pick, sign),
            "provenance": {
                "file": path.name, "sha256": digest, "specimen in file": label,
                **told_left(left_columns(table, {time.column.label, pick.column.label})),
            },
        },
    )  # fmt: skip


def _taken(role: str, time: Pick, pick: Pick, sign: int) -> dict[str, str]:
    how = (
        "reversed, as given by --map"
        if sign < 0
        else "as written: the positive direction is not known"
    )
    units = (f"'{p.column.label}' in {p.unit} x {p.factor:.6g}" for p in (time, pick))
    return {"test": f"only {role}, as given by --map", "signs": how, "units": ", ".join(units)}
