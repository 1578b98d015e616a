"""The list of experiments says what their files say, and runs none of them."""

import random
import sys
from pathlib import Path

import pytest

from validate.catalogue import Card, card, experiment_files, root_of, shipped
from validate.datasets.home import data_sets
from validate.errors import UsageError
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import load_file

# private: _PACKAGE: the package's folder, replaced by one of the test.


def test_a_card_says_what_the_experiment_itself_says(project_root: Path) -> None:
    files = experiment_files(project_root)
    assert len(files) >= 9
    for path in files.values():
        loaded = load_file(path)
        assert loaded.needs in ("", *(s.name for s in data_sets()))
        assert card(path) == Card(loaded.name, loaded.title, loaded.source, needs=loaded.needs)


@pytest.mark.parametrize(
    ("text", "title", "source"),
    [
        ('A = "x"\nEXPERIMENT = E(title=A, source=f"{A} of y")', "x", "x of y"),
        ('"""Doc.\n\nmore"""\nEXPERIMENT = E(title=made(), source=1)', "Doc.", ""),
        ('raise SystemExit\nEXPERIMENT = replace(OTHER, title="t")', "t", ""),
        ("f(x).y = 1\nEXPERIMENT = OTHER", "", ""),
    ],
)
def test_literal_texts_are_read_without_running(
    tmp_path: Path, text: str, title: str, source: str
) -> None:
    path = tmp_path / "mine.py"
    path.write_text(text, "utf-8")
    assert card(path) == Card("mine", title, source)


def test_a_file_that_is_no_python_has_a_line_of_its_own(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text("EXPERIMENT = (", "utf-8")
    assert card(path).note == "cannot be read: '(' was never closed (mine.py, line 1)"
    path.write_bytes(b"\xff\xfe\x00")
    assert "cannot be read" in card(path).note
    path.write_text("def f(): pass", "utf-8")
    assert card(path).note == "defines no EXPERIMENT"
    path.write_text("from other import EXPERIMENT", "utf-8")
    assert card(path).note == ""


def test_a_folder_is_looked_at_only_where_it_is_the_projects_the_current_or_named(
    tmp_path: Path,
) -> None:
    above, project = tmp_path, tmp_path / "project"
    here, named = project / "deep" / "here", tmp_path / "named"
    for folder in (above, project, project / "deep", here):
        (folder / "experiments").mkdir(parents=True)
        (folder / "experiments" / f"of_{folder.name}.py").touch()
        (folder / "experiments" / "_part.py").touch()
    (project / "pyproject.toml").touch()
    named.mkdir()
    (named / "of_named.py").touch()
    own = [name for name in experiment_files(here, [named]) if name.startswith("of_")]
    assert own == ["of_project", "of_here", "of_named"]
    assert "of_named" not in experiment_files(here)
    outside = experiment_files(above / "named")
    assert {"kf_cube", "hanging_bar"} <= outside.keys()
    assert all(f.is_relative_to(shipped()) for f in outside.values())


def test_of_two_with_one_name_the_nearer_is_meant(tmp_path: Path) -> None:
    for folder in ("experiments", "named"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "kf_cube.py").touch()
    assert experiment_files(tmp_path)["kf_cube"].parent == tmp_path / "experiments"
    named = experiment_files(tmp_path, [tmp_path / "named"])
    assert named["kf_cube"].parent == tmp_path / "named"


def test_no_experiment_anywhere_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("validate.catalogue._PACKAGE", tmp_path / "validate")
    with pytest.raises(UsageError, match="no experiments/ folder"):
        experiment_files(tmp_path)
    with pytest.raises(UsageError, match=r"--experiments .*: no experiment file"):
        experiment_files(tmp_path, [tmp_path / "nowhere"])


def test_a_file_named_as_a_module_leaves_that_module_alone(tmp_path: Path) -> None:
    path = tmp_path / "random.py"
    path.write_text("EXPERIMENT = 1", "utf-8")
    with pytest.raises(UsageError, match="of type Experiment"):
        load_file(path)
    assert sys.modules["random"] is random


def test_reports_go_where_the_user_stands(phantom: Experiment, tmp_path: Path) -> None:
    project = shipped().parent
    assert root_of(phantom.path, project / "docs") == project
    assert root_of(phantom.path, tmp_path) == tmp_path
