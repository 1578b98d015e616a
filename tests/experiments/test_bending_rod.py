"""The bending rod: the beam beside it, and all its claims (slow)."""

from collections.abc import Callable

import numpy as np
import pytest

from experiments.bending_rod.exhibits import beam, first_crossing
from validate.compare.result import Result
from validate.pipeline import load, run_in_memory
from validate.pipeline.experiment.experiment import Experiment


@pytest.fixture(scope="module")
def experiment(project_root) -> Experiment:  # type: ignore[no-untyped-def]
    return load("bending_rod")


@pytest.fixture(scope="module")
def quick(experiment: Experiment) -> Result:
    return run_in_memory(experiment, {}, ("implicit", "explicit", "quasi_static"), quick=True)


def test_the_explicit_run_agrees_with_markers_of_the_implicit_one(quick: Result) -> None:
    assert quick.passed
    assert [(c.name, c.count) for c in quick.checks] == [("tip.max@all", 300)]


def test_quasi_statics_is_off_by_the_whole_way_at_first(quick: Result) -> None:
    runs = {m.name: m.run for m in quick.methods}
    tip = {name: run.traces["tip.z"].y for name, run in runs.items()}
    assert tip["quasi_static"][0] == pytest.approx(-0.122214, rel=2e-3)
    assert abs(tip["implicit"][0]) < 1e-4
    assert tip["implicit"][-1] == pytest.approx(tip["quasi_static"][-1], rel=1e-4)


def test_dropped_damping_is_seen(experiment: Experiment) -> None:
    values = {"methods.explicit.settings.damping_terms": "mass"}
    result = run_in_memory(experiment, values, ("explicit",), quick=True)
    assert {c.verdict for c in result.checks} == {"not good enough"}


def test_beam_theory() -> None:
    """Euler-Bernoulli rho g A L^4/(8 E I) = .107143 m; Timoshenko with a square's shear .1325."""
    assert beam(shear=False) == pytest.approx(0.1071429, abs=1e-7)
    assert beam(shear=True) == pytest.approx(0.1327, abs=2.5e-4)


def test_the_first_crossing_lies_between_two_steps() -> None:
    t = np.array([1.0, 2.0, 3.0])
    assert first_crossing(t, np.array([-0.5, -0.9, -1.3]), -1.0) == pytest.approx(2.25)
    assert first_crossing(t, np.array([-0.5, -0.9, -0.95]), -1.0) is None


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_all_claims_stand(whole: Callable[[str], Result]) -> None:
    result = whole("bending_rod")
    assert result.passed
    assert [(p.name, p.fault) for p in result.published if p.fault] == []
    assert len(result.published) == 23
    tables = {t.name: t for e in result.exhibits for t in e.tables}
    crossings = {r[0]: r[3] for r in tables["crossing"].rows}
    assert crossings[3] == pytest.approx(4.261, abs=1e-3)
    assert crossings[2] < crossings[3] < crossings[4] < crossings[6] < 4.615
