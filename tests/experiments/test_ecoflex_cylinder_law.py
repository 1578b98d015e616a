"""Moduli of the cylinders: the scale of a unit curve, Gent's factor, the mesh's share."""

import numpy as np
import pytest

from experiments.ecoflex_cylinder.law_scale import fit_scale
from experiments.ecoflex_cylinder.modulus import gent_correction, mesh_share
from validate.errors import ComparisonError

CURVE = np.linspace(0, 2, 50) ** 2


def test_exact_forces_give_their_scale_back() -> None:
    found = fit_scale([CURVE, CURVE[:30]], [3 * CURVE, 5 * CURVE[:30]])
    assert found.scale == pytest.approx(4.0)
    assert found.sd_repeats == pytest.approx(np.sqrt(2.0))
    assert found.confidence(2) == pytest.approx(2.0)
    assert (found.count, found.residual_rms) == (80, pytest.approx(0.0, abs=1e-12))
    assert fit_scale([CURVE], [CURVE]).sd_repeats is None
    assert fit_scale([CURVE], [CURVE]).confidence(1) is None


def test_noise_averages_out_and_shows_in_the_residual() -> None:
    rng = np.random.default_rng(2)
    forces = [3 * CURVE + 0.1 * rng.standard_normal(50) for _ in range(200)]
    found = fit_scale([CURVE] * 200, forces)
    assert found.scale == pytest.approx(3.0, abs=3e-3)
    assert found.residual_rms == pytest.approx(0.1, rel=0.03)


def test_nothing_to_fit_is_an_error() -> None:
    for curves, forces in (([], []), ([CURVE * 0], [CURVE]), ([CURVE[:0]], [CURVE[:0]])):
        with pytest.raises(ComparisonError, match="to fit"):
            fit_scale(curves, forces)


def test_gents_correction_is_the_data_sets() -> None:
    assert gent_correction(0.05, 0.03) == pytest.approx(1 + 2 * (5 / 12) ** 2, rel=1e-14)
    assert gent_correction(0.05, 0.03) == pytest.approx(1.35, abs=0.005)  # data README


def test_the_meshs_share_is_richardsons_with_a_factor() -> None:
    """u(h) = 10 + 3 h^2 at h = 0.1 is off by 0.03, from either side; 1.5 of it is u."""
    own, finer, coarser = (10 + 3 * h**2 for h in (0.1, 0.05, 0.15))
    assert mesh_share(own, finer, 0.5, 2.0) == pytest.approx(1.5 * 0.03)
    assert mesh_share(own, coarser, 1.5, 2.0) == pytest.approx(1.5 * 0.03)
    with pytest.raises(ComparisonError, match="two sizes are needed"):
        mesh_share(own, finer, 1.0, 2.0)
