"""Synthetic logs of a benchmark: intervals hold their truths, wrong laws are named."""

from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from script_modules import module_of

FILE = Path(__file__).parents[2] / "benchmarks" / "identified_logs.py"


@pytest.fixture(scope="module")
def logs() -> ModuleType:
    return module_of(FILE)


def test_the_bonded_truth_is_that_of_known_limits(logs: ModuleType) -> None:
    """nu = 0 does not bulge: no factor. A tall one tends to one; Gent's 1 + 2 S^2 is low but near
    for an incompressible cylinder of S = 1/2."""
    assert logs.bonded_factor(1.0, 0.0, 6) == pytest.approx(1.0, abs=1e-9)
    assert logs.bonded_factor(5.0, 0.45, 10) == pytest.approx(1.0, abs=0.04)
    assert 1.5 < logs.bonded_factor(0.5, 0.4999, 16) < 1.8
    coarse, fine = (logs.bonded_factor(0.75, 0.45, n) for n in (12, 24))
    assert coarse == pytest.approx(fine, rel=2e-3)


def test_the_truths_of_large_strain_start_with_a_slope_of_one(logs: ModuleType) -> None:
    e = np.array([1e-5])
    assert logs.uniaxial_neo_hooke(e, 0.3) / e == pytest.approx(1.0, abs=1e-4)
    assert logs.uniaxial_yeoh(e, 0.7) / e == pytest.approx(1.0, abs=1e-4)
    nearly = logs.uniaxial_neo_hooke(np.array([0.1]), 0.49999)
    assert nearly == pytest.approx(logs.uniaxial_yeoh(np.array([0.1]), 0.0), rel=1e-4)


@pytest.mark.slow
def test_twenty_logs_lie_in_their_intervals(logs: ModuleType) -> None:
    """18 of 20 in 95 % intervals: fewer have a probability of 7.5 %. 200: the benchmark."""
    rows = [logs.row(seed) for seed in range(20)]
    assert np.mean([r.holds for r in rows]) >= 0.9
    error = np.sqrt(np.mean([r.error**2 for r in rows]))
    assert np.median([r.half for r in rows]) <= 3 * error
    assert sum(r.named for r in rows) <= 1


@pytest.mark.slow
def test_a_law_that_is_off_by_three_u_val_is_named(logs: ModuleType) -> None:
    assert logs.detected(4.0, range(8)) == 1.0
    assert logs.detected(0.0, range(8)) <= 0.125
