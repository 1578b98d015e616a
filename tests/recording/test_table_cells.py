"""Which rows of an export hold units, and which numbers."""

import pytest

from validate.recording.exports.cells import is_data, is_row, is_unit_row


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
