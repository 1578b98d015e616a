"""Names of stored runs: every command and function finds the same folder by the same name."""

from pathlib import Path

import pytest
from command_line import here, refused
from report_samples import small_result

import validate
from validate.errors import UsageError
from validate.report.stored.json_values import write_json
from validate.report.stored.store import document

FOLDERS = ("cube+quick-aaaaaa", "cube+quick+material.E-bbbbbb", "cube+methods-cccccc")
NEWEST = {"cube": 2, "cube.py": 2, "cube+quick": 1, "cube+methods": 2, "cube+quick+material.E": 1,
          "cube+quick-aaaaaa": 0, f"reports/{FOLDERS[0]}": 0}  # fmt: skip


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Three variations of an experiment that was never run as declared, the last one newest."""
    for day, name in enumerate((*FOLDERS, "cube-of-another"), 20):
        (tmp_path / "reports" / name).mkdir(parents=True)
        content = document(small_result(), f"2026-11-{day}T04:00:00+00:00")
        write_json(content, tmp_path / "reports" / name / "results.json")
        (tmp_path / "reports" / name / "report.html").touch()
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", NEWEST)
def test_a_name_is_one_run_for_everything_that_reads_one(
    name: str, lab: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = lab / "reports" / FOLDERS[NEWEST[name]]
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", lambda address: opened.append(address) or True)
    assert validate.open_run(name).folder == folder
    assert validate.compare(name, lab / "reports" / FOLDERS[0]).runs[0].startswith(folder.name)
    assert here("compare", name, FOLDERS[0], "--json")[1].count(folder.name) > 0
    assert here("open", name)[0] == 0
    assert opened == [(folder / "report.html").as_uri()]
    assert here("show", name, "checks", "-o", "checks.csv")[0] == 0
    assert here("export", name, "--latex", "checks.tex")[0] == 0
    assert f"2{NEWEST[name]}T04" in Path("checks.tex").read_text("utf-8")


def test_a_history_takes_the_name_of_variations(lab: Path) -> None:
    assert here("history", "cube")[1].count(" UTC, ") == 3
    assert here("history", "cube+quick")[1].count(" UTC, ") == 2


@pytest.mark.parametrize("command", [["show"], ["open"], ["compare", "cube"], ["export"]])
def test_an_unknown_name_is_one_line(command: list[str], lab: Path) -> None:
    (lab / "reports" / FOLDERS[0] / "results.json").unlink()
    (lab / "reports" / FOLDERS[1] / "results.json").unlink()
    assert FOLDERS[2] in refused(*command, "cube+quick")
    with pytest.raises(UsageError, match="nearest"):
        validate.open_run("cube+quick")
