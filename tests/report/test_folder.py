"""Folders are replaced whole; studies inside a report's folder stay."""

from pathlib import Path

import pytest

from validate.errors import UsageError
from validate.report.folder import MARK, STUDIES, replace_folder


def fill(text: str) -> object:
    def write(folder: Path) -> None:
        (folder / MARK).write_text(text, encoding="utf-8")

    return write


def test_a_new_report_leaves_the_studies_below_it(tmp_path: Path) -> None:
    folder = tmp_path / "kf"
    cell = folder / "study-filters" / "cells" / "1.json"
    cell.parent.mkdir(parents=True)
    cell.write_text("{}", encoding="utf-8")
    for text in ("one", "two"):
        replace_folder(folder, fill(text), (STUDIES,))  # type: ignore[arg-type]
        assert (folder / MARK).read_text("utf-8") == text
        assert cell.read_text("utf-8") == "{}"
    assert [p.name for p in tmp_path.iterdir()] == ["kf"]


def test_a_failure_leaves_the_old_folder_and_its_studies(tmp_path: Path) -> None:
    folder = tmp_path / "kf"
    (folder / "study-filters").mkdir(parents=True)
    replace_folder(folder, fill("one"), (STUDIES,))  # type: ignore[arg-type]

    def fail(fresh: Path) -> None:
        (fresh / "half").write_text("", encoding="utf-8")
        raise RuntimeError("disk full")

    with pytest.raises(RuntimeError):
        replace_folder(folder, fail, (STUDIES,))
    assert {p.name for p in folder.iterdir()} == {MARK, "study-filters"}
    assert [p.name for p in tmp_path.iterdir()] == ["kf"]


def test_a_folder_of_the_user_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("", encoding="utf-8")
    with pytest.raises(UsageError, match="1 entries and no"):
        replace_folder(tmp_path / "mine", fill(""), (STUDIES,))  # type: ignore[arg-type]
