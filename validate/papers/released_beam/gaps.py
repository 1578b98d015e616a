"""Statistics over markers that may be missing: NaN where none was seen, without a warning."""

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from validate.arrays import Floats


def over(statistic: Callable[..., Any], x: Floats, axis: int) -> Floats:
    """One of numpy's `nan...` statistics of x along an axis."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return np.asarray(statistic(x, axis=axis))
