"""Columns of time, displacement and force in a table, and the sign of compression.

Words are in `vocabulary`; where one word names a length on one machine and a strain on another, the
column's unit decides.
"""

import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from validate.arrays import Floats
from validate.errors import RecordingError, UsageError
from validate.recording.reader import MapOption, did_you_mean
from validate.recording.tables.table import LABVIEW_X, Column, Table, looks_numeric
from validate.recording.tables.vocabulary import (
    BESIDE_THE_TEST,
    COMPRESSION,
    LENGTH_OR_STRAIN,
    TENSION,
    holds,
    kind_word,
    plain,
    role_of_name,
    terms,
)
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
        # A column without a known name may have the unit of a strain or stress.
        derived = {"displacement": "strain", "force": "stress"}.get(role, "")
        known = [c for c in table.columns if derived and not role_of(c) and _measures(c, derived)]
        if known:
            other = (
                f" or, if '{known[0].label}' is a {derived}, --map '{derived}={known[0].label}' "
                f"--map {_SIZE_OF[role]}"
            )
        elif role == "time":
            other = " or, at a constant rate, --map time=every:0.1s"
        else:
            other = f" or, where it was not logged, --map {role}=none"
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
    text = (said.unit or "").strip()
    digits = text.rstrip("abcdefghijklmnopqrstuvwxyz ")
    try:
        step = float(digits)
    except ValueError:
        step = 0.0
    if not (np.isfinite(step) and step > 0) or digits == text:
        raise UsageError(f"--map time=every:{text}: expected a step with its unit, as every:0.1s")
    unit = text[len(digits) :].strip()
    values = np.arange(len(table.lines), dtype=np.float64) * step
    factor = si_factor(unit, "time")
    return Pick(
        role, Column(f"every {said.unit}", "", unit, ()), unit, factor, values * factor, said
    )


# --- Whether a test pulls or presses: by the user, the header, the columns, or the sign of
# strain.

KindName = Literal["compression", "tension"]
KINDS: dict[str, KindName] = {"compression": "compression", "tension": "tension"}
ASK = "give --map test=compression or --map test=tension"


@dataclass(frozen=True)
class Kind:
    """The kind of test and what says so; `said`: by the user, whom nothing contradicts."""

    name: KindName
    why: str
    said: bool = False


def kind_of_test(said: str | None, header: Mapping[str, str], labels: Iterable[str]) -> Kind | None:
    """What is stated; None where nothing is, or header and columns contradict each other.

    A line that names both (`Load cell: tension/compression`) tells nothing, nor does one on the
    material, the machine's parts, who tested, a remark or a path: a compression moulded sheet is
    pulled as well. Raises `UsageError` for a kind that is neither.
    """
    if said is not None:
        if said not in KINDS:
            raise UsageError(f"--map test={said}: expected tension or compression")
        return Kind(KINDS[said], "given by --map", said=True)
    lines = [
        value if key.startswith("line ") else f"{key}: {value}"
        for key, value in header.items()
        if _of_the_test(key, value)
    ]
    found = {**_stated(labels, "column"), **_stated(lines, "header")}
    return next(iter(found.values())) if len(found) == 1 else None


def _of_the_test(key: str, value: str) -> bool:
    """Whether a header's line can say what was done, by its key, and by a value that is no path."""
    beside = any(word in plain(key) for word in terms(BESIDE_THE_TEST))
    return not beside and "\\" not in value and value.count("/") < 2


def _stated(texts: Iterable[str], where: str) -> dict[KindName, Kind]:
    """The kinds that the texts name, each with the first text that does."""
    found: dict[KindName, Kind] = {}
    for text in texts:
        words = {"compression": kind_word(text, COMPRESSION), "tension": kind_word(text, TENSION)}
        named = [KINDS[name] for name, word in words.items() if word]
        if len(named) == 1:
            found.setdefault(named[0], Kind(named[0], f"the {where} contains '{text[:60]}'"))
    return found


# -------------------------------------------------------------------------------------------------

_NEITHER = re.compile(r"bend|bieg|flex|deflection|durchbieg|indent|depth|eindring", re.I)
_NAMES: dict[int, KindName] = {1: "compression", -1: "tension"}


@dataclass(frozen=True)
class Signs:
    """Factors (+1 or -1) that make compression positive, their reason, and the kind of test."""

    displacement: int
    force: int
    why: str
    kind: Kind | None = None


def signs(
    displacement: Pick, force: Pick, kind: Kind | None, strain: Pick | None, stress: Pick | None
) -> Signs:
    """Return the flips that make compression positive in both signals.

    Signs are those of the largest change since the first sample. `kind` is the stated one; None:
    strain and stress that go negative decide; displacement and force that do tell nothing, as a
    crosshead may count either way. Raises `UsageError` when nothing does, or kind and sign that are
    said contradict each other, `RecordingError` when both go negative in a stated test in tension;
    the message says what to pass.
    """
    d, f = excursion(displacement.values), excursion(force.values)
    if _said_sign(displacement) or _said_sign(force):
        # The flips that the user gives; the kind of test is then what they make of it.
        said_d, said_f = _said_sign(displacement), _said_sign(force)
        flip_d = said_d or _matching(d, f * (said_f or 1))
        flip_f = said_f or _matching(f, d * flip_d)
        given = _NAMES.get(flip_d * d or flip_f * f)
        if kind and kind.said and given and given != kind.name:
            raise UsageError(
                f"--map test={kind.name}: the signs of the other --map options mean {given}"
            )
        shown = Kind(given, "follows from the sign given by --map") if given else kind
        return Signs(flip_d, flip_f, "sign given by --map", shown)
    if not kind:
        # Compression, where what derives from the test says so: tension is positive by
        # convention.
        derived = [p for p in (strain, stress) if p]
        ways = {excursion(p.values) for p in derived} - {0}
        names = " and ".join(f"'{p.column.label}'" for p in derived)
        if ways == {-1} and (d * f >= 0 or len(derived) == 2):
            kind = Kind(
                "compression", f"{names} go negative, and tension is positive by convention"
            )
    if kind is None:
        # A test that presses no plate on a whole face, by the names of its columns
        neither = ("; a bent or an indented body is neither: give compression if the tool moves "
                   "into it and answer experiment = body in `validate new`")  # fmt: skip
        if not _NEITHER.search(f"{displacement.column.label} {force.column.label}"):
            neither = ""
        raise UsageError(
            f"unclear whether compression or tension: '{displacement.column.label}' goes "
            f"{_way(d)}, '{force.column.label}' {_way(f)}; {ASK}{neither}"
        )
    if kind.name == "tension" and not kind.said and d + f < 0 and d * f >= 0:
        raise RecordingError(
            f"'{displacement.column.label}' and '{force.column.label}' both go negative in a "
            f"tension test ({kind.why}); {ASK}"
        )
    wanted = 1 if kind.name == "compression" else -1
    written = "opposite signs" if d * f < 0 else f"{_way(d or f)} as written"
    why = f"{written} in a {kind.name} test"
    return Signs(wanted * (d or f) or 1, wanted * (f or d) or 1, why, kind)


def excursion(x: Floats) -> int:
    """Return the sign of the largest change since the first sample; 0 when nothing stands out of
    noise."""
    moved = x - x[0]
    largest = float(moved[np.argmax(np.abs(moved))])
    noise = float(np.median(np.abs(np.diff(x, 2)))) if len(x) > 2 else 0.0
    return int(np.sign(largest)) if abs(largest) > 6 * noise else 0


def _said_sign(pick: Pick) -> int | None:
    return pick.said.sign if pick.said else None


def _matching(own: int, other: int) -> int:
    return -1 if own * other < 0 else 1


def _way(sign: int) -> str:
    return {-1: "negative", 0: "nowhere", 1: "positive"}[sign]
