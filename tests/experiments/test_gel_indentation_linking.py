"""Linking: known partners of a known motion are found, and where nothing is sure it says so."""

import numpy as np
import pytest

from experiments.gel_indentation.particle_linking import link
from validate.errors import RegistrationError

Pair = tuple[np.ndarray, np.ndarray, np.ndarray]


def pressed(seed: int = 2, lost: float = 0.05, most: float = 25.0, count: int = 2500) -> Pair:
    """Particles of a block (20 apart) pressed from above, with noise, some lost on either side:
    before, after, and which of after each of before is (-1: lost)."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(0, (250, 250, 320), (count, 3))
    r2 = ((x[:, :2] - 125) ** 2).sum(axis=1)
    u = np.zeros_like(x)
    u[:, 2] = -most * (x[:, 2] / 320) ** 2 * np.exp(-r2 / 2 / 120**2)
    u[:, :2] = -0.2 * u[:, [2]] * (x[:, :2] - 125) / 125
    y = x + u + rng.normal(0, (0.12, 0.14, 0.7), x.shape)
    order = rng.permutation(np.flatnonzero(rng.random(count) > lost))
    partner = np.full(count, -1)
    partner[order] = np.arange(len(order))
    kept = rng.random(count) > lost
    return x[kept], y[order], partner[kept]


def test_links_of_a_known_motion_are_right() -> None:
    before, after, partner = pressed()
    found = link(before, after)
    true = partner[found.pairs[:, 0]]
    assert (true == found.pairs[:, 1]).mean() > 0.99
    assert len(found.pairs) > 0.9 * (partner >= 0).sum()
    assert len(np.unique(found.pairs[:, 1])) == len(found.pairs)
    assert found.seeds < len(found.pairs)  # the front has walked
    assert found.noise == pytest.approx((0.12, 0.14, 0.7), rel=0.35)


def test_two_clouds_that_have_nothing_in_common_are_refused() -> None:
    rng = np.random.default_rng(1)
    one, other = (rng.uniform(0, 200, (500, 3)) for _ in range(2))
    with pytest.raises(RegistrationError, match="neighbours agree; 60 are needed"):
        link(one, other)


def test_too_few_particles_are_refused() -> None:
    with pytest.raises(RegistrationError, match="10 particles after: linking needs 60"):
        link(np.random.default_rng(1).uniform(size=(100, 3)), np.ones((10, 3)))
