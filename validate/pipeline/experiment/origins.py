"""Origin of every parameter: recording, user, default or identified; open parameters."""

import ast
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from validate.errors import UsageError
from validate.parameters import Origin, Parameter, describe, with_values
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.options import Options, folder_of
from validate.recording.types import Recording

_WRITTEN = 1e-5  # relative: a number of the recording that was written with six digits


@dataclass(frozen=True)
class Opened:
    """An experiment's recordings, its parameters with what they say, and what that is by path.

    `taken` are the paths that stood open until then.
    """

    recordings: tuple[Recording, ...]
    parameters: Any
    stated: Mapping[str, float]
    taken: tuple[str, ...]


def opened(experiment: Experiment, parameters: Any) -> Opened:
    """Load the recordings; what is not set is taken from them.

    Raises `UsageError` for what neither they nor the user say, with the line of the file.
    """
    recordings = experiment.load(parameters, folder_of(experiment))
    # What all recordings say alike
    each = [experiment.stated(r) for r in recordings]
    first = each[0] if each else {}
    stated = {k: v for k, v in first.items() if all(same(o.get(k), v) for o in each)}
    taken = tuple(p.path for p in describe(parameters) if p.default is None and p.path in stated)
    filled = with_values(parameters, {path: repr(stated[path]) for path in taken})
    missing = tuple(p for p in describe(filled) if p.missing)
    if missing:
        file = experiment.path or Path(experiment.name)
        tree = ast.parse(file.read_text("utf-8"))
        named = "; ".join(
            f"{os.path.relpath(file)}:{_line(tree, p.path)}: {p.path} ({p.unit}) is not set"
            for p in missing
        )
        sets = " ".join(f"--set {p.path}=VALUE" for p in missing)
        raise UsageError(
            f"{named}. The recording does not contain it: measure it and write it there, or "
            f"pass {sets}"
        )
    return Opened(recordings, filled, stated, taken)


def same(value: Any, stated: float) -> bool:
    """Return whether a value is the recording's, as it is written into a file."""
    return isinstance(value, int | float) and math.isclose(value, stated, rel_tol=_WRITTEN)


def _line(tree: ast.AST, parameter: str) -> int:
    """Line of an experiment file that gives a parameter, else what holds it."""
    line = 1
    for name in ("parameters", *parameter.split(".")):
        given = [k for k in ast.walk(tree) if isinstance(k, ast.keyword) and k.arg == name]
        if given:
            line = given[-1].lineno
            tree = given[-1].value if name != "parameters" else tree
    return line


def marked(
    experiment: Experiment, options: Options, found: Opened, described: Sequence[Parameter]
) -> tuple[Parameter, ...]:
    """Return the parameters `described` as used, each with its origin."""
    declared = describe(experiment.parameters) + describe(experiment.methods, "methods.")
    origins = {p.path: p.origin for p in declared}
    before = {p.path: p.default for p in describe(found.parameters)}

    def origin(p: Parameter) -> Origin:
        if p.path in before and p.default != before[p.path]:
            return "identified"
        if p.path in options.values and p.path not in found.taken:
            return "entered"
        if p.path in found.stated and same(p.default, found.stated[p.path]):
            return "recorded"
        return origins.get(p.path, p.origin)

    return tuple(replace(p, origin=origin(p)) for p in described)
