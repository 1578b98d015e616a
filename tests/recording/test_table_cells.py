"""Which rows of an export hold units."""

import pytest

from validate.recording.exports.cells import is_unit_row


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
