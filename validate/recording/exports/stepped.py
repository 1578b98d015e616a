"""Columns that are needed, where times may be a constant step that the user says."""

import numpy as np

from validate.errors import UsageError
from validate.recording.exports.columns import Pick, Said, needed_pick
from validate.recording.exports.table import Column, Table
from validate.units import si_factor


def timed_pick(role: str, table: Table, said: Said | None) -> Pick:
    """The column of a needed role, or times of the constant step that the user says.

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
