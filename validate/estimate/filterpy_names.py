"""The one door to filterpy (2.0, MIT): its names, and its use of numpy's global generator."""

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

__all__ = [
    "EnsembleKalmanFilter",
    "ExtendedKalmanFilter",
    "KalmanFilter",
    "MerweScaledSigmaPoints",
    "UnscentedKalmanFilter",
    "drawing",
    "seeded",
]


@contextmanager
def seeded(seed: int) -> Iterator[None]:
    """numpy's global generator, seeded for a step and then as it was."""
    before = np.random.get_state()  # noqa: NPY002 - filterpy draws from this one
    np.random.seed(seed)  # noqa: NPY002
    try:
        yield
    finally:
        np.random.set_state(before)  # noqa: NPY002


@contextmanager
def drawing(draws: Callable[..., Any]) -> Iterator[None]:
    """The ensemble filter draws from `draws` (mean, covariance, size) instead."""
    before = fp_ensemble.multivariate_normal
    fp_ensemble.multivariate_normal = draws
    try:
        yield
    finally:
        fp_ensemble.multivariate_normal = before
