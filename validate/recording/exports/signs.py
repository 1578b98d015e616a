"""Which way compression points in a force-displacement table, and which columns to flip for it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.errors import RecordingError
from validate.recording.exports.columns import Pick
from validate.recording.exports.vocabulary import COMPRESSION, TENSION, holds


@dataclass(frozen=True)
class Signs:
    """Factors (+1 or -1) that make compression positive, and the reason for the provenance."""

    displacement: int
    force: int
    why: str


def kind_of_test(header: Mapping[str, str], labels: tuple[str, ...]) -> str | None:
    """`compression` or `tension` as the header says, else the column names; None: neither."""
    for text in (" ".join(f"{k} {v}" for k, v in header.items()), " ".join(labels)):
        squeezed, pulled = holds(text, COMPRESSION), holds(text, TENSION)
        if squeezed != pulled:
            return "compression" if squeezed else "tension"
    return None


def signs(
    displacement: Pick, force: Pick, kind: str | None, strain: Pick | None, stress: Pick | None
) -> Signs:
    """The flips that make compression positive in both signals.

    Signs are those of the largest change since the first sample. Raises `RecordingError` when
    displacement and force move opposite ways, or both against the declared kind of test, and
    nothing in the file decides; the message says what to pass.
    """
    d, f = excursion(displacement.values), excursion(force.values)
    said_d, said_f = _said_sign(displacement), _said_sign(force)
    if said_d or said_f:
        flip_d = said_d or _matching(d, f * (said_f or 1))
        flip_f = said_f or _matching(f, d * flip_d)
        return Signs(flip_d, flip_f, "sign given by the user")
    if d * f >= 0:
        return _alike(d or f, kind, displacement, force)
    if kind is None and _both_negative(strain, stress):
        kind = "compression"
    if kind is None:
        raise RecordingError(
            f"'{displacement.column.label}' goes {_way(d)} and '{force.column.label}' {_way(f)}, "
            "and the file names neither compression nor tension; for a compression test say "
            + _advice(displacement if d < 0 else force)
        )
    wanted = 1 if kind == "compression" else -1
    return Signs(wanted * d or 1, wanted * f or 1, f"opposite signs in a {kind} test")


def excursion(x: Floats) -> int:
    """The sign of the largest change since the first sample; 0 when nothing stands out of noise."""
    moved = x - x[0]
    largest = float(moved[np.argmax(np.abs(moved))])
    noise = float(np.median(np.abs(np.diff(x, 2)))) if len(x) > 2 else 0.0
    return int(np.sign(largest)) if abs(largest) > 6 * noise else 0


def _alike(way: int, kind: str | None, displacement: Pick, force: Pick) -> Signs:
    if way >= 0 and kind != "tension":
        said = "says compression" if kind else "does not say which; taken as compression"
        return Signs(1, 1, f"both positive as written; the file {said}")
    if way >= 0:
        return Signs(-1, -1, "a tension test, positive as written: compression is negative")
    if kind == "tension":
        raise RecordingError(
            f"'{displacement.column.label}' and '{force.column.label}' both go negative in a "
            f"tension test; if it was a compression test say {_advice(displacement)} and "
            f"{_advice(force)}"
        )
    return Signs(-1, -1, "both negative as written: compression was negative")


def _said_sign(pick: Pick) -> int | None:
    return pick.said.sign if pick.said else None


def _matching(own: int, other: int) -> int:
    return -1 if own * other < 0 else 1


def _both_negative(strain: Pick | None, stress: Pick | None) -> bool:
    return bool(strain and stress and excursion(strain.values) < 0 and excursion(stress.values) < 0)


def _way(sign: int) -> str:
    return "negative" if sign < 0 else "positive"


def _advice(pick: Pick) -> str:
    return f"--map '{pick.role}={pick.column.label}:-'"
