"""Sign of compression in a force-displacement table, and columns to invert."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from validate.arrays import Floats
from validate.errors import RecordingError, UsageError
from validate.recording.tables.columns import Pick
from validate.recording.tables.vocabulary import (
    BESIDE_THE_TEST,
    COMPRESSION,
    TENSION,
    kind_word,
    plain,
    terms,
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
