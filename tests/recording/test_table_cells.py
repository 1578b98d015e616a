"""Which rows of an export hold units, and which numbers."""

import re
from types import SimpleNamespace
from typing import Any

import pytest

from validate.errors import RecordingError, UsageError
from validate.recording.tables import specimens, table
from validate.recording.tables.columns import Said, timed_pick
from validate.recording.tables.table import is_data, is_row, is_unit_row

# private: _cells, _number: called alone, case by case.


@pytest.mark.parametrize(
    ("cells", "units"),
    [
        (("s", "mm", "N"), True),
        (("(s)", "", "(N)"), True),
        (("[newton per square metre]",), True),  # long, but in brackets
        (("[newton per square metre]", "mm"), True),
        (("[newton per square metre]", "specimen"), False),
        (("s", "mm", "specimen"), True),  # most of them, the other as short
        (("1.5", "mm", "N"), False),
        (("", ""), False),
        ((), False),
    ],
)
def test_a_row_of_units(cells: tuple[str, ...], units: bool) -> None:
    assert is_unit_row(cells) == units


@pytest.mark.parametrize(
    ("cells", "row", "data"),
    [
        (("0.1", "2.5"), True, True),
        (("0.1", "2.5", "3.0"), True, True),
        (("Width", "25"), True, False),  # a line of a header block
        (("0.1", ""), True, False),
        (("0.1", "2.5", "a", "b"), True, True),  # half of them
        (("0.1", "2.5", "a", "b", "c"), False, False),
        (("0.1",), False, False),
        (("a", "b"), False, False),
    ],
)
def test_a_row_of_numbers(cells: tuple[str, ...], row: bool, data: bool) -> None:
    assert (is_row(cells), is_data(cells)) == (row, data)


def test_a_line_that_is_no_csv_is_reported_with_its_length() -> None:
    with pytest.raises(RecordingError, match="140001 characters"):
        table._cells("1" * 140_000 + ",", ",")


@pytest.mark.parametrize(
    ("text", "decimal", "expected"),
    [("20", ".", 20), ("20,5", ".", 20.5), ("20.5", ",", 20.5), ("1,250", ".", None),
     ("1.250", ",", None), ("about 20", ".", None)],
)  # fmt: skip
def test_a_number_of_a_header_has_either_sign_but_where_it_may_group(
    text: str, decimal: str, expected: float | None
) -> None:
    if expected is None:
        says = f"header: 'width' is '{re.escape(text)}', not a plain number; write it without"
        with pytest.raises(RecordingError, match=says):
            specimens._number("width", text, decimal)
    else:
        assert specimens._number("width", text, decimal) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [("0.1s", (0.1, "s")), ("5 ms", (5.0, "ms")), ("s", None), ("1.2.3s", None), ("-1s", None),
     ("0.1", None)],
)  # fmt: skip
def test_a_step_of_time_has_its_unit(text: str, expected: tuple[float, str] | None) -> None:
    three: Any = SimpleNamespace(lines=(5, 6, 7))
    if expected is None:
        with pytest.raises(UsageError, match=f"--map time=every:{re.escape(text)}: expected a st"):
            timed_pick("time", three, Said("every", text, None))
    else:
        step, unit = expected
        found = timed_pick("time", three, Said("every", text, None))
        assert (found.unit, found.values.tolist()) == (
            unit,
            [k * step * {"s": 1.0, "ms": 1e-3}[unit] for k in range(3)],
        )
