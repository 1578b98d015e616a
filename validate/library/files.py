"""Experiments and recordings by name or file, for scripts."""

from collections.abc import Mapping
from pathlib import Path

from validate.pipeline.experiment.declaration import completed
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import find
from validate.recording.readers import named, recognised
from validate.recording.types import Recording


def load(experiment: str | Path | Experiment) -> Experiment:
    """Return the experiment of a name, of a file (.py or .json), or the one that is given.

    An experiment that was declared in a script or notebook has no file: its recordings are found
    from the current folder. A file with the suffix .py is code and is executed.

    Raises `UsageError` for an unknown name, with the nearest ones, and for a file that declares no
    experiment.
    """
    if not isinstance(experiment, Experiment):
        return find(str(experiment), Path.cwd())
    if experiment.path is not None:
        return experiment
    return completed(experiment, Path.cwd() / f"{experiment.name}.py")


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
