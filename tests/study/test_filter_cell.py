"""One cell: sharing gains changes nothing, scores are the pipeline's own, failures are rows."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from study_samples import experiment_file

from validate.compare.force_error import rmse, track_error
from validate.engine.cell import Plan, Record, Where
from validate.engine.execution import fingerprint, finish
from validate.engine.store import read_records
from validate.errors import ComparisonError, UsageError
from validate.estimate.kalman.coordinates import Batch
from validate.estimate.kalman.displacement_filter import DisplacementStepper
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import load_file
from validate.pipeline.experiment.options import Options
from validate.pipeline.run.method_run import Truth
from validate.pipeline.run.pipeline import compare
from validate.study.filters.cell import run_cell
from validate.study.filters.plan import Bench, FilterPlan, Ready, open_bench, plan
from validate.study.filters.score import FilterScores
from validate.study.sweep import axes

# private: _loaded, _most, _recordings, _registered, _systems, _truths: called alone, case by case.
# private: _repeated: replaced, to bring a case about.


@pytest.fixture(scope="module")
def pulled(tmp_path_factory: pytest.TempPathFactory) -> Experiment:
    return load_file(experiment_file(tmp_path_factory.mktemp("cell")))


def planned(pulled: Experiment, *sweeps: str, **values: str) -> FilterPlan:
    texts = {k.replace("__", "."): v for k, v in values.items()}
    return plan(pulled, Options(texts, ("kf",)), axes(sweeps), 3)


def first(pulled: Experiment, *sweeps: str, **values: str) -> FilterScores:
    made = planned(pulled, *sweeps, **values)
    return run_cell(Bench(pulled, made.job), made.cells[0])


def record(made: FilterPlan, folder: Path) -> Record[FilterScores]:
    """That of the first cell, by the engine."""
    work = Plan(made.job, made.cells[:1], open_bench, run_cell, FilterScores)
    return finish(work, folder, Where(workers=0)).records[made.cells[0].key]


def test_shared_gains_give_the_scores_of_single_runs(
    pulled: Experiment, monkeypatch: pytest.MonkeyPatch
) -> None:
    together = first(pulled)
    assert together.shared
    dense = first(pulled, methods__kf__gains="every_step")
    assert dense.shared
    monkeypatch.setattr(DisplacementStepper, "batch", lambda *_: None)
    alone = first(pulled)
    assert not alone.shared
    assert alone.scores.keys() == together.scores.keys()
    for name, values in alone.scores.items():
        assert together.scores[name] == pytest.approx(values, rel=1e-6), name
        assert dense.scores[name] == pytest.approx(values, rel=1e-6), name
    assert together.nis_dof == alone.nis_dof == 3 * 3 * 40
    assert len(set(together.scores["top.rmse"])) == 3  # every seed has its own noise


@pytest.mark.slow
def test_gated_and_smoothed_seeds_run_one_by_one(pulled: Experiment) -> None:
    """Gains that depend on what was measured are nobody else's; a smoothed run has no step time."""
    plain = first(pulled)
    gated = first(pulled, methods__kf__gate="0.999999")
    assert not gated.shared
    assert gated.scores["top.rmse"] == pytest.approx(plain.scores["top.rmse"], rel=1e-4)
    smoothed = first(pulled, methods__kf__smooth="true")
    assert not smoothed.shared
    assert smoothed.step_s is None
    for one, other in zip(smoothed.scores["top.rmse"], plain.scores["top.rmse"], strict=True):
        assert one != pytest.approx(other, rel=1e-3)
    assert smoothed.scores["nis.per_dof"] == pytest.approx(plain.scores["nis.per_dof"], rel=1e-6)


def test_the_first_seed_scores_what_a_run_of_the_experiment_scores(pulled: Experiment) -> None:
    scores = {s.name: s.value for s in compare(pulled, Options({}, ("kf",))).methods[0].scores}
    found = first(pulled).scores
    for name in ("top.rmse", "side.rmse", "nis.per_dof"):
        assert found[name][0] == pytest.approx(scores[name], rel=1e-6), name


def test_the_pooled_error_is_that_of_all_probes() -> None:
    from validate.study.filters.score import error_scores

    rng = np.random.default_rng(1)
    truth = {n: rng.standard_normal((9, 3)) for n in "ab"}
    estimates = {n: rng.standard_normal(9) for n in "ab"}
    found = error_scores(estimates, truth, "y")
    both = np.concatenate([estimates[n] - truth[n][:, 1] for n in "ab"])
    assert found["all.rmse"] == pytest.approx(float(np.sqrt((both**2).mean())))
    one = track_error("a", "y", estimates["a"], truth["a"][:, 1])
    assert found["a.rmse"] == rmse(one)


def test_seeds_that_miss_different_samples_run_one_by_one(pulled: Experiment) -> None:
    found = first(pulled, twin__missing="0.3")
    assert not found.shared
    assert found.nis_dof < 3 * 3 * 40


def test_a_failure_is_a_record_with_one_line(pulled: Experiment, tmp_path: Path) -> None:
    refused = record(planned(pulled, "methods.kf.Q=-1,1e-11"), tmp_path)
    assert "variance Q = -1 m2" in refused.refused
    crashed = record(planned(pulled, methods__kf__trap="raise"), tmp_path)
    assert crashed.failed == "ZeroDivisionError: a trap"
    assert crashed.value is None


def test_a_changed_file_stops_the_study(pulled: Experiment, tmp_path: Path) -> None:
    made = planned(pulled)
    with pytest.raises(UsageError, match="has changed since the study started"):
        record(replace(made, job=replace(made.job, sha256="0")), tmp_path)


def test_a_stored_cell_is_read_back_and_a_damaged_one_is_not(
    pulled: Experiment, tmp_path: Path
) -> None:
    made = planned(pulled)
    found = record(made, tmp_path)
    assert found.value is not None
    assert found.value.scores == first(pulled).scores
    key = made.cells[0].key
    stored = read_records(tmp_path, [key], FilterScores, found.code)
    assert (fingerprint(stored.records), stored.doubts) == (fingerprint({key: found}), ())
    file = tmp_path / f"{key}.json"
    file.write_text(file.read_text("utf-8")[:-20], encoding="utf-8")
    stored = read_records(tmp_path, [key], FilterScores, found.code)
    assert (stored.records, len(stored.doubts)) == ({}, 1)


def test_a_worker_keeps_few_systems_and_many_recordings(pulled: Experiment) -> None:
    """Its memory is bounded: factors of four meshes, seeds of one study."""
    bench = Bench(pulled, planned(pulled).job)
    kept = (bench._systems, bench._truths, bench._loaded, bench._registered, bench._recordings)
    assert [k._most for k in kept] == [4, 4, 4, 40, 40]


def test_a_march_that_ends_early_names_its_seed(
    pulled: Experiment, monkeypatch: pytest.MonkeyPatch
) -> None:
    end = SimpleNamespace(state="diverged", step=7, why="not finite")
    run = SimpleNamespace(outcome=end)
    monkeypatch.setattr(Ready, "run", lambda *_: run)
    made = planned(pulled, methods__kf__gate="0.9")
    with pytest.raises(ComparisonError, match="seed 5: diverged at step 7: not finite"):
        run_cell(Bench(pulled, made.job), made.cells[0])


def test_a_twin_that_tells_no_truth_is_no_benchmark(
    pulled: Experiment, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = planned(pulled)
    bench = Bench(pulled, made.job)
    monkeypatch.setattr(bench, "_repeated", lambda ready: Truth({}))
    with pytest.raises(ComparisonError, match="the truth of the twin has no probes"):
        run_cell(bench, made.cells[0])


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"values": np.nan}, "diverged: the estimate is not finite"),
        ({"dof": 0.0}, "invalid: 0 of 41 measurements reached the filter"),
    ],
)
def test_seeds_at_once_that_diverge_or_hear_nothing_are_refused(
    pulled: Experiment, values: dict[str, float], says: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = DisplacementStepper.batch

    def broken(*given: Any) -> Batch:
        found = whole(*given)
        assert found is not None
        return replace(found, **{k: 0 * getattr(found, k) + v for k, v in values.items()})

    monkeypatch.setattr(DisplacementStepper, "batch", broken)
    with pytest.raises(ComparisonError, match=says):
        first(pulled)
