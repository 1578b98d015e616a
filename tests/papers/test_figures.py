"""Declared figures: each names what its experiment computes, and none can vanish."""

import pytest

from validate.compare.published import Figure
from validate.replay import load
from validate.replay.experiment import Experiment

DECLARED = {
    "bending_rod": 6,
    "ecoflex_cylinder": 1,
    "ekf_cone": 9,
    "ekf_cube": 15,
    "fluid_phantom": 11,
    "fluid_phantom_large": 0,
    "kf_cube": 9,
    "kf_cube_inertia": 0,
    "needle_block": 10,
}


def figures(name: str) -> tuple[Figure, ...]:
    return load(name).published


@pytest.mark.parametrize("name", DECLARED)
def test_no_figure_is_lost_or_stands_twice(name: str) -> None:
    names = [f.name for f in figures(name)]
    assert len(set(names)) == len(names) == DECLARED[name]


@pytest.mark.parametrize("name", DECLARED)
def test_a_figure_names_a_method_or_what_the_experiment_tells(name: str) -> None:
    experiment: Experiment = load(name)
    owners = {f.of.partition(":")[0] for f in experiment.published if isinstance(f.of, str)}
    assert owners <= {*experiment.methods, "told", "identified"}


@pytest.mark.parametrize("name", DECLARED)
def test_a_run_that_computes_nothing_says_what_each_figure_lacks(name: str) -> None:
    """Only figures that rest on no run stand then: a reading, or a model of the paper alone."""
    for figure in figures(name):
        found = figure.beside({})
        if isinstance(figure.of, str):
            assert found.ours is None
            assert found.fault.startswith("not computed: no score")
        elif figure.of is None and isinstance(figure.reason, str):
            assert found.fault == ""


@pytest.mark.parametrize("name", DECLARED)
def test_what_is_reproduced_has_a_value_of_ours(name: str) -> None:
    assert all(f.of is not None for f in figures(name) if f.verdict == "reproduced")


def test_tetrahedra_at_a_rate_that_no_mesh_has_are_no_fault() -> None:
    """Rates are of this machine: out of reach is an answer, not computed at all is a fault."""
    figure = next(f for f in figures("ekf_cube") if f.name == "tetrahedra at 30 Hz, EKF")
    assert figure.beside({"told": {"cells.filter@30Hz": float("nan")}}).fault == ""
    assert figure.beside({"told": {"cells.filter@30Hz": 40.0}}).ours == 40.0
    assert "cells.filter@30Hz" in figure.beside({"told": {}}).fault
