"""The page over all stored runs, and reports opened from the command line."""

import csv
import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest
from command_line import here, refused
from report_samples import small_result

from validate.report.write import write_report
from validate.study.stored_runs.overview import share, stored, write_overview

FIRST, SECOND = "2026-11-21T04:00:00+00:00", "2026-11-22T05:00:00+00:00"


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder where `cube` ran twice, with another modulus, and `ball` once."""
    result, folder = small_result(), tmp_path_factory.mktemp("reports")
    other = tuple(
        replace(p, default=2e4) if p.path == "material.E" else p for p in result.parameters
    )
    write_report(result, folder / "cube", created=FIRST)
    write_report(replace(result, parameters=other), folder / "cube", created=SECOND)
    write_report(replace(result, name="ball"), folder / "ball", created=FIRST)
    return folder


@pytest.fixture
def reports(written: Path, tmp_path: Path) -> Path:
    """A copy, which a test may add to."""
    shutil.copytree(written, tmp_path, dirs_exist_ok=True)
    return tmp_path


def test_every_folder_is_a_row_that_leads_to_its_report(reports: Path) -> None:
    page = write_overview(reports)
    text = page.read_text("utf-8")
    for folder in ("cube", "ball"):
        assert f'href="../{folder}/report.html"' in text
        assert (page.parent / f"../{folder}/report.html").is_file()
    with (page.parent / "tables" / "runs.csv").open() as file:
        rows = {row["run"]: row for row in csv.DictReader(file)}
    assert list(rows) == ["cube", "ball"]  # the newest first
    assert rows["cube"]["verdict"] == "good enough"
    assert rows["cube"]["changed since the run before"] == "material.E: 10000 Pa -> 20000 Pa"
    assert rows["ball"]["changed since the run before"] == "first run"
    document = json.loads((page.parent / "results.json").read_text("utf-8"))
    assert [run["folder"] for run in document["runs"]] == ["cube", "ball"]


def test_a_first_run_with_other_parameters_is_told_beside_the_declared_one(reports: Path) -> None:
    result = small_result()
    other = tuple(
        replace(p, default=3e4) if p.path == "material.E" else p for p in result.parameters
    )
    write_report(replace(result, parameters=other), reports / "cube+E", created=SECOND)
    write_report(replace(result, name="cone", parameters=other), reports / "cone+E", created=SECOND)
    changed = {s.folder: s.changed for s in stored(reports)}
    assert changed["cube+E"] == "first run; against cube: material.E: 20000 Pa -> 30000 Pa"
    assert changed["cone+E"] == "first run"  # of which no declared run is stored


def test_pages_over_several_runs_and_of_studies_are_linked(reports: Path) -> None:
    for place in ("summary", "cube/study-choose"):
        (reports / place).mkdir()
        (reports / place / "report.html").write_text("a page")
    text = write_overview(reports).read_text("utf-8")
    assert 'href="../summary/report.html"' in text
    assert 'href="../cube/study-choose/report.html"' in text
    assert "../published" not in text


def test_shares_of_limits_over_the_runs_are_a_curve(reports: Path) -> None:
    write_overview(reports)
    with (reports / "overview" / "tables" / "chart_trend.csv").open() as file:
        rows = [row for row in csv.reader(file) if row[:2] == ["cube", "line"]]
    cube = next(s for s in stored(reports) if s.folder == "cube")
    assert [float(row[3]) for row in rows] == [share(run) for run in cube.runs]
    check = small_result().checks[0]
    assert check.limit
    assert float(rows[0][3]) == pytest.approx(abs(check.value) / check.limit)


def test_a_quick_run_is_called_so_and_fitted_checks_take_no_share(reports: Path) -> None:
    result = small_result()
    fitted = replace(result.checks[0], name="force.max@fit", value=9.0, acceptance="fitted",
                     validation="fitted")  # fmt: skip
    first = replace(result.methods[0], checks=(*result.methods[0].checks, fitted))
    quick = replace(result, methods=(first, *result.methods[1:]), quick=True)
    write_report(quick, reports / "cube+quick-1", created=SECOND)
    one = next(s for s in stored(reports) if s.folder == "cube+quick-1")
    assert one.verdict == "good enough (quick run)"
    assert share(one.runs[-1]) == share(stored(reports)[0].runs[0])


def test_the_overview_is_no_run_of_its_own(reports: Path) -> None:
    write_overview(reports)
    assert [s.folder for s in stored(reports)] == ["cube", "ball"]
    write_overview(reports)


def test_open_finds_the_page(reports: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", lambda address: opened.append(address) or True)
    assert here("open", "cube", "--out", str(reports))[0] == 0
    assert here("open", "--out", str(reports))[0] == 0
    assert opened == [
        (reports / p / "report.html").resolve().as_uri() for p in ("cube", "overview")
    ]


@pytest.mark.parametrize("command", [("open", "cub"), ("report",)])
def test_nothing_stored_is_refused(command: tuple[str, ...], tmp_path: Path) -> None:
    assert "validate run" in refused(*command, "--out", str(tmp_path / "none"))


def test_a_wrong_name_gets_the_nearest(reports: Path) -> None:
    assert "cube" in refused("open", "cub", "--out", str(reports))


def test_figures_are_vectors_and_tables_are_files(reports: Path, tmp_path: Path) -> None:
    folder = tmp_path / "figures"
    assert here("export", str(reports / "cube"), "--figures", str(folder))[0] == 0
    names = {f.name for f in folder.iterdir()}
    charts = {f"limits_{width}mm.{kind}" for width in (85, 175) for kind in ("svg", "pdf")}
    assert charts | {"checks.csv", "checks.tex", "body.png"} <= names
    assert any(name.startswith("curve") and name.endswith(".svg") for name in names)
    root = ElementTree.parse(folder / "limits_85mm.svg").getroot()
    assert root.tag.endswith("svg")
    assert float(root.get("width", "").removesuffix("pt")) == pytest.approx(85 / 25.4 * 72)
    assert root.findall(".//{*}image") == []  # lines, not pixels
    assert (folder / "limits_175mm.pdf").read_bytes().startswith(b"%PDF")


def test_an_export_replaces_its_own_files_by_force_alone(reports: Path, tmp_path: Path) -> None:
    """A file of an earlier export that is not written again is removed, one of the user's stays."""
    folder = tmp_path / "figures"
    folder.mkdir()
    asked = ("export", str(reports / "cube"), "--figures", str(folder))
    (folder / "thesis.tex").write_text("mine")
    assert "--force" in refused(*asked)
    (folder / "figures.json").write_text('{"files": ["old.svg", "../kept.svg", "gone.svg"]}')
    (folder / "old.svg").touch()
    (tmp_path / "kept.svg").touch()
    assert here(*asked, "--force")[0] == 0
    assert not (folder / "old.svg").exists()
    assert (tmp_path / "kept.svg").exists()
    assert (folder / "thesis.tex").read_text() == "mine"
    names = set(json.loads((folder / "figures.json").read_text())["files"])
    assert names == {f.name for f in folder.iterdir()} - {"thesis.tex", "figures.json"}


def test_figures_report_their_progress(
    reports: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[tuple[int, int]] = []

    @contextmanager
    def heard(title: str) -> Iterator[object]:
        yield lambda done, total, text: told.append((done, total))

    monkeypatch.setattr("validate.commands.export.progress", heard)
    folder = tmp_path / "figures"
    assert here("export", str(reports / "cube"), "--figures", str(folder))[0] == 0
    count = len(list(folder.glob("*.pdf")))
    assert told == [(i, count) for i in range(count)]
