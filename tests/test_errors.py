"""Errors of users are one line that a terminal can show."""

from validate.errors import UsageError


def test_line_ends_and_signs_of_control_are_shown_and_spaces_of_numbers_kept() -> None:
    said = str(UsageError("3\u202f553 Pa,\n\x1b[31m of 'a\u200bb'"))
    assert said == "3\u202f553 Pa, \\x1b[31m of 'a\\u200bb'"
