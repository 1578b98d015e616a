"""Filters far from what they were made for: every run finishes or has a reason."""

from dataclasses import replace
from pathlib import Path

import pytest
from study_samples import experiment_file

from validate.engine.cell import Record, Where
from validate.estimate.filters import FILTERS
from validate.pipeline import load
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import load_file
from validate.study.filters.ranking import (
    FilterEnding,
    FilterEndings,
    endings_exhibit,
    filter_endings,
    sentence,
)


@pytest.fixture(scope="module")
def pulled(tmp_path_factory: pytest.TempPathFactory) -> Experiment:
    return load_file(experiment_file(tmp_path_factory.mktemp("endings")))


@pytest.fixture(scope="module")
def endings(pulled: Experiment, tmp_path_factory: pytest.TempPathFactory) -> FilterEndings:
    found = filter_endings(pulled, out=tmp_path_factory.mktemp("out"), where=Where(workers=0))
    assert found is not None
    return found


def test_every_run_of_a_filter_finishes_or_has_a_reason(endings: FilterEndings) -> None:
    assert not endings.bugs
    for change, ending in endings.rows:
        assert ending.state == "finished" or ending.why, change.label
    assert {c.what for c, _ in endings.rows} == {"as declared", "step", "dropped samples"}


def test_what_did_not_finish_comes_first(endings: FilterEndings) -> None:
    odd = FilterEnding("diverged", 7, 40, "not finite")
    last = endings.changes[-1]
    records = {**endings.done.records, last.key: Record(last.key, odd)}
    found = replace(endings, done=replace(endings.done, records=records))
    (table,) = endings_exhibit(found).tables
    assert table.rows[0][4:] == ("diverged", 7, 40, "not finite")
    assert "7 runs" in sentence(found)
    assert "1 diverged, 6 finished" in sentence(found)


def test_an_experiment_without_filters_has_none(pulled: Experiment) -> None:
    plain = replace(pulled, methods={"plain": pulled.methods["plain"]}, accepted=("plain",))
    assert filter_endings(plain) is None


@pytest.mark.parametrize("kind", FILTERS)
def test_noise_settings_are_fields_of_their_filter(kind: type) -> None:
    noise = kind.noise_settings  # type: ignore[attr-defined]
    names = [n for n in (noise.process, noise.measurement, noise.start) if n]
    assert names
    assert set(names) <= set(kind.__dataclass_fields__)  # type: ignore[attr-defined]


@pytest.mark.slow
def test_extremes_of_shipped_filters_end_with_a_reason(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """15 filters of a block, noises a million times off: some diverge, none without a reason."""
    experiment = load("kf_cube")
    found = filter_endings(experiment, out=tmp_path, where=Where(workers=0))
    assert found is not None
    assert not found.bugs
    states = [e.state for _, e in found.rows]
    assert states.count("finished") > 100
    assert states.count("diverged") >= 3
    by = {(c.cell.method, c.what, c.factor): e for c, e in found.rows}
    assert "lies 0.5 steps" in by["kf_load", "step", 2.0].why
    for name in ("roukf", "roukf_layer"):  # the second one has a layer without any stiffness
        assert "overflow" in by[name, "start noise", 1000.0].why
    assert "DGEMV" not in "".join(capfd.readouterr())
    assert all(e.why for _, e in found.rows if e.state != "finished")
