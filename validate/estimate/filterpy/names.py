"""Import of filterpy (2.0, MIT) in one place: its names and its random generator."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import filterpy.kalman.ensemble_kalman_filter as fp_ensemble
from filterpy.kalman import (
    EnsembleKalmanFilter,
    ExtendedKalmanFilter,
    KalmanFilter,
    MerweScaledSigmaPoints,
    UnscentedKalmanFilter,
)

__all__ = [
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
