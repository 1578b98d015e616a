"""Whitening of residuals: r -> C^(-1/2) r, C = sd^2 I + s^2 1 1^T.

What all points of one component share (registration, a clock) is one number of covariance s^2
between any two of them: many points do not average it out.
"""

import numpy as np

from validate.arrays import Floats
from validate.errors import ComparisonError


def whitened(
    values: Floats, sd: float, systematic: float, freedom: int | None = None, name: str = "residual"
) -> Floats:
    """Of values (k, c): k c numbers, component by component.

    C^(-1/2) is 1/sd across the mean of a component and 1/sqrt(sd^2 + k s^2) along it. `freedom`
    below k c counts the independent numbers: sd then grows so that they weigh no more than these.
    A sensor whose noise is not stated (`sd` 0) is taken to differ between points by as much as they
    share, which widens and never narrows. Raises `ComparisonError` where both are 0.
    """
    k, c = values.shape
    sd = systematic if sd == 0 and k > 1 else sd
    if freedom is not None and 0 < freedom < k * c:
        sd = sd * float(np.sqrt(k * c / freedom))
    along = float(np.sqrt(sd**2 + k * systematic**2))
    if along == 0:
        raise ComparisonError(
            f"{name}: {k} values with a standard deviation of {sd:g} have infinite weight; "
            "declare the noise of the sensor"
        )
    mean = values.mean(axis=0)
    across = (values - mean) / sd if k > 1 else np.zeros_like(values)
    return np.asarray((across + mean / along).ravel(order="F"))
