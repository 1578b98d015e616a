"""The rivals of a ladder: which of them depend on the step, and where they run."""

import numpy as np
import pytest

from validate.arrays import rms
from validate.fem.assembly.locate import Rows
from validate.pipeline.ladder.ladder import ORDERS
from validate.pipeline.ladder.references import (
    exact_in_ramps,
    exact_in_time,
    still_best,
    swinging_pair,
)
from validate.scene.geometries.box import box, grid
from validate.solve.fluid.cavities import ExactPressure
from validate.solve.schemes import SCHEMES
from validate.solve.static.quasi_static import QuasiStatic
from validate.solve.study_entries import StillBody, SwingingBody

STEPS = (0.02, 0.01)
EXACT = {"quasi-static", "10 modes", "40 modes"}  # none of these has an error of the step


def test_only_what_depends_on_the_step_takes_several() -> None:
    rivals = SCHEMES.candidates(SwingingBody(STEPS, small=3, medium=5, law="svk"))
    taken = dict.fromkeys((r.name for r in rivals), STEPS)
    taken |= dict.fromkeys(EXACT, STEPS[1:]) | {"large strain, implicit": STEPS[:1]}
    assert {r.name: r.steps("P1", 1, STEPS) for r in rivals} == taken
    assert {r.name for r in rivals if not r.steps("P1", 4, STEPS)} == {
        "implicit, sparse LU every step", "implicit, Gaussian elimination every step",
    }  # fmt: skip
    assert {r.name for r in rivals if not r.steps("P1", 6, STEPS)} == {
        "implicit, sparse LU every step", "implicit, Gaussian elimination every step",
        "implicit, dense inverse", "large strain, implicit",
    }  # fmt: skip
    assert {r.law for r in rivals if r.rung == "large strain"} == {"svk"}
    assert {r.order for r in rivals} == {1.0, 2.0}
    assert next(r.order for r in rivals if r.name.startswith("backward Euler")) == 1.0


def test_statics_are_stepped_by_newton_alone() -> None:
    for cavities, count in ((True, 5), (False, 3)):
        rivals = SCHEMES.candidates(StillBody(cavities, 0.02, 0.01, medium=5, coarse=3))
        assert len(rivals) == count
        stepped = {r.name for r in rivals if r.steps("P1", 1, STEPS) == STEPS[:1]}
        assert stepped == {"large strain, Newton every step"}
        assert all(r.steps("P1", 1, STEPS) == STEPS[1:] for r in rivals if r.name not in stepped)
        assert {r.name for r in rivals if not r.steps("P1", 4, STEPS)} == stepped
        assert len({r.name for r in rivals if r.steps("P1", 6, STEPS)}) == count - 2
        assert [r.name for r in rivals if r.lacks] == ["superposition, cavity empty"] * cavities


def test_the_most_exact_solver_of_each_kind() -> None:
    assert isinstance(still_best(True)(0.1), ExactPressure)
    assert isinstance(still_best(False)(0.1), QuasiStatic)
    assert (exact_in_time(0.1).propagate, exact_in_ramps(0.1).propagate) == ("constant", "linear")
    assert exact_in_time(0.1).modes == exact_in_ramps(0.1).modes == 60
    assert swinging_pair("P1", 2, 0.1).declared(0.3).dt == pytest.approx(0.3)


@pytest.mark.parametrize("element", ["P1", "P2", "H8"])
def test_the_declared_order_is_that_of_interpolation(element: str) -> None:
    """Of a smooth field, from one mesh to the next, in the mean over points within the cells."""
    points = np.random.default_rng(2).uniform(0.05, 0.95, (400, 3))
    errors = []
    for n in (4, 8):
        mesh = grid((1.0,) * 3, (n,) * 3) if element == "H8" else box((1.0,) * 3, (n,) * 3)
        mesh = mesh.quadratic() if element == "P2" else mesh
        known = np.sin(mesh.nodes @ [1.0, 2.0, 1.5])[:, None] * np.ones(3)
        off = Rows.barycentric(mesh, points).apply(known)[:, 0] - np.sin(points @ [1.0, 2.0, 1.5])
        errors.append(rms(off[:, None]))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(ORDERS[element], abs=0.25)
