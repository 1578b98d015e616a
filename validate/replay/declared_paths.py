"""The paths of a declaration, checked when it is read: an error names the path and the line."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from validate.errors import UsageError, ValidateError
from validate.parameters import describe, has_path, nearest_names
from validate.replay.experiment import Experiment
from validate.replay.method import Method
from validate.replay.tree import follows
from validate.replay.variation import ByPath, Shift, Values


def require_paths(experiment: Experiment, file: Path) -> None:
    """Raises `UsageError` for a variation, case, effect or method whose path or rule is none."""
    parameters = experiment.parameters
    for what, change in _changes(experiment):
        try:
            change(parameters)
        except ValidateError as error:
            raise UsageError(f"{file}{_line(file, what)}: {error}") from error
    for name, method in experiment.methods.items():
        for path in _unknown(method, parameters):
            known = {p.path for p in describe(parameters)}
            raise UsageError(
                f"{file}{_line(file, (path,))}: method '{name}' changes the unknown parameter "
                f"'{path}'; {nearest_names(path, known)}"
            )
    for name in experiment.accepted:
        if name not in experiment.methods:
            near = nearest_names(name, set(experiment.methods))
            raise UsageError(f"{file}{_line(file, (name,))}: accepted: no method '{name}'; {near}")


def _changes(experiment: Experiment) -> Iterator[tuple[tuple[str, ...], Any]]:
    """The paths of each change that is data, and the change."""
    declared = experiment.uncertainty
    for one in declared.inputs if declared else ():
        if isinstance(one.move, Shift):
            yield one.move.paths, one.by(0.0)
    cases = [case.change for case in experiment.cases]
    effects = [v.change for e in experiment.effects for v in (e.one, e.other)]
    for change in (*cases, *effects, experiment.quick):
        if isinstance(change, Values):
            yield tuple(path for path, _ in change.by_path), change


def _unknown(method: Method, parameters: Any) -> tuple[str, ...]:
    """Paths that a method changes, or takes a value from ("as PATH")."""
    scene = method.scene if isinstance(method.scene, ByPath) else ByPath({})
    taken = (value[3:] for value in scene.values() if follows(value))
    return tuple(path for path in (*scene, *taken) if not has_path(parameters, path))


def _line(file: Path, paths: tuple[str, ...]) -> str:
    """Where the file spells one of the paths first."""
    lines = file.read_text("utf-8").splitlines()
    for number, text in enumerate(lines, start=1):
        if any(f'"{path}"' in text for path in paths):
            return f", line {number}"
    return ""
