"""Scores of a filter study: errors along the experiment's axis at every probe, and NIS."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.compare.track import rmse, track_error
from validate.estimate.consistency import Consistency, nis_consistency

POOLED = "all.rmse"
NIS = "nis.per_dof"


@dataclass(frozen=True)
class FilterScores:
    """Scores by name, one number per seed (SI, `units` by name); step_s s is the median step,
    None for runs that are smoothed: they are none for real time.

    `nis` is that of all seeds with `nis_dof` degrees of freedom, None without innovations.
    `frozen` is the step from which a linear filter's gains repeat. `shared`: all seeds were run at
    once with one set of gains.
    """

    scores: Mapping[str, tuple[float, ...]]
    units: Mapping[str, str]
    nis: float | None = None
    nis_dof: int = 0
    step_s: float | None = None
    setup_s: float | None = None
    steps: int = 0
    frozen: int | None = None
    shared: bool = False

    @property
    def consistency(self) -> Consistency | None:
        """NIS of all seeds together; None for a method without innovations."""
        if self.nis is None or not self.nis_dof:
            return None
        return nis_consistency([self.nis], [self.nis_dof])


def error_scores(
    estimates: Mapping[str, Floats], truth: Mapping[str, Floats], axis: str
) -> dict[str, float]:
    """`<probe>.rmse` m and `all.rmse` m from traces (nt,) m and truths (nt, d) m by probe."""
    c = "xyz".index(axis)
    found, squares = {}, []
    for probe, reference in truth.items():
        error = track_error(probe, axis, estimates[probe], reference[:, c])
        found[f"{probe}.rmse"] = rmse(error)
        squares.append(error.values**2)
    return {POOLED: float(np.sqrt(np.mean(squares))), **found}
