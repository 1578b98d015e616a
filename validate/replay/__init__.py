"""An experiment and the road from its recording to a comparison, for notebooks too.

from validate.replay import compare, load
result = compare(load("fluid_phantom"), {"material.E": "14000"})
for check in result.checks:
    print(check.name, check.value, check.unit, check.verdict)
"""

from collections.abc import Mapping
from pathlib import Path

from validate.compare.result import Result
from validate.replay import road
from validate.replay.calibration import Calibrates, Calibration, Free
from validate.replay.experiment import (
    Case,
    EffectSpec,
    Experiment,
    Identified,
    Input,
    Told,
    Twin,
    Uncertainty,
    Variant,
)
from validate.replay.find import find
from validate.replay.ladder import Ladder
from validate.replay.method import Method
from validate.replay.options import Options

__all__ = [
    "Calibrates",
    "Calibration",
    "Case",
    "EffectSpec",
    "Experiment",
    "Free",
    "Identified",
    "Input",
    "Ladder",
    "Method",
    "Told",
    "Twin",
    "Uncertainty",
    "Variant",
    "compare",
    "load",
]


def load(name: str) -> Experiment:
    """The experiment of that name, or of that file; raises `UsageError` naming the nearest."""
    return find(name, Path.cwd())


def compare(
    experiment: Experiment,
    values: Mapping[str, str] | None = None,
    methods: tuple[str, ...] = (),
    *,
    quick: bool = False,
) -> Result:
    """Runs the road and judges it; `values` are parameter paths and texts, as for `--set`.

    Raises children of `ValidateError` for bad input.
    """
    return road.compare(experiment, Options(dict(values or {}), methods, quick))
