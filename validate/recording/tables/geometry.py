"""Specimen and test settings in a header block, as SI numbers."""

import math
import re
from collections.abc import Mapping

from validate.errors import RecordingError
from validate.recording.tables.cells import number
from validate.recording.tables.table import split_unit
from validate.recording.tables.vocabulary import OTHER_PARTS, SIZES, holds
from validate.units import is_unit, si_factor

# (name in the record, quantity, words of the header's key, words that make it something else)
_NO_TEST_SPEED = OTHER_PARTS + " jog return preload vorkraft data datenrate abtastrate"
LENGTH = "length_m"
GEOMETRY: tuple[tuple[str, str, str, str], ...] = (
    ("diameter_m", "length", SIZES["diameter"], OTHER_PARTS),
    ("height_m", "length", SIZES["height"], OTHER_PARTS),
    ("width_m", "length", SIZES["width"], OTHER_PARTS),
    ("thickness_m", "length", SIZES["thickness"], OTHER_PARTS),
    (LENGTH, "length", SIZES["length"], OTHER_PARTS),
    ("area_m2", "area", SIZES["area"], OTHER_PARTS),
    ("speed_m_per_s", "speed", SIZES["speed"], _NO_TEST_SPEED),
)
_GLUED = re.compile(r"(?P<number>[-+]?[0-9.,' ]*[0-9][.,]?(?:[eE][-+]?[0-9]+)?)\s*(?P<unit>\D.*)?")


def specimen_of(header: Mapping[str, str], decimal: str) -> dict[str, float]:
    """SI numbers by name (`diameter_m`, `height_m`, ..., `speed_m_per_s`) of the header block.

    Only values with a unit, glued to them or in the key, are used. A strip has several lengths (of
    itself, between grips, of a gauge): where they differ each is `length_m/KEY`, and none is meant.
    Raises `RecordingError` when two other lines, or key and value, contradict each other, and for
    sizes that are not positive.
    """
    found: dict[str, tuple[float, str]] = {}
    lengths: dict[str, float] = {}
    for key, text in header.items():
        for name, quantity, given, taken in GEOMETRY:
            value = _value(key, text, quantity, given, taken, decimal)
            if value is None:
                continue
            if name == LENGTH:
                lengths[f"{LENGTH}/{key}"] = value
            before, by = found.setdefault(name, (value, key))
            if name != LENGTH and not math.isclose(before, value, rel_tol=1e-6):
                raise RecordingError(
                    f"header: '{by}' gives {name} = {before:.6g}, '{key}' {value:.6g}; keep one"
                )
    told = {name: value for name, (value, _) in found.items()}
    if not all(math.isclose(told[LENGTH], value, rel_tol=1e-6) for value in lengths.values()):
        del told[LENGTH]
        told |= lengths
    return told


def loaded_area(specimen: Mapping[str, float], test: str = "") -> float | None:
    """Return the area (m2) under nominal stress: given, of a disc, or of a rectangle; None: not
    known.

    A strip that is pulled has width and thickness. Which two of three sides a pressed block stands
    on is known only beside its height: a thickness may be the height, too.
    """
    if "area_m2" in specimen:
        return specimen["area_m2"]
    if "diameter_m" in specimen:
        return math.pi * specimen["diameter_m"] ** 2 / 4
    if test == "tension":
        sides = [specimen[k] for k in ("width_m", "thickness_m") if k in specimen]
        return sides[0] * sides[1] if len(sides) == 2 else None
    sides = [specimen[k] for k in ("width_m", "thickness_m", "length_m") if k in specimen]
    return sides[0] * sides[1] if len(sides) == 2 and "height_m" in specimen else None


def _value(
    key: str, text: str, quantity: str, given: str, taken: str, decimal: str
) -> float | None:
    if not holds(key, given) or holds(key, taken):
        return None
    parts = _GLUED.fullmatch(text.strip())
    if parts is None:
        return None
    unit = _unit(key, (parts["unit"] or "").strip("()[] "))
    if unit is None or not is_unit(unit):
        return None
    value = _number(key, parts["number"].strip(), decimal) * si_factor(unit, quantity)
    if value <= 0:
        raise RecordingError(f"header: '{key}' is {text}, expected a size above 0")
    return value


def _unit(key: str, glued: str) -> str | None:
    _, in_key = split_unit(key)
    if glued and in_key and is_unit(in_key) and glued != in_key:
        raise RecordingError(f"header: '{key}' is given in {glued}; keep one unit")
    return glued or in_key


def _number(key: str, text: str, decimal: str) -> float:
    """A header number; its decimal sign may differ from the table's where it cannot be grouping."""
    other = "," if decimal == "." else "."
    grouping = re.fullmatch(rf"[1-9][0-9]{{0,2}}\{other}[0-9]{{3}}", text)
    value = None if grouping else number(text, decimal)
    if value is None and not grouping:
        value = number(text, other)
    if value is None:
        raise RecordingError(
            f"header: '{key}' is '{text}', not a plain number; write it without thousands "
            f"separators"
        )
    return value
