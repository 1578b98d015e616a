"""Logs of another material or specimen: what is printed for the Ecoflex cylinder is not theirs."""

from dataclasses import replace
from pathlib import Path

import pytest

from experiments.ecoflex_cylinder.cylinder import load
from experiments.ecoflex_cylinder.published import follows, material_of
from validate.errors import RecordingError
from validate.parameters import with_values
from validate.pipeline import load as experiment_named
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.origins import opened
from validate.pipeline.experiment.tree import Tree


def tree(folder: Path, logs: str, **values: str) -> Tree:
    given = {"data": str(folder), "logs": logs, **values}
    found: Tree = with_values(experiment_named("ecoflex_cylinder").parameters, given)
    return found


def followed(folder: Path, logs: str) -> Experiment:
    experiment, p = experiment_named("ecoflex_cylinder"), tree(folder, logs)
    found = opened(experiment, p)
    return follows(experiment, found.recordings, found.parameters)


@pytest.fixture(scope="module")
def logs(shared_data: Path) -> Path:
    return shared_data / "force" / "ecoflex-compression"


def test_the_five_logs_leave_the_experiment_as_declared(logs: Path) -> None:
    declared, p = experiment_named("ecoflex_cylinder"), tree(logs, "EF30_0T_A1.csv")
    one = load(p, logs)[0]
    found = follows(declared, [replace(one, name=f"EF30_0T_A{k}") for k in range(1, 6)], p)
    assert (found.title, found.accept) == (declared.title, declared.accept)
    kept = [(f.name, f.expected, f.other) for f in found.published]
    assert kept == [(f.name, f.expected, "") for f in declared.published]


def test_another_material_has_its_own_title_and_limit_and_no_printed_figure(logs: Path) -> None:
    found = followed(logs, "EF50_0T_A*.csv")
    assert found.title == "EF50_0T: cylinder compressed between plates, 1 log"
    assert "Ecoflex 00-30" not in found.title + found.source
    figures = [f.beside({}) for f in found.published]
    assert {f.verdict for f in figures} == {"other data"}
    assert figures[0].why == "printed for EF30_0T; not compared with this data (EF50_0T)"
    (accept,) = found.accept
    assert accept.limit == pytest.approx(3.40, abs=0.01)  # 34 N at 10 % strain in the log itself
    assert "these logs" in accept.reason
    assert found.uncertainty is not None
    assert all(i.source.startswith("assumed, as for EF30_0T") for i in found.uncertainty.inputs)


def test_a_file_that_was_renamed_is_still_the_material_it_says(logs: Path, tmp_path: Path) -> None:
    (tmp_path / "EF30_0T_A1.csv").write_bytes((logs / "EF50_0T_A1.csv").read_bytes())
    found = followed(tmp_path, "EF30_0T_A*.csv")
    assert {f.beside({}).verdict for f in found.published} == {"other data"}


def test_other_logs_of_the_printed_material_are_held_to_its_number_alone(logs: Path) -> None:
    found = followed(logs, "EF30_0T_A1.csv")
    assert found.title == "EF30_0T: cylinder compressed between plates, 1 log"
    figure = found.published[0]
    assert figure.beside({"identified": {"modulus.E": 112e3}}).verdict == "reproduced"
    assert figure.beside({"identified": {"modulus.E": 173e3}}).verdict == "not reproduced"


def test_windows_are_named_by_the_strains_they_end_at(logs: Path) -> None:
    experiment = experiment_named("ecoflex_cylinder")
    p = tree(logs, "EF30_0T_A1.csv", limit_linear="0.125")
    (accept,) = follows(experiment, recordings := load(p, Path()), p).accept
    assert accept.loads == ("12.5pct",)
    assert material_of(recordings[0]) == "EF30_0T"


def test_missing_logs_name_the_folder_and_the_setting(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"no logs '\*.csv'.*--set logs=PATTERN"):
        load(tree(tmp_path, "*.csv"), tmp_path)
