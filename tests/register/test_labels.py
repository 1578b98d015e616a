"""Markers that change places are refused; one that is mistaken for an instant is none of them."""

import numpy as np
import pytest

from validate.arrays import Floats
from validate.errors import RegistrationError
from validate.register.markers.markers import require_steady_labels

COUNT, SD = 20, 1e-5
NAMES = tuple(f"m{i:02d}" for i in range(COUNT))


def seen(seed: int) -> tuple[Floats, Floats]:
    """Markers (k, 3) m at rest, and after an affine motion, with noise."""
    rng = np.random.default_rng(seed)
    rest = rng.uniform(-0.01, 0.01, (COUNT, 3))
    gradient = np.eye(3) + 0.1 * rng.normal(size=(3, 3))
    return rest, rest @ gradient + SD * rng.normal(size=rest.shape)


def require(rest: Floats, x: Floats) -> None:
    require_steady_labels(NAMES, rest, x[None], np.zeros(1), SD)


@pytest.mark.parametrize("far", [2e-3, 2e-2, 1.0])
def test_a_stray_marker_is_no_swap(far: float) -> None:
    """About half of these have another label nearer to where the stray one pulls the map."""
    for seed in range(20):
        rest, x = seen(seed)
        x[seed] += far / np.sqrt(3)
        require(rest, x)


def test_a_marker_that_changed_places_is_named() -> None:
    rest, x = seen(0)
    x[[3, 7]] = x[[7, 3]]
    with pytest.raises(RegistrationError, match=r"m07 seem swapped at t = 0\.00 s"):
        require(rest, x)
