"""Experiment and pipeline: from a recording to a comparison.

from validate.pipeline import load, run_in_memory
result = run_in_memory(load("fluid_phantom"), {"material.E": "14000"})
for check in result.checks:
    print(check.name, check.value, check.unit, check.verdict)
"""

from collections.abc import Mapping
from pathlib import Path

from validate.compare.result import Result
from validate.pipeline.calibration.calibration import Calibrates, Calibration, Free
from validate.pipeline.experiment.experiment import (
    Case,
    EffectSpec,
    Experiment,
    Identified,
    Input,
    ReportAdditions,
    Twin,
    Uncertainty,
    Variant,
)
from validate.pipeline.experiment.find import find
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.options import Options
from validate.pipeline.ladder.ladder import Ladder
from validate.pipeline.run import pipeline

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
    "ReportAdditions",
    "Twin",
    "Uncertainty",
    "Variant",
    "load",
    "run_in_memory",
]


def load(name: str) -> Experiment:
    """Return the experiment of that name, or of that file; raises `UsageError` naming the
    nearest."""
    return find(name, Path.cwd())


def run_in_memory(
    experiment: Experiment,
    values: Mapping[str, str] | None = None,
    methods: tuple[str, ...] = (),
    *,
    quick: bool = False,
) -> Result:
    """Simulate and compare with the recording in this process; nothing is stored.

    The result holds scenes, runs and residuals as arrays. `values` are parameter paths and texts,
    as for `--set`. `validate.run` does the same with stored computations and a report. Raises
    children of `ValidateError` for bad input.
    """
    return pipeline.compare(experiment, Options(dict(values or {}), methods, quick))
