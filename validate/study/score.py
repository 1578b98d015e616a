"""Scores of one seed's run: errors along the experiment's axis at every probe, and NIS."""

from collections.abc import Mapping

import numpy as np

from validate.arrays import Floats
from validate.compare.track import rmse, track_error

POOLED = "all.rmse"
NIS = "nis.per_dof"
WORDS = {
    POOLED: "root mean square error over all probes and times",
    NIS: "normalised innovation squared over its degrees of freedom; 1 for a consistent filter",
}


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
