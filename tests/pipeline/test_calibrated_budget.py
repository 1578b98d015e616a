"""Budgets of calibrated parameters: inputs and meshes to first order, or noise alone."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from calibrating import NU, OPEN, OPENED, E, known

from validate.pipeline.calibration.calibrated import (
    calibrated,
    closed,
    identified_by,
    with_inputs,
)
from validate.pipeline.calibration.calibration import Calibrates, Calibration
from validate.pipeline.experiment.experiment import (
    Experiment,
    Identified,
    SolvesVariants,
    Uncertainty,
    vary,
)
from validate.pipeline.experiment.tree import Tree

INPUTS = (
    vary("material.nu", "absolute 0.02, below 0.5", "Poisson ratio"),
    vary("material.E", "relative 5 %", "other specimens"),
)
DOUBTED: Experiment = replace(OPEN, uncertainty=Uncertainty(inputs=INPUTS, surrogate="fem"))


def nothing(_: Tree) -> SolvesVariants:
    raise AssertionError("no run is compared")


def identified(experiment: Experiment, p: Tree) -> Identified:
    shipped = experiment.load(p, Path())
    fitted, _ = calibrated(experiment, p, experiment.methods, shipped)
    found = identified_by(experiment, shipped, p, experiment.methods, fitted, nothing)
    assert found is not None
    return found


def test_an_input_changes_the_value_as_a_new_identification_does() -> None:
    (one,) = identified(DOUBTED, OPENED).values
    assert (one.name, one.unit, one.by) == ("material.E", "Pa", "fem")
    exact = [
        closed(DOUBTED, known(nu=nu), DOUBTED.load(OPENED, Path())).scene.material.E
        for nu in (0.3, 0.32)
    ]
    assert one.value == pytest.approx(exact[0], rel=1e-4)
    # First order: the product of both changes is left out.
    assert one.parts["Poisson ratio"] == pytest.approx(abs(exact[1] - exact[0]), rel=0.05)
    assert one.parts["other specimens"] == pytest.approx(0.05 * one.value, rel=1e-6)
    low, high = one.interval
    rest = 1.96 * np.hypot(one.parts["Poisson ratio"], one.parts["other specimens"])
    assert high - one.value > rest
    assert one.value - low > rest


def test_the_range_of_an_identified_parameter_gives_way_to_its_covariance() -> None:
    shipped = DOUBTED.load(OPENED, Path())
    fitted, _ = calibrated(DOUBTED, OPENED, DOUBTED.methods, shipped)
    found = with_inputs(DOUBTED, fitted).uncertainty
    assert found is not None
    assert [i.name for i in found.inputs] == ["Poisson ratio", "identified material.E"]


@pytest.mark.slow
def test_of_several_parameters_the_noise_and_the_correlation_are_told() -> None:
    both = Calibration("fem", (E, NU), (Calibrates(("force", "node_B")),))
    several = replace(DOUBTED, calibrations=(both,), accept=())
    shipped = several.load(OPENED, Path())
    p = known(nu=None)
    fitted, _ = calibrated(several, p, several.methods, shipped, anyway=True)
    found = identified_by(several, shipped, p, several.methods, fitted, nothing)
    assert found is not None
    one, other = found.values
    assert set(one.parts) == set(other.parts) == {"noise"}
    assert "correlation with material.nu" in one.correlation
    assert "does not include inputs and mesh" in one.correlation
