"""u_num of random bodies against converged answers of another code (`benchmarks/bodies.py`)."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

import bodies
from bodies_drawn import SEEDS, drawn
from bodies_ours import Judged, judged

SOME = SEEDS[::20]


def test_every_seed_has_a_converged_answer() -> None:
    kept = json.loads(bodies.FILE.read_text())
    assert (kept["code"], kept["version"]) == ("NGSolve", "6.2.2608")
    assert sorted(map(int, kept["answers"])) == list(SEEDS)
    for seed, row in kept["answers"].items():
        body = drawn(int(seed))
        assert row["unit"] == ("N" if body.moves else "m")
        assert len(row["values"]) == (1 if body.moves else 3 * len(body.markers))
        assert row["change"] < 6e-3, seed  # of an order and a mesh coarser, rms over rms
    assert np.median([row["change"] for row in kept["answers"].values()]) < 1e-3


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_twice_u_num_holds_the_true_error_of_random_bodies() -> None:
    """10 of the 200, none missed; all of them are in docs/explanation/discretisation.md."""
    kept = bodies.truths()
    found: dict[int, Judged] = {seed: judged(drawn(seed), kept[seed]) for seed in SOME}
    missed = [seed for seed, one in found.items() if not one.covered]
    assert len(missed) <= 0.08 * len(SOME), missed
    ratios = [one.ratio for one in found.values()]
    assert np.median(ratios) < 8  # the formal order is that of corners, hexahedra converge faster
    assert all(np.isfinite(ratios))
    # The bodies are no trifles: their errors are tenths of per cents and more.
    assert np.median([one.error / one.answer for one in found.values()]) > 0.001
