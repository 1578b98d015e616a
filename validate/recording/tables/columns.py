"""Columns of time, displacement and force in a table, by name, unit or `--map`.

Words are in `vocabulary`; where one word names a length on one machine and a strain on another, the
column's unit decides.
"""

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.errors import RecordingError, UsageError
from validate.recording.reader import MapOption, did_you_mean
from validate.recording.tables.table import LABVIEW_X, Column, Table, looks_numeric
from validate.recording.tables.vocabulary import LENGTH_OR_STRAIN, holds, role_of_name
from validate.units import si_factor

NEEDED = ("time", "displacement", "force")
QUANTITY = {
    "time": "time",
    "displacement": "length",
    "force": "force",
    "strain": "strain",
    "stress": "stress",
    "stretch": "strain",
}
DERIVED = ("strain", "stretch", "stress")
_NAMED = 12  # columns that an error names
_SIZE_OF = {"displacement": "length=20mm", "force": "area=314mm2"}
SIZES_SAID = ("area", "length", "measure")  # of the specimen; true or engineering
_COLUMN = "as COLUMN:UNIT:SIGN, or none"
OPTIONS = (
    MapOption("time", "time column as COLUMN:UNIT, or a constant step as every:0.1s"),
    MapOption("displacement", f"displacement column, {_COLUMN}"),
    MapOption("force", f"force column, {_COLUMN}"),
    MapOption("strain", "strain column, in place of displacement"),
    MapOption("stretch", "stretch column, in place of displacement"),
    MapOption("stress", "stress column, in place of force"),
    MapOption("area", "area before the test", "m2", "from the header"),
    MapOption("length", "length before the test", "m", "from the header"),
    MapOption("measure", "engineering or true strain and stress", default="as their names say"),
    MapOption("test", "compression or tension", default="from the header and signs"),
    MapOption("specimen", "one of several specimens, by label or number; all"),
    MapOption("repeated", "first or last: row that counts of several with one time"),
    MapOption("encoding", "encoding of the text, as cp1250", default="found out"),
    MapOption("decimal", "decimal mark", default="found out"),
)
_SIGNS = {":-": -1, ":+": 1}


class MissingColumnError(RecordingError):
    """A quantity that is needed and that no column is called by; `asks`: what is to be said."""

    def __init__(self, what: str, asks: tuple[str, ...] = ()) -> None:
        super().__init__(f"{what}: give {'; '.join(asks)}" if asks else what)
        self.what, self.asks = what, asks


@dataclass(frozen=True)
class Said:
    """One mapping entry: column text, unit that overrides the declared one, explicit sign."""

    column: str
    unit: str | None
    sign: int | None


@dataclass(frozen=True)
class Pick:
    """A column in a role, its values in SI; `said`: what the user gave for it, None: found here."""

    role: str
    column: Column
    unit: str
    factor: float
    values: Floats
    said: Said | None

    @property
    def unit_is_said(self) -> bool:
        return self.said is not None and self.said.unit is not None


def parse_mapping(mapping: Mapping[str, str], table: Table) -> dict[str, Said]:
    """Return the mapping's entries by role, see `read_instron`; raises `UsageError` naming the
    nearest."""
    roles = (*NEEDED, *DERIVED)
    return {key: _said(key, text, table) for key, text in mapping.items() if key in roles}


def _said(key: str, text: str, table: Table) -> Said:
    sign = _SIGNS.get(text[-2:])
    body = text[:-2] if sign else text
    if key == "time" and (sign or body.startswith("every:")):
        if sign:
            raise UsageError(f"--map time={text}: time has no sign to set")
        return Said("every", body.removeprefix("every:"), None)
    if _named(body, table):
        return Said(body, None, sign)
    column, colon, unit = body.rpartition(":")
    if colon and _named(column, table):
        return Said(column, unit, sign)
    labels = [c.label for c in table.columns]
    raise UsageError(
        f"--map {key}={text}: no column '{column or body}'; {did_you_mean(body, labels)}the file "
        f"has {', '.join(map(repr, labels))}"
    )


def _named(text: str, table: Table) -> list[Column]:
    """Columns of that label, else of that name (any case); `#3` is the third column."""
    numbered = re.fullmatch(r"#([1-9][0-9]{0,3})", text.strip())
    if numbered:
        return list(table.columns[int(numbered[1]) - 1 : int(numbered[1])])
    wanted = text.strip().casefold()
    labels = [c for c in table.columns if c.label.casefold() == wanted]
    return labels or [c for c in table.columns if c.name and c.name.casefold() == wanted]


def columns_called(role: str, table: Table) -> list[Column]:
    """Return the columns of a role that hold numbers."""
    return [c for c in table.columns if role_of(c) == role and not _without_numbers(c)]


def role_of(column: Column) -> str | None:
    """Return the role of a column by its name and unit, None for a column of no interest here."""
    role = role_of_name(column.name)
    if column.name == LABVIEW_X and _measures(column, "time"):
        return "time"
    if role not in ("displacement", "strain") or not holds(column.name, LENGTH_OR_STRAIN):
        return "displacement" if role == "strain" and _measures(column, "length") else role
    return "strain" if _measures(column, "strain") else role


def time_column(table: Table) -> Column | None:
    """Return the one column of time; None where there is none or several."""
    found = [column for column in table.columns if role_of(column) == "time"]
    return found[0] if len(found) == 1 else None


def _measures(column: Column, quantity: str) -> bool:
    try:
        si_factor(column.unit or "", quantity)
    except RecordingError:
        return False
    return True


def needed_pick(role: str, table: Table, said: Said | None) -> Pick:
    """Return the column of a needed role in SI.

    A column that cannot be of the role, by its unit or without numbers, is no rival of one that
    can. Raises `RecordingError` when no column has the role, several differ, the unit is missing or
    of another kind, or a cell is not a number; `UsageError` when the mapping names two columns.
    """
    if said is not None:
        return said_pick(role, table, said)
    found = [column for column in table.columns if role_of(column) == role]
    if not found:
        labels = ", ".join(repr(c.label) for c in table.columns[:_NAMED])
        if (more := len(table.columns) - _NAMED) > 0:
            labels += f" and {more} more"
        other = _by_unit(role, table) or f" or, where it was not logged, --map {role}=none"
        if role == "time":
            other = " or, at a constant rate, --map time=every:0.1s"
        raise MissingColumnError(
            f"no {role} column among {labels}; name it with --map {role}=COLUMN{other}"
        )
    able = [column for column in found if not _unusable(role, column)] or found
    picks = [picked(role, column, table, None) for column in able]
    # An idle sensor is no rival: constant columns leave where others move.
    picks = [p for p in picks if np.ptp(p.values) > 0] or picks
    # Several columns are one when they hold the same motion up to sign and zero.
    first = min(picks, key=lambda pick: "compress" not in pick.column.name.casefold())
    for pick in picks:
        if not _same(first.values, pick.values):
            raise RecordingError(
                f"{len(picks)} different columns may be {role}: "
                f"{', '.join(repr(p.column.label) for p in picks)}; choose with --map {role}=COLUMN"
            )
    return first


def _by_unit(role: str, table: Table) -> str:
    """The advice where a column without a known name has the unit of a strain or stress."""
    derived = {"displacement": "strain", "force": "stress"}.get(role, "")
    other = [c for c in table.columns if derived and not role_of(c) and _measures(c, derived)]
    if not other:
        return ""
    return (
        f" or, if '{other[0].label}' is a {derived}, --map '{derived}={other[0].label}' "
        f"--map {_SIZE_OF[role]}"
    )


def unnamed_column(role: str, table: Table) -> str:
    """Return the advice where a column that no known word names has the unit of a needed role."""
    found = [c for c in table.columns if not role_of(c) and _measures(c, QUANTITY[role])]
    if not found:
        return ""
    return f" (if '{found[0].label}' is the {role}, give --map '{role}={found[0].label}' alone)"


def said_pick(role: str, table: Table, said: Said) -> Pick:
    """Return the column that the user names; raises as `needed_pick`."""
    named = _named(said.column, table)
    if len(named) != 1:
        raise UsageError(
            f"--map {role}: {len(named)} columns have the name '{said.column}'; give the column's "
            "number instead, as #3"
        )
    return picked(role, named[0], table, said)


def derived_pick(role: str, table: Table) -> Pick | None:
    """Return the strain or stress column that checks the others; None when there is no single sure
    one."""
    found = [c for c in table.columns if role_of(c) == role and not _uncompared(role, c, table)]
    if len(found) > 1:
        found = [c for c in found if re.search(r"engineering|nominal", c.name, re.IGNORECASE)]
    return picked(role, found[0], table, None) if len(found) == 1 else None


def left_columns(table: Table, used: Collection[str]) -> list[str]:
    """Return the columns of interest that cannot be used, each with why, and those without
    numbers."""
    found = {c.label: _left(c, table) for c in table.columns if c.label not in used}
    return [f"column '{label}': {why}" for label, why in found.items() if why]


def _left(column: Column, table: Table) -> str:
    role = role_of(column)
    if role in DERIVED:
        return _uncompared(role, column, table)
    return _unusable(role, column) if role else _without_numbers(column)


def _unusable(role: str, column: Column) -> str:
    """Why a column cannot be of a role, by its unit or cells; empty where it can."""
    if column.problem or _without_numbers(column):
        return column.problem or _without_numbers(column)
    if not column.unit:
        return f"no unit for {role}"
    return "" if _measures(column, QUANTITY[role]) else f"'{column.unit}' is not a unit of {role}"


def _uncompared(role: str, column: Column, table: Table) -> str:
    """Why a derived column cannot be compared with the others; empty where it can.

    A stretch is compared with nothing.
    """
    if role == "stretch":
        return ""
    why = _unusable(role, column)
    if why:
        return why
    try:
        table.numbers(column)
    except RecordingError as error:
        return f"not compared: {error}"
    return ""


def _without_numbers(column: Column) -> str:
    return "" if any(map(looks_numeric, column.cells)) else "empty"


def picked(role: str, column: Column, table: Table, said: Said | None) -> Pick:
    """Return the column in SI; raises as `needed_pick`."""
    # No unit makes a length of a strain, nor a force of a stress: a size is missing.
    if said is not None and role in _SIZE_OF and not _measures(column, QUANTITY[role]):
        called = role_of(column)
        for derived in DERIVED:
            if called == derived or (called != role and _measures(column, QUANTITY[derived])):
                raise UsageError(
                    f"--map {role}={column.label}: this column is a {derived}, not a {role}; give "
                    f"--map '{derived}={column.label}' and the specimen's size, as --map "
                    f"{_SIZE_OF['force' if derived == 'stress' else 'displacement']}"
                )
    unit = (said.unit if said else None) or column.unit
    if column.problem and not (said and said.unit):
        raise RecordingError(f"column '{column.label}': {column.problem}")
    if not unit:
        raise RecordingError(
            f"column '{column.label}': no unit for {role}; give it with --map "
            f"'{role}={column.label}:UNIT'"
        )
    try:
        factor = si_factor(unit, QUANTITY[role])
    except RecordingError as error:
        weight = (column.unit or "").lower()
        fix = (f"if columns are swapped or the unit is wrong, give --map '{role}={column.label}:"
               "UNIT' or another COLUMN")  # fmt: skip
        if role == "force" and weight in ("g", "kg"):
            fix = f"give --map 'force={column.label}:{weight}f'"
        raise RecordingError(f"column '{column.label}' as {role}: {error}; {fix}") from error
    return Pick(role, column, unit, factor, table.numbers(column) * factor, said)


def _same(a: Floats, b: Floats) -> bool:
    limit = 1e-3 * np.ptp(a)
    return bool(min(np.ptp(a - b), np.ptp(a + b)) <= limit)


# --- Columns that are needed, where times may be a constant step that the user says.


def timed_pick(role: str, table: Table, said: Said | None) -> Pick:
    """Return the column of a needed role, or times of the constant step that the user says.

    Raises as `needed_pick`, and `UsageError` for a step that is none.
    """
    if said is None or said.column != "every":
        return needed_pick(role, table, said)
    step, unit = _step(said)
    values = np.arange(len(table.lines), dtype=np.float64) * step
    factor = si_factor(unit, "time")
    return Pick(
        role, Column(f"every {said.unit}", "", unit, ()), unit, factor, values * factor, said
    )


def _step(said: Said) -> tuple[float, str]:
    text = (said.unit or "").strip()
    digits = text.rstrip("abcdefghijklmnopqrstuvwxyz ")
    try:
        step = float(digits)
    except ValueError:
        step = 0.0
    if not (np.isfinite(step) and step > 0) or digits == text:
        raise UsageError(f"--map time=every:{text}: expected a step with its unit, as every:0.1s")
    return step, text[len(digits) :].strip()
