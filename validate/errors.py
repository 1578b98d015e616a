"""Errors that a user can cause, with one base class; any other exception is a bug.

The command line prints a `ValidateError` as one line and exits with 2. Messages hold the numbers
that were found and a next step.
"""

import re

_SPACES = "\u00a0\u202f"  # of numbers and units


def one_line(text: str) -> str:
    """The text with line ends and tabs as spaces, other signs that cannot be shown escaped: what a
    file or its name holds reaches a terminal through errors."""
    spaced = re.sub(r" *[\n\r\t\v\f][ \n\r\t\v\f]*", " ", text).strip()
    return "".join(c if c.isprintable() or c in _SPACES else repr(c)[1:-1] for c in spaced)


class ValidateError(Exception):
    """Base of every error a user can mend; its text is one line that a terminal can show."""

    def __str__(self) -> str:
        return one_line(super().__str__())


class UsageError(ValidateError):
    """A name, path or setting that does not exist or does not fit its type."""


class RecordingError(ValidateError):
    """A recording or a foreign file that is damaged, empty, contradictory or of a wrong kind."""


class SceneError(ValidateError):
    """A scene that cannot be simulated: geometry, material or mesh."""


class RegistrationError(ValidateError):
    """Points that do not determine the transform that was asked for."""


class ComparisonError(ValidateError):
    """Nothing to compare: no matched samples, missing reference."""
