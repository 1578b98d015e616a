"""Classes of filterpy (2.0, MIT): the only import of it, which takes 0.6 s."""

import copy
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import filterpy.kalman.ensemble_kalman_filter as fp_ensemble
import numpy as np
from filterpy.kalman import (
    EnsembleKalmanFilter,
    ExtendedKalmanFilter,
    KalmanFilter,
    MerweScaledSigmaPoints,
    UnscentedKalmanFilter,
)

from validate.arrays import Floats
from validate.estimate.reduced.reduced_kf import LinearModel

__all__ = [
    "Ensemble",
    "EnsembleKalmanFilter",
    "ExtendedKalmanFilter",
    "KalmanFilter",
    "MerweScaledSigmaPoints",
    "UnscentedKalmanFilter",
    "drawing",
]


@contextmanager
def drawing(draws: Callable[..., Any]) -> Iterator[None]:
    """The ensemble filter draws from `draws` (mean, covariance, size) instead."""
    before = fp_ensemble.multivariate_normal
    fp_ensemble.multivariate_normal = draws
    try:
        yield
    finally:
        fp_ensemble.multivariate_normal = before


_MEMBERS = 50
_BOUND = ("fx", "hx", "model", "inv")


class Ensemble(EnsembleKalmanFilter):  # type: ignore[misc]
    """filterpy's ensemble filter of a linear model, with loads in `predict`."""

    def __init__(self, model: LinearModel) -> None:
        self.model, self.loads = model, np.zeros(model.B.shape[1])
        m = len(model.H)
        super().__init__(
            model.x0, model.P0, m, 1.0, _MEMBERS, lambda x: model.H @ x, lambda x, _: self._moved(x)
        )

    def _moved(self, x: Floats) -> Floats:
        return self.model.F @ x + self.model.B @ self.loads

    def __deepcopy__(self, memo: dict[int, Any]) -> "Ensemble":
        """Without drawing anew; its functions are bound to the copy."""
        other = object.__new__(Ensemble)
        other.__dict__.update(self.__dict__)
        own = {k: copy.deepcopy(v, memo) for k, v in self.__dict__.items() if k not in _BOUND}
        other.__dict__.update(own)
        other.fx = lambda x, _: other._moved(x)
        return other

    def predict(self, u: Floats) -> None:
        self.loads = u
        super().predict()
