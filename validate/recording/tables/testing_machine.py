"""Force-displacement tests exported as text (Instron / Bluehill and others) as recordings.

Consistency checks of a force-displacement table.

Strain and stress columns are used here only: they are derived from displacement and force, so
they must agree with them. All arrays are (n,) and in SI.
"""

import codecs
import hashlib
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from validate.arrays import Floats
from validate.errors import RecordingError, UsageError
from validate.recording.motion_capture.text_rows import ASSUMED, told_left
from validate.recording.reader import Reader, head
from validate.recording.tables.blocks import parse_tables, without_repeats
from validate.recording.tables.columns import (
    ASK,
    NEEDED,
    OPTIONS,
    Kind,
    MissingColumnError,
    Pick,
    Said,
    Signs,
    derived_pick,
    kind_of_test,
    left_columns,
    parse_mapping,
    role_of,
    signs,
    timed_pick,
)
from validate.recording.tables.point_table import field_columns
from validate.recording.tables.specimens import (
    Sized,
    Sizes,
    chosen,
    derived,
    is_derived,
    loaded_area,
    require_left,
    sizes_of,
    specimen_of,
    specimen_tables,
    with_sizes,
)
from validate.recording.tables.table import Table, decimals, whole_file
from validate.recording.tables.vocabulary import tells_a_stop
from validate.recording.types import Record, Recording, Signal, Source, clock_of

MIN_SAMPLES = 10
SCALE = 0.02  # a derived column further off its definition than this contradicts it
ROW = 0.01  # one row further off, as a part of the column's range, contradicts it,
OUTLIER = 20.0  # and so does one this many times further off than half of the rows


def check_time(pick: Pick, lines: Sequence[int]) -> None:
    """Raises `RecordingError` for time that stands still or runs backward, with line and values."""
    t = pick.values / pick.factor
    steps = np.diff(t)
    for bad, what in ((steps < 0, "runs backward"), (steps == 0, "stands still")):
        if bad.any():
            at = int(np.argmax(bad)) + 1
            raise RecordingError(
                f"line {lines[at]}: time {what}, {t[at - 1]:.6g} -> {t[at]:.6g} {pick.unit} "
                f"({int(bad.sum())} such rows); correct the rows; for rows of equal time give "
                f"--map repeated=last (or first); at a constant rate give --map time=every:0.1s"
            )


def check_derived(base: Pick, derived: Pick, divisor: float, lines: Sequence[int]) -> str:
    """Compare a strain or stress column with displacement / height or force / area (SI `divisor`).

    Returns what was found, for the provenance. Raises `RecordingError` for a wrong scale, told
    apart by powers of ten, and for single rows that do not fit. A unit from the
    mapping is believed.
    """
    expected = base.values / divisor
    if np.ptp(expected) == 0 or np.ptp(derived.values) == 0:
        return f"'{derived.column.label}' is constant: not compared"
    slope, start = np.polyfit(expected, derived.values, 1)
    what = f"'{derived.column.label}' is {abs(slope):.4g} x '{base.column.label}' / {divisor:.6g}"
    if base.unit_is_said:
        return f"{what} (unit given by --map, not checked)"
    if abs(abs(slope) - 1) > SCALE:
        fix = f"give the true unit with --map '{base.role}={base.column.label}:UNIT'"
        cause = f"expected 1: sizes and columns contradict each other; correct one or {fix}"
        if power := _power_of_ten(abs(slope)):
            cause = f"contradictory units (a factor of 1e{power:+d}); {fix}, or the true size"
        raise RecordingError(f"{what} m{'2' if base.role == 'force' else ''}: {cause}")
    rest = np.abs(derived.values - start - slope * expected)
    # How far one row may be off: what most rows are off, at most a part of the range.
    extent = np.ptp(derived.values)
    limit = (
        (min(ROW * extent, OUTLIER * float(np.median(rest))) + 1e-9 * extent)
        + _grain(derived)
        + _grain(base) / divisor
    )
    if rest.max() > limit:
        at = int(np.argmax(rest))
        raise RecordingError(
            f"line {lines[at]}: '{derived.column.label}' {derived.values[at]:.6g} (SI) and "
            f"'{base.column.label}' {base.values[at]:.6g} (SI) contradict each other by "
            f"{rest[at]:.3g}, {int((rest > limit).sum())} such rows; correct these rows or "
            f"confirm with --map '{base.role}={base.column.label}:{base.unit}'"
        )
    return what


def check_speed(time: Pick, displacement: Pick, declared: float) -> None:
    """Raise `RecordingError` when the motion is 10^k or 60 times the declared speed (m/s)."""
    if time.unit_is_said or displacement.unit_is_said or declared <= 0:
        return
    steps = np.abs(np.diff(displacement.values) / np.diff(time.values))
    moving = steps[steps > 0.1 * steps.max()] if steps.max() > 0 else steps
    ratio = float(np.median(moving)) / declared
    if ratio > 0 and (_power_of_ten(ratio) or min(abs(ratio * k - 1) for k in (60, 1 / 60)) < 0.05):
        raise RecordingError(
            f"contradictory units: the header declares {declared:.4g} m/s, the columns move at "
            f"{ratio:.4g} times that with '{displacement.unit}' and '{time.unit}'; give the true "
            f"one with --map 'displacement={displacement.column.label}:UNIT'"
        )


def check_swapped(
    time: Pick, displacement: Pick, force: Pick, strain: Pick | None, stress: Pick | None
) -> None:
    """Raise `RecordingError` when force moves as a displacement does, and the reverse.

    Two signs: the strain column follows force and the stress column displacement; or force is a
    straight ramp in time while displacement is not or goes back and forth. A load-controlled test
    looks like the second and needs a mapping. Columns given by the user are believed.
    """
    if displacement.said or force.said:
        return
    d, f = displacement.values, force.values
    pairs = [(p.values, good, bad) for p, good, bad in ((strain, d, f), (stress, f, d)) if p]
    crossed = [_misfit(x, good) > 100 * _misfit(x, bad) + 1e-6 for x, good, bad in pairs]
    ramp, other = _misfit(time.values, f), _misfit(time.values, d)
    backward = _backward(d) > 0.01 and _backward(f) == 0
    if (crossed and all(crossed)) or (ramp < 1e-4 and (other > 100 * ramp + 1e-3 or backward)):
        raise RecordingError(
            f"'{force.column.label}' moves like a crosshead and '{displacement.column.label}' "
            f"like a load (1 - r^2 over time {ramp:.1e} and {other:.1e}): swapped columns or a "
            f"load-controlled test; choose with --map 'force={force.column.label}', or "
            f"--map 'force={displacement.column.label}:UNIT' and "
            f"--map 'displacement={force.column.label}:UNIT'"
        )


def check_height(displacement: Pick, closing: Floats, height: float) -> None:
    """Raise `RecordingError` when the plates close (m) by more than the specimen's height (m)."""
    most = float(np.max(closing - closing[0]))
    if most >= height and not displacement.unit_is_said:
        raise RecordingError(
            f"'{displacement.column.label}' closes {most * 1e3:.4g} mm on a specimen "
            f"{height * 1e3:.4g} mm high: wrong unit or swapped columns; give the unit with "
            f"--map 'displacement={displacement.column.label}:UNIT'"
        )


def _power_of_ten(ratio: float) -> int:
    """k when `ratio` is 10^k within 5 %, k not 0; else 0."""
    power = round(math.log10(ratio))
    return power if abs(ratio / 10.0**power - 1) < 0.05 else 0


def _misfit(x: Floats, y: Floats) -> float:
    """1 - r^2 of a straight line of y over x; 1 when one of them is constant."""
    x, y = _centred(x), _centred(y)
    scale = float(x @ x) * float(y @ y)
    return max(0.0, 1 - float(x @ y) ** 2 / scale) if scale > 0 else 1.0


def _centred(x: Floats) -> Floats:
    """About its mean and over its largest value: squares of a damaged file's numbers overflow."""
    x = x / (float(np.abs(x).max()) or 1.0)
    return np.asarray(x - x.mean())


def _backward(x: Floats) -> float:
    """The part of the steps that go against the whole motion."""
    steps = np.diff(x) * np.sign(x[-1] - x[0])
    return float(np.mean(steps < 0))


def _grain(pick: Pick) -> float:
    """The last decimal that the column is written with, in SI."""
    digits = max(decimals(cell) for cell in pick.column.cells)
    return pick.factor * 10.0 ** -min(digits, 15)


# --- A log of a force or of a displacement alone, as of weights that are hung on or of a stage.

NONE = "none"
_UNITS = {"force": "N", "displacement": "m"}


def alone(
    path: Path, data: bytes, table: Table, mapping: Mapping[str, str], label: str, written_as: str
) -> Recording:
    """Return the one signal that the user did not say to be absent, with the sign that it is
    written with.

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
    how = (
        "reversed, as given by --map"
        if sign < 0
        else "as written: the positive direction is not known"
    )
    units = (f"'{p.column.label}' in {p.unit} x {p.factor:.6g}" for p in (time, pick))
    return Recording(
        name=path.stem,
        source=Source(path.name, digest, len(data), f"{written_as}: integrity not provable"),
        t0_ns=0,
        signals={role: Signal(time.values, y, _UNITS[role], 0.0, "machine")},
        clock={role: clock_of(role, None, stamps, stamps)},
        metadata={
            "header": dict(table.header),
            ASSUMED: {
                "test": f"only {role}, as given by --map", "signs": how, "units": ", ".join(units),
            },
            "provenance": {
                "file": path.name, "sha256": digest, "specimen in file": label,
                **told_left(left_columns(table, {time.column.label, pick.column.label})),
            },
        },
    )  # fmt: skip


# -------------------------------------------------------------------------------------------------

_SEPARATOR_NAMES = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar", "  ": "space",
                    " ": "space"}  # fmt: skip


def read_instron(path: Path, mapping: Mapping[str, str] | None = None) -> Recording:
    """Read a force-displacement test exported as CSV text, of one specimen.

    Returns signals `displacement` (nt, 1) m and `force` (nt, 1) N, compression positive, on the
    file's own time in s (sd 0: not stated), and the records `header` (as written), `specimen`
    (`diameter_m`, `height_m`, ..., in SI; `test`: compression or tension), `assumed` (kind of test,
    signs, unit factors, each with what decided) and `provenance` (columns, unit factors, sign
    flips, what was compared). Strain and stress columns only check the others.

    `mapping` overrides what the file says (`--map KEY=VALUE` of the command line):

        force=COLUMN[:UNIT][:-]          UNIT replaces the declared unit, `:-` flips the sign,
        displacement=COLUMN[:UNIT][:-]   `:+` keeps it; COLUMN is the header text, with or without
        time=COLUMN[:UNIT]               its unit, or #3 for the third column
        displacement=none, force=none    it was not logged: the other comes in alone, as written
        time=every:STEP UNIT             no or useless time column: constant step, `every:0.1s`
        strain=, stress=, stretch=       COLUMN[:UNIT], where force or displacement is not written:
        area=314mm2, length=20mm         sizes before the test that make them of stress and strain
        measure=engineering|true         of which body these are, where their names do not say
        test=compression|tension         where neither words nor the sign of strain say it
        specimen=LABEL                   which of several specimens, by the file's label or number
        repeated=first|last              which row counts where several have the same time
        encoding=cp1250, decimal=,       how the text is written, where that cannot be found out

    A column or unit given so is believed: checks of it are reported in `provenance`, not raised.
    Raises `UsageError` for a missing file, an unknown column, and a test that may press or
    pull; `RecordingError` for a file that is no such table, is damaged or contradicts itself, or
    holds several specimens and none is named; nothing is ever returned in part.
    """
    said = dict(mapping or {})
    data = whole_file(path)
    try:
        tables = specimen_tables(parse_tables(data, said.get("encoding"), said.get("decimal")))
        label, table = chosen(tables, said.get("specimen"))
        return recording_of(path, data, table, said, label)
    except RecordingError as error:
        raise RecordingError(f"{path.name}: {error}") from error
    except UsageError as error:
        raise UsageError(f"{path.name}: {error}") from error


def recording_of(
    path: Path,
    data: bytes,
    table: Table,
    mapping: Mapping[str, str],
    label: str,
    written_as: str = "text file",
) -> Recording:
    """Return the recording of the table of one specimen; `data` are the bytes of the file."""
    # Refuse rows of a displacement field; with times or a force they may be a test.
    field = field_columns([c.name for c in table.columns])
    if field and not {"time", "force"} & {role_of(c) for c in table.columns}:
        raise RecordingError(field.refusal(f"{len(table.lines)} rows"))
    if NONE in (mapping.get("force"), mapping.get("displacement")):
        return alone(path, data, table, mapping, label, written_as)
    said = parse_mapping(mapping, table)
    table = without_repeats(table, said.get("time"), mapping.get("repeated"))
    if len(table.lines) < MIN_SAMPLES:
        raise RecordingError(
            f"{len(table.lines)} samples; at least {MIN_SAMPLES} are needed; export the whole test"
        )
    specimen = specimen_of(table.header, table.decimal)
    # The names of the columns that the test is made of, whether they are taken or not.
    kind = kind_of_test(
        mapping.get("test"), table.header, [c.label for c in table.columns if role_of(c)]
    )
    sizes = sizes_of(mapping, specimen, kind)
    found = _found(table, said, sizes, kind)
    picks = {role: one.pick for role, one in found.items()}
    made = {role: one for role, one in found.items() if one.words}
    kind = kind or next((one.kind for one in made.values() if one.kind), None)
    specimen = with_sizes(specimen, mapping)
    # All checks; the flips and what the derived columns said.
    time, displacement, force = (found[role].pick for role in NEEDED)
    strain, stress = derived_pick("strain", table), derived_pick("stress", table)
    check_time(time, table.lines)
    if not made:
        check_swapped(time, displacement, force, strain, stress)
    pairs = (
        (displacement, strain, specimen.get("height_m")),
        (force, stress, loaded_area(specimen, kind.name if kind else "")),
    )
    notes = [
        check_derived(base, beside, size, table.lines)
        for base, beside, size in pairs
        if beside is not None and size is not None and base.role not in made
    ]
    if "speed_m_per_s" in specimen and "displacement" not in made:
        check_speed(time, displacement, specimen["speed_m_per_s"])
    flips = signs(displacement, force, kind, strain, stress)
    closing = displacement.values * flips.displacement
    if "displacement" in made and sizes.length:
        require_left(made["displacement"], closing, sizes.length)
    elif "height_m" in specimen:
        check_height(displacement, closing, specimen["height_m"])
    t = time.values
    signals = {
        "displacement": Signal(
            t, _column(displacement.values * flips.displacement), "m", 0.0, "machine"
        ),
        "force": Signal(t, _column(force.values * flips.force), "N", 0.0, "machine"),
    }
    stamps = np.round(t * 1e9).astype(np.int64)
    digest = hashlib.sha256(data).hexdigest()
    origin = {"file": path.name, "sha256": digest, "specimen in file": label}
    shown = {key: repr(value) for key, value in specimen.items()}
    return Recording(
        name=path.stem,
        source=Source(path.name, digest, len(data), f"{written_as}: integrity not provable"),
        t0_ns=0,
        signals=signals,
        clock={topic: clock_of(topic, None, stamps, stamps) for topic in signals},
        metadata={
            "header": dict(table.header),
            "specimen": {**shown, "test": flips.kind.name if flips.kind else "not stated"},
            ASSUMED: _assumed(table.header, picks, made, flips),
            "provenance": {**origin, **_provenance(table, picks, flips, notes, mapping)},
        },
    )


def _found(
    table: Table, said: Mapping[str, Said], sizes: Sizes, kind: Kind | None
) -> dict[str, Sized]:
    """The needed roles, those made by a size with words on how; what is missing is told at once."""
    found: dict[str, Sized] = {}
    wrong: list[RecordingError] = []
    for role in NEEDED:
        try:
            if is_derived(role, table, said):
                found[role] = derived(role, table, said, sizes, kind)
            else:
                found[role] = Sized(timed_pick(role, table, said.get(role)), "")
        except RecordingError as error:
            wrong.append(error)
    missing = [e for e in wrong if isinstance(e, MissingColumnError)]
    if len(wrong) == 1 and (kind or not missing):
        raise wrong[0]
    if wrong:
        # One error for all that is missing, each thing to be said once.
        what = "; ".join(e.what if isinstance(e, MissingColumnError) else str(e) for e in wrong)
        asks = dict.fromkeys(ask for e in missing for ask in e.asks)
        if missing and not kind:
            asks[f"{ASK.removeprefix('give ')}, as neither strain nor stretch shows it"] = None
        raise RecordingError(what + (f"; give {'; '.join(asks)}" if asks else ""))
    # Raises `UsageError` where one column would be both.
    force = found["force"].pick
    if found["displacement"].pick.column is force.column:
        kept = "force" if force.said else "displacement"
        other = "displacement" if force.said else "force"
        left = [c.label for c in table.columns if role_of(c) == kept and c is not force.column]
        raise UsageError(
            f"column '{force.column.label}' would be both displacement and force; name the other "
            f"column, as --map '{other}={left[0] if left else 'COLUMN'}:UNIT'"
        )
    return found


def _column(x: Floats) -> Floats:
    """(n,) as (n, 1); adding 0 turns the negative zeros of such exports into zeros."""
    return x[:, None] + 0.0


def _provenance(
    table: Table,
    picks: Mapping[str, Pick],
    flips: Signs,
    notes: list[str],
    mapping: Mapping[str, str],
) -> Record:
    used = {picks[role].column.label for role in NEEDED}
    return {
        **{f"{role} column": picks[role].column.label for role in NEEDED},
        **{f"{role} unit": f"{p.unit} x {p.factor!r}" for role, p in picks.items()},
        "signs flipped": _flipped(flips),
        "given by the user": ", ".join(f"{k}={v}" for k, v in mapping.items()) or "nothing",
        "compared": "; ".join(notes) or "nothing: no strain or stress with known geometry",
        "columns not used": ", ".join(c.label for c in table.columns if c.label not in used),
        **told_left(left_columns(table, used)),
        "besides": "; ".join(table.notes) or "nothing",
        "text": f"{table.encoding} ({table.encoding_why}), "
        f"{_SEPARATOR_NAMES[table.separator]} separated, decimal sign {table.decimal}, "
        f"{len(table.lines)} rows",
    }


def _flipped(flips: Signs) -> str:
    flipped = [role for role in ("displacement", "force") if getattr(flips, role) < 0]
    return ", ".join(flipped) or "none"


def _assumed(
    header: Mapping[str, str], picks: Mapping[str, Pick], made: Mapping[str, Sized], flips: Signs
) -> Record:
    """Kind of test, signs, unit factors and sizes, each with what decided, and an early end."""
    kind = f"{flips.kind.name}: {flips.kind.why}" if flips.kind else "not stated"
    units = [
        f"'{p.column.label}' in {p.unit} x {p.factor:.6g}{' (given)' if p.unit_is_said else ''}"
        for p in picks.values()
    ]
    assumed = {
        "test": kind,
        "signs": f"flipped: {_flipped(flips)}, so that compression is positive; {flips.why}",
        "units": ", ".join(units),
    }
    if made:
        assumed["sizes"] = "; ".join(one.words for one in made.values())
    # Words that tell that the run was ended early; how far it got is in the rows.
    lines = (v if k.startswith("line ") else f"{k}: {v}" for k, v in header.items())
    if stop := next((text for text in lines if tells_a_stop(text)), None):
        assumed["run"] = f"aborted, by the words '{stop[:60]}'; rows up to there are read"
    return assumed


def _is_text(path: Path) -> bool:
    """Whether the file begins with text: with a UTF-16 mark, or without control characters."""
    start = head(path)
    wide = start.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    return wide or (any(start) and not re.search(rb"[\x01-\x08\x0e-\x19\x1b-\x1f]", start))


INSTRON = Reader(
    "instron",
    "a testing machine's export, text",
    _is_text,
    read_instron,
    "it is text of no other known format",
    options=OPTIONS,
    extensions=(".csv", ".txt", ".tsv"),
    general=True,
)
