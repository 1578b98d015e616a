"""Calibration as a least-squares problem: free parameters -> whitened residuals."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.compare.residual import Residual
from validate.errors import ComparisonError
from validate.identify.identification import Identification
from validate.identify.least_squares import Range, Space, whitened
from validate.parameters import with_values
from validate.pipeline.calibration.calibration import Calibrates, Calibration, Free
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.method import Method
from validate.pipeline.run.case_solution import solve
from validate.recording.types import Recording

_SHOWN = 8  # names of residuals in a message


@dataclass(frozen=True)
class Part:
    """Recordings that calibrate, and the parameters they were loaded with; `judged`: they are
    those that are judged, under whatever name."""

    on: Calibrates
    recordings: tuple[Recording, ...]
    parameters: Any
    judged: bool

    @property
    def name(self) -> str:
        return self.on.name or ", ".join(r.name for r in self.recordings)


@dataclass(frozen=True)
class Problem:
    """Least-squares problem of a calibration: its `free` parameters, recordings and method."""

    experiment: Experiment
    calibration: Calibration
    free: tuple[Free, ...]
    method: Method
    parts: tuple[Part, ...]

    @cached_property
    def space(self) -> Space:
        return Space(tuple(Range(f.path, f.low, f.high) for f in self.free))

    def residual(self, x: Floats) -> Floats:
        """All residuals at coordinates x (p,), independent and of variance one.

        Raises `ComparisonError` where a named residual is not there, and what the pipeline raises.
        """
        values = dict(zip(self.space.names, self.space.values(x), strict=True))
        found = [whitened(r.values, r.sd, r.systematic, r.freedom, r.name)
                 for part in self.parts for r in self._of(part, values)]  # fmt: skip
        return np.concatenate(found)

    def _of(self, part: Part, values: Mapping[str, float]) -> list[Residual]:
        parameters = with_free(part.parameters, values)
        name = self.calibration.method
        followed = solve(self.experiment, part.recordings, name, self.method, parameters)
        ends = [r.outcome for r in followed.runs if not r.finished]
        if ends:
            at = ", ".join(f"{k} = {v:.6g}" for k, v in values.items())
            raise ComparisonError(f"'{name}' {ends[0].state} at {at}: {ends[0].why}")
        pairs = zip(followed.registered, followed.runs, strict=True)
        # Those that calibrate
        found = [r for pair in pairs for r in Residual.of(*pair)]
        for wanted in part.on.quantities:
            if not any(wanted in (r.quantity, r.name) for r in found):
                there = ", ".join(dict.fromkeys(r.name for r in found)) or "none"
                raise ComparisonError(
                    f"{part.name}: no residual '{wanted}' for the calibration, 0 matched samples; "
                    f"there are {', '.join(there.split(', ')[:_SHOWN])}"
                )
        return [r for r in found if {r.quantity, r.name} & set(part.on.quantities)]


@dataclass(frozen=True)
class Calibrated:
    """A calibration that was carried out."""

    problem: Problem
    found: Identification

    @property
    def values(self) -> dict[str, float]:
        return {e.name: e.value for e in self.found.estimates}

    @property
    def on(self) -> str:
        """The residuals and recordings that served, in words."""
        each = (f"{', '.join(p.on.quantities)} of {p.name}" for p in self.problem.parts)
        return " and ".join(each)


def with_free(parameters: Any, values: Mapping[str, float]) -> Any:
    """Parameters with these values by path."""
    return with_values(parameters, {path: repr(float(v)) for path, v in values.items()})
