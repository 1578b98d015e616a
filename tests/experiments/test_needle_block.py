"""The block and the needle: the pipeline in the plane, its checks, and all its claims (slow)."""

import numpy as np
import pytest

from validate.compare.result import MethodResult, Result
from validate.errors import RegistrationError, SceneError
from validate.pipeline import load, run_in_memory
from validate.pipeline.bodies.own_body import own_body
from validate.pipeline.experiment.experiment import Experiment
from validate.recording.types import Markers
from validate.register.markers.markers import MarkerObservation
from validate.scene.geometries.box import grid


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    return load("needle_block")


@pytest.fixture(scope="module")
def quick(experiment: Experiment) -> Result:
    return run_in_memory(experiment, {}, ("implicit", "explicit", "explicit_lagged"), quick=True)


def method(result: Result, name: str) -> MethodResult:
    return next(m for m in result.methods if m.name == name)


def test_the_explicit_run_agrees_with_markers_of_the_implicit_one(quick: Result) -> None:
    assert quick.passed
    assert [c.count for c in quick.checks] == [300, 300]
    assert all(c.u_val > 0 for c in quick.checks)


def test_markers_of_a_plane_body_have_two_coordinates(quick: Result) -> None:
    (seen,) = method(quick, "implicit").registered[0].of(MarkerObservation)
    assert seen.x.shape == (301, 6, 2)
    assert seen.rest[seen.names.index("inside")] == pytest.approx([0.75, 0.5])
    off = method(quick, "implicit").residuals["inside@all"].values
    assert off.shape == (300, 2)
    assert off.std() == pytest.approx(1e-4, rel=0.1)  # the markers' noise and nothing else


def test_damping_that_is_dropped_is_seen(experiment: Experiment) -> None:
    values = {"methods.explicit.settings.damping_terms": "mass"}
    result = run_in_memory(experiment, values, ("explicit",), quick=True)
    assert not result.passed
    assert {c.verdict for c in result.checks} == {"not good enough"}


def test_lagged_damping_is_refused_at_the_papers_step(quick: Result) -> None:
    """n = 20, lumped: 1.8949e-2 s (an independent reconstruction) against 1/30 s."""
    outcome = method(quick, "explicit_lagged").run.outcome
    assert outcome.state == "refused"
    assert "1.759 times the critical step 0.01895 s" in outcome.why


def test_a_marker_outside_a_plane_mesh_is_refused() -> None:
    rest = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.3, 0.7, 0.0], [1.5, 0.4, 0.0]])
    names = ("a", "b", "c", "d")
    markers = Markers(np.array([0.0, 1.0]), names, np.stack([rest, rest]), 1e-4, "camera")
    layout = dict(zip(names, rest, strict=True))
    up = (np.array([0.0, 0.0, 1.0]),) * 2
    with pytest.raises(RegistrationError, match="outside"):
        MarkerObservation.of(
            markers, layout, grid((1.0, 1.0), (2, 2)),
            up=up,
        )  # fmt: skip


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_all_claims_stand(experiment: Experiment) -> None:
    """The numbers of an independent reconstruction of paper 002, by way of the report's tables."""
    result = run_in_memory(experiment)
    assert result.passed
    assert [(p.name, p.fault) for p in result.published if p.fault] == []
    assert len(result.published) == 43
    tables = {t.name: t for e in result.exhibits for t in e.tables}
    rows = {(r[0], r[1]): r[2:] for r in tables["solver_errors"].rows}
    assert rows["explicit, lumped M, C = αM", "E_n / 1"] == pytest.approx(
        (0.1290, 0.0731, 0.0259, 0.0294, 0.0157, 0.0024), abs=6e-5
    )
    assert rows["quasi-static", "E_n / 1"] == pytest.approx(
        (1.352, 0.7986, 0.3194, 0.0741, 0.0302, 0.0021), abs=6e-5, rel=4e-4
    )
    slopes = [r[3] for r in tables["needle_force"].rows]
    exact = 2 * (1 - 0.47**2) / (np.pi * 200)  # 2 (1 - nu^2)/(pi E), plane strain
    assert slopes[2] == pytest.approx(exact, rel=2e-3)
    told = next(e for e in result.exhibits if e.anchor == "mesh-error").words[1]
    assert "93 % of a mixed reference's motion with MP1 and 76 % with MP2" in told


def test_a_needle_between_nodes_is_refused(experiment: Experiment) -> None:
    """21 cells a side have no node in the middle of the free side."""
    with pytest.raises(SceneError, match=r"nearest node is 23\.81 mm away: take"):
        run_in_memory(experiment, {"body.cells": "21,21"}, ("explicit",), quick=True)


def test_derived_meshes_of_a_declared_body_are_touched_at_its_place(experiment: Experiment) -> None:
    own = own_body(experiment)
    assert [p.path for p in own.refining] == ["body.cells"]
    assert own.levels((25, 50, 75, 100, 200)) == (50, 100, 200)
