"""Paper 003's liver: what the printed step and filter do on our bodies, and what is said of it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from beside import beside, experiment

from experiments.ekf_liver.body import FOLDER
from validate.compare.result import MethodResult, Result
from validate.errors import RecordingError
from validate.parameters import with_given
from validate.pipeline import run_in_memory
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.tree import Tree
from validate.recording.types import Recording

STEPS = 700  # of the printed 0.1 ms: more than the printed filter lives for
NOISE = float(np.sqrt(1e-9))  # m


@pytest.fixture(scope="module")
def liver() -> Experiment:
    return experiment("ekf_liver")


@pytest.fixture(scope="module")
def printed(liver: Experiment) -> Result:
    """The paper's step and filter on our own body, a shorter ramp."""
    names = ("nfem", "nfem_double", "nfem_double_run", "ekf_printed", "ekf_held")
    return run_in_memory(
        liver, {"body.body": "generated", "clock.steps": str(STEPS)}, names, quick=True
    )


@pytest.fixture(scope="module")
def data_body(shared_data: Path) -> None:
    if not (shared_data / FOLDER).is_dir():
        pytest.skip(f"real data absent: {shared_data / FOLDER}")


def parameters(liver: Experiment, body: str, recording: str = "") -> Tree:
    tree: Tree = with_given(liver.parameters, {"body.body": body, "recording": recording})
    return tree


def read(liver: Experiment, p: Tree) -> Recording:
    assert liver.path is not None
    (recording,) = liver.load(p, liver.path.parent)
    return recording


def of(result: Result, name: str) -> MethodResult:
    return next(m for m in result.methods if m.name == name)


def scores(result: Result, name: str) -> dict[str, float]:
    return {s.name: s.value for s in of(result, name).scores}


def test_the_shipped_recording_is_of_our_body_and_what_the_twin_records(liver: Experiment) -> None:
    p = parameters(liver, "generated")
    shipped = read(liver, p)
    assert liver.twin is not None
    anew = liver.twin.record(p, print)
    one, two = shipped.marker("markers"), anew.marker("markers")
    assert one.names == two.names == ("node_A", "node_B", "f1", "f2", "f3", "f4")
    assert np.abs(one.x - two.x).max() < 1e-9
    assert shipped.signal("pull", "N").y[-1, 0] == pytest.approx(0.5)
    assert shipped.record("provenance")["body"] == "generated"
    assert shipped.record("provenance")["same_model"] == "true"


def test_a_recording_of_the_other_body_is_refused(liver: Experiment, project_root: Path) -> None:
    shipped = str(project_root / "recordings" / "ekf_liver.mcap")
    p = parameters(liver, "data", recording=shipped)
    with pytest.raises(RecordingError, match=r"'generated'.*'data'.*--set"):
        read(liver, p)


@pytest.mark.slow
@pytest.mark.usefixtures("data_body")
def test_the_data_folders_liver_is_recorded_in_memory_and_has_its_own_figures(
    liver: Experiment,
) -> None:
    result = run_in_memory(liver, {"clock.steps": "200"}, ("nfem", "ekf_held"), quick=True)
    (recording,) = result.recordings
    assert recording.record("provenance")["body"] == "data"
    assert len(of(result, "nfem").scene.mesh.cells) == 4408  # type: ignore[union-attr]
    assert result.kind == "same model"
    held = scores(result, "ekf_held")
    assert held["node_A.rmse"] == pytest.approx(0.99 * NOISE, rel=0.02)
    p = parameters(liver, "here")
    figures = beside("ekf_liver", "published").LIVER_FIGURES
    assert liver.follows(liver, result.recordings, p).published == figures["data"]


@pytest.mark.slow
def test_the_printed_step_is_taken_twice_that_is_refused_and_diverges(printed: Result) -> None:
    assert of(printed, "nfem").run.finished
    refused, run = (of(printed, n).run.outcome for n in ("nfem_double", "nfem_double_run"))
    assert (refused.state, refused.step) == ("refused", 0)
    assert refused.why.startswith("dt 0.0002 s is 1.71 times the critical step 0.000117 s; take")
    assert run.state == "diverged"
    assert run.step < 100
    assert all(np.isfinite(t.y).all() for t in of(printed, "nfem_double_run").run.traces.values())


@pytest.mark.slow
def test_the_printed_filter_overflows_and_held_it_keeps_the_noise(printed: Result) -> None:
    """Gain near .99 at A; what its corrections set in motion reaches B."""
    end = of(printed, "ekf_printed").run.outcome
    assert end.state == "diverged"
    assert 500 <= end.step <= 620
    found = scores(printed, "ekf_held")
    assert found["node_A.rmse"] == pytest.approx(0.99 * NOISE, rel=0.02)
    assert 0 < found["node_B.rmse"] < 0.3 * found["node_A.rmse"]
    square = found["node_A.mae"] ** 2 + found["node_A.sd"] ** 2 * (STEPS - 1) / STEPS
    assert square == pytest.approx(found["node_A.rmse"] ** 2, rel=1e-9)
    assert scores(printed, "nfem")["node_B.rmse"] == 0.0  # the model that made the recording


def test_table_2_goes_together_for_some_250_samples_only() -> None:
    """RMSE^2 = MAE^2 + SD^2 (n - 1)/n with a sample SD, within the printed digits."""
    bounds = []
    for mae, rmse, sd in ((0.02191, 0.03361, 0.02554), (0.02729, 0.03419, 0.02064)):
        e = 0.5e-5
        low = ((rmse - e) ** 2 - (mae + e) ** 2) / (sd + e) ** 2
        high = ((rmse + e) ** 2 - (mae - e) ** 2) / (sd - e) ** 2
        bounds.append((1 / (1 - low), 1 / (1 - high)))
    assert round(max(low for low, _ in bounds)) == 185
    assert round(min(high for _, high in bounds)) == 344


@pytest.mark.parametrize(
    ("twin", "same"),
    [({}, True), ({"halved": 1}, False), ({"stiffness": 0.8}, False), ({"seed": 7}, True)],
)
def test_a_recording_says_whether_the_models_own_model_made_it(
    liver: Experiment, twin: dict[str, float], same: bool
) -> None:
    changed = replace(liver.parameters.settings.twin, **twin)
    assert beside("ekf_liver", "twin").same_model(changed) == same


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("body", ["generated", "data"])
def test_the_whole_experiment_stands(
    liver: Experiment, body: str, request: pytest.FixtureRequest
) -> None:
    if body == "data":
        request.getfixturevalue("data_body")
        liver = replace(liver, cases=tuple(c for c in liver.cases if c.name == "finer"))
    result = run_in_memory(liver, {"body.body": body})
    assert not result.overall.failed
    assert not [(p.name, p.fault) for p in result.published if p.fault]
    tables = {t.name: t for e in result.exhibits for t in e.tables}
    rows = {row[0]: row for row in tables["force_readings"].rows}
    assert rows["consistent"][-1] == "finished"
    assert str(rows["per_node"][-1]).startswith("invalid")
    found = scores(result, "reduced_modes")
    assert found["node_A.rmse"] < 0.2 * NOISE  # what the printed filter leaves where it is
    (check,) = of(result, "reduced_modes").checks
    assert check.verdict in ("same model", "undecided")  # its own covariance is wide
    assert 0.5 < found["node_B.nees.per_dof@finer"] < 2
    sets = next(e for e in result.exhibits if e.anchor == "sets")
    assert sets.pictures
