"""Recordings of any format, for scripts."""

from collections.abc import Mapping
from pathlib import Path

from validate.recording.readers import named, recognised
from validate.recording.types import Recording


def open_recording(
    path: str | Path, options: Mapping[str, str] | None = None, *, kind: str = ""
) -> Recording:
    """Return the recording in a file or folder of any format that `validate inspect` reads.

    `options` says what the file does not, as `--map` does (`{"force": "Load:N"}`); `kind` names
    the format where the file does not show it. Times are in s from the first sample, positions in
    m; every stream has its unit, its frame and a standard deviation.

    Raises `UsageError` for a file that no reader recognises, an unknown option and what must be
    said first, `RecordingError` for a damaged file.
    """
    file = Path(path)
    reader = named(kind) if kind else recognised(file)
    return reader.read(file, dict(options or {}))
