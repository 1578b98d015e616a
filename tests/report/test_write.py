"""The folder: complete or not there, the old one kept until the new one is complete."""

import json
import subprocess
import sys
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import pytest
from PIL import Image
from report_samples import small_result

from validate.compare.exhibit import Exhibit
from validate.compare.result import Result
from validate.errors import UsageError
from validate.report.export import parquet
from validate.report.export.table_file import CSV, PARQUET, stored_table
from validate.report.sections import sections
from validate.report.sections.sections import Section
from validate.report.write import write_report

CREATED = "2026-11-21T04:00:00Z"
LONG_TABLE = PARQUET if parquet.available() else CSV


@pytest.fixture(autouse=True)
def _no_gl(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VALIDATE_NO_GL", "1")


@pytest.mark.slow
def test_files_without_gl(tmp_path: Path) -> None:
    steps: list[str] = []
    path = write_report(
        small_result(), tmp_path / "new" / "cube", created=CREATED, progress=steps.append
    )
    folder = path.parent
    names = {p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()}
    assert names >= {
        "report.html", "results.json", "runs/soft.nc", "runs/stiff.nc", "figures/body.png",
        "figures/chart_curve_force_plate.png", LONG_TABLE,
    }  # fmt: skip
    now_in_it = ("scores", "residuals", "effects", "checks", "published", "identified")
    assert not names & {f"tables/{name}.csv" for name in now_in_it}
    assert "libegl1 and libgl1-mesa-dri" in path.read_text()
    assert json.loads((folder / "results.json").read_text())["experiment"] == "cube"
    assert steps[0] == "runs"
    assert steps[-1] == "page"
    assert [p.name for p in folder.parent.iterdir()] == ["cube"]


@pytest.mark.slow
@pytest.mark.usefixtures("drawn_figures")
def test_figures_are_whole_pictures(tmp_path: Path) -> None:
    folder = write_report(small_result(), tmp_path / "cube", created=CREATED).parent
    for path in (folder / "figures").iterdir():
        with Image.open(BytesIO(path.read_bytes())) as image:
            assert image.width > 400
            assert len(set(image.convert("L").tobytes())) > 10


def test_samples_are_si(tmp_path: Path) -> None:
    folder = write_report(small_result(), tmp_path / "cube", created=CREATED).parent
    table = stored_table(folder, part="sample")
    rows = table.where(quantity="force.plate").rows
    assert {(r.recording, r.method) for r in rows} == {
        (a, b) for a in ("cube_a", "cube_b") for b in ("measured", "soft", "stiff")
    }
    assert table.where(role="drives").rows[-1].value == pytest.approx(0.002)
    assert [r for r in rows if r.method == "soft"][-1].value == pytest.approx(4.0)


@pytest.mark.slow
def test_old_report_is_replaced_whole(tmp_path: Path) -> None:
    folder = tmp_path / "cube"
    write_report(small_result(), folder, created=CREATED)
    (folder / "left_over.txt").write_text("old")
    write_report(replace(small_result(), title="Second"), folder, created=CREATED)
    assert not (folder / "left_over.txt").exists()
    assert "Second" in (folder / "report.html").read_text()
    assert [p.name for p in tmp_path.iterdir()] == ["cube"]


@pytest.mark.slow
def test_failing_figure_leaves_the_old_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "cube"
    write_report(small_result(), folder, created=CREATED)
    before = {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()}

    def fails(_: Result) -> Exhibit:
        raise RuntimeError("no figure today")

    monkeypatch.setattr(
        sections, "SECTIONS", (*sections.SECTIONS[:2], Section("x", "X", also=fails))
    )
    with pytest.raises(RuntimeError, match="no figure today"):
        write_report(replace(small_result(), title="Second"), folder, created=CREATED)
    assert {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()} == before
    assert [p.name for p in tmp_path.iterdir()] == ["cube"]


def test_a_folder_of_the_user_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(UsageError, match=r"holds 1 entries but no results\.json"):
        write_report(small_result(), tmp_path, created=CREATED)
    assert (tmp_path / "thesis.tex").read_text() == "years of work"


def test_a_file_in_the_place(tmp_path: Path) -> None:
    (tmp_path / "cube").write_text("")
    with pytest.raises(UsageError, match="is a file"):
        write_report(small_result(), tmp_path / "cube", created=CREATED)


def test_an_unwritable_place(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="cannot write at "):
        write_report(small_result(), tmp_path / "file" / "cube", created=CREATED)


@pytest.mark.slow
def test_what_draws_is_imported_when_something_is_drawn() -> None:
    heavy = ("matplotlib", "jinja2", "vtk", "pyvista", "PIL")
    code = (
        "import sys; import validate.report.write, validate.study.study_page; "
        f"print([name for name in {heavy} if name in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=True
    )
    assert done.stdout.strip() == "[]"
