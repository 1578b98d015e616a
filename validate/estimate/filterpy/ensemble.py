"""filterpy's ensemble filter of a linear model, with loads in `predict`."""

import copy
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.estimate.filterpy.linear_model import LinearModel
from validate.estimate.filterpy.names import EnsembleKalmanFilter

_MEMBERS = 50
_BOUND = ("fx", "hx", "model", "inv")


class Ensemble(EnsembleKalmanFilter):  # type: ignore[misc]
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
