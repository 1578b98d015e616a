"""Consistency checks of a force-displacement table.

Strain and stress columns are used here only: they are derived from displacement and force, so they
must agree with them. All arrays are (n,) and in SI.
"""

import math
from collections.abc import Sequence

import numpy as np

from validate.arrays import Floats
from validate.errors import RecordingError
from validate.recording.tables.cells import decimals
from validate.recording.tables.columns import Pick

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
        raise RecordingError(
            f"{what} m{'2' if base.role == 'force' else ''}: {_cause(slope, base)}"
        )
    rest = np.abs(derived.values - start - slope * expected)
    limit = _row_limit(rest, np.ptp(derived.values)) + _grain(derived) + _grain(base) / divisor
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


def _cause(slope: float, base: Pick) -> str:
    fix = f"give the true unit with --map '{base.role}={base.column.label}:UNIT'"
    power = _power_of_ten(abs(slope))
    if power:
        return f"contradictory units (a factor of 1e{power:+d}); {fix}, or the true size"
    return f"expected 1: sizes and columns contradict each other; correct one or {fix}"


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


def _row_limit(rest: Floats, extent: float) -> float:
    """How far one row may be off: what most rows are off, at most a part of the range."""
    return min(ROW * extent, OUTLIER * float(np.median(rest))) + 1e-9 * extent


def _grain(pick: Pick) -> float:
    """The last decimal that the column is written with, in SI."""
    digits = max(decimals(cell) for cell in pick.column.cells)
    return pick.factor * 10.0 ** -min(digits, 15)
