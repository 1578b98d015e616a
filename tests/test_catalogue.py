"""The list of experiments says what their files say, and runs none of them."""

from pathlib import Path

import pytest

from validate.catalogue import Card, card, experiment_files
from validate.errors import UsageError
from validate.replay.find import load_file


def test_a_card_says_what_the_experiment_itself_says(project_root: Path) -> None:
    files = experiment_files(project_root)
    assert len(files) >= 9
    for path in files.values():
        loaded = load_file(path)
        assert card(path) == Card(loaded.name, loaded.title, loaded.source)


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
    assert "cannot be read" in card(path).title
    path.write_bytes(b"\xff\xfe\x00")
    assert "cannot be read" in card(path).title


def test_the_nearest_folder_upward_is_taken(tmp_path: Path, project_root: Path) -> None:
    below = tmp_path / "experiments" / "a" / "b"
    below.mkdir(parents=True)
    assert "fluid_phantom" in experiment_files(below)  # an empty folder is none
    (tmp_path / "experiments" / "mine.py").touch()
    (tmp_path / "experiments" / "_part.py").touch()
    assert list(experiment_files(below)) == ["mine"]


def test_no_folder_anywhere_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("validate.catalogue.__file__", str(tmp_path / "validate" / "x.py"))
    with pytest.raises(UsageError, match="no experiments/ folder"):
        experiment_files(tmp_path)
