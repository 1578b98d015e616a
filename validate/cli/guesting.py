"""`validate guest check`: what a program of others can do, and how far off it is."""

import json
from collections.abc import Sequence
from dataclasses import asdict

from validate.cli.arguments import FAILED, OK
from validate.cli.display import say, table
from validate.solve.guests.guest import Guest
from validate.solve.guests.suite import OffBy, check_guest

_STATES = {"finished": "yes", "refused": "no"}


def check(command: str, seconds: float, memory: float, as_json: bool) -> int:
    """Runs the small scenes; fails where a run went wrong, or none was finished.

    How far off a guest may be is its user's to say: no error fails.
    """
    guest = Guest(command, seconds=seconds, memory=memory)
    found = [row for rows in check_guest(guest) for row in rows]
    if as_json:
        print(json.dumps([asdict(row) for row in found], indent=2, allow_nan=False))
    else:
        _print(found)
    states = {row.state for row in found}
    return OK if "finished" in states and states <= set(_STATES) else FAILED


def _print(found: Sequence[OffBy]) -> None:
    head = ["scene", "can it", "quantity", "error", "exact", "unit"]
    table("", head, [_row(row) for row in found])
    for row in found:
        if row.why:
            say(f"{row.scene}: {row.why}", indent="  ")


def _row(row: OffBy) -> list[str]:
    milli, unit = (1e3, "mm") if row.unit == "m" else (1.0, row.unit)
    error = "-" if row.error is None else f"{milli * row.error:.3g}"
    can = _STATES.get(row.state, row.state)
    return [row.scene, can, row.quantity, error, f"{milli * row.exact:.4g}", unit]
