"""What stands beside a table of samples in a form of its own: sizes in a table, LabVIEW's units."""

from collections.abc import Sequence

from validate.recording.exports.cells import Line
from validate.recording.exports.vocabulary import OTHER_PARTS, SIZES, holds
from validate.units import is_unit

LABVIEW_X = "X_Value"  # what a LabVIEW measurement file calls its first column
_SIZE_WORDS = " ".join(words for size, words in SIZES.items() if size != "speed")


def size_lines(names: Line, units: Sequence[str], rows: Sequence[Line]) -> list[Line]:
    """Header lines of a small table of sizes, as Trapezium writes it above its samples: names, a
    row of units, a row a specimen. None where specimens differ: which is meant nothing says."""
    found: list[Line] = []
    for i, name in enumerate(names[1]):
        unit = units[i] if i < len(units) else ""
        values = {cells[i] for _, cells in rows if i < len(cells)}
        if is_unit(unit) and len(values) == 1 and _is_size(name):
            found.append((names[0], [name, *values, unit]))
    return found


def _is_size(name: str) -> bool:
    return holds(name, _SIZE_WORDS) and not holds(name, OTHER_PARTS)


def labview_units(names: Sequence[str], above: Sequence[Line]) -> list[str]:
    """Units of the columns of a LabVIEW measurement file, whose header has them by channel; none
    for other tables, and for those with a column of x for each channel."""
    header = {cells[0]: cells[1:] for _, cells in above if cells}
    if list(names).count(LABVIEW_X) != 1 or names[0] != LABVIEW_X or "Y_Unit_Label" not in header:
        return []
    over_time = {cell for cell in header.get("X_Dimension", []) if cell} == {"Time"}
    return ["s" if over_time else "", *header["Y_Unit_Label"]]
