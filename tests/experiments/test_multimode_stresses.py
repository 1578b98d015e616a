"""Stresses relative to what was measured: three rows by hand, rest left out."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from experiments.multimode.stress_observation import StressObservation
from validate.arrays import Floats, Ints
from validate.errors import ComparisonError
from validate.register.observation import EVERYTHING, Selection
from validate.solve.types import Trace

T = np.arange(3.0)


@dataclass(frozen=True)
class Ran:
    traces: dict[str, Trace]
    method: str = "law"
    t: Floats = field(default_factory=lambda: T)
    at: Ints = field(default_factory=lambda: np.arange(3))
    u: Floats = field(default_factory=lambda: np.zeros((3, 0, 3)))


def seen(y: Floats) -> StressObservation:
    return StressObservation("stress", "validates", T, y, 0.03, 0.01, "stress.uniaxial")


def test_an_error_is_relative_to_its_row_and_rest_has_none() -> None:
    y = np.array([[0.0], [100.0], [200.0]])
    run = Ran({"nominal_stress": Trace(np.array([5.0, 110.0, 190.0]), "Pa")})
    (found,) = seen(y).deviations(run, EVERYTHING)
    assert found.values[:, 0] == pytest.approx([0.1, -0.05])
    assert (found.unit, found.sd, found.systematic) == ("1", 0.03, 0.01)
    assert found.reference is not None
    assert found.reference[:, 0].tolist() == [1.0, 1.0]
    assert found.t is not None
    assert found.t.tolist() == [1.0, 2.0]


def test_two_stresses_are_relative_to_the_larger_one() -> None:
    y = np.array([[0.0, 0.0], [100.0, 50.0], [-200.0, 0.0]])
    first, second = np.array([0.0, 100.0, -210.0]), np.array([0.0, 60.0, 4.0])
    run = Ran({"nominal_stress": Trace(first, "Pa"), "second_stress": Trace(second, "Pa")})
    (found,) = seen(y).deviations(run, EVERYTHING)
    assert found.values[:, 0] == pytest.approx([0.0, 0.1, -0.05, 0.02])
    assert found.t is not None
    assert found.t.tolist() == [1.0, 1.0, 2.0, 2.0]


def test_what_is_no_stress_is_not_compared() -> None:
    y = np.array([[0.0], [100.0], [200.0]])
    assert seen(y).deviations(Ran({}), EVERYTHING) == ()
    assert seen(y).unanswered(Ran({})) == ("nominal_stress",)
    with pytest.raises(ComparisonError, match="is in N, expected Pa"):
        seen(y).deviations(Ran({"nominal_stress": Trace(T, "N")}), EVERYTHING)


def test_a_selection_of_rest_alone_compares_nothing() -> None:
    y = np.array([[0.0], [100.0], [200.0]])
    run = Ran({"nominal_stress": Trace(np.array([5.0, 110.0, 190.0]), "Pa")})
    assert seen(y).deviations(run, Selection("rest", np.array([0.0]))) == ()
    (two,) = seen(y).deviations(run, Selection("some", np.array([0.0, 1.0])))
    assert two.values[:, 0] == pytest.approx([0.1])
