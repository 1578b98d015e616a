"""Errors a user can cause. One base class; everything else that escapes is a bug.

The command line prints a `ValidateError` as one line and exits with 2. Messages hold the numbers
that were found and a next step.
"""


class ValidateError(Exception):
    """Base of every error a user can mend."""


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
