"""`validate identify` on the benchmark's block in eight boxes: kept cells, bounds, errors."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from command_line import here, refused

from validate.engine.cell import Record, Where
from validate.errors import ComparisonError
from validate.pipeline.experiment.find import load_file
from validate.study.identify import study as identify_module
from validate.study.identify.study import IdentifyStudy, identification

# private: _value: called alone, case by case.

ALONE = ("--workers", "0")


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory, project_root: Path) -> Path:
    """The benchmark's experiment, coarse and linear; Poisson ratio and C01 are known."""
    text = (project_root / "benchmarks" / "identified_block.py").read_text("utf-8")
    for one, other in (
        ("SIDE, CELLS = 0.03, 11", "SIDE, CELLS = 0.03, 2"),
        ("Material(None, None,", "Material(None, 0.42,"),
        ("second: float | None = quantity(None", "second: float | None = quantity(1e3"),
    ):
        assert one in text
        text = text.replace(one, other)
    path = tmp_path_factory.mktemp("block") / "identified_block.py"
    path.write_text(text, "utf-8")
    return path


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("out")


@pytest.mark.slow
def test_what_stands_open_is_identified_reported_and_kept(block: Path, out: Path) -> None:
    command = ("identify", str(block), "--quick", "--out", str(out), *ALONE, "--json")
    code, printed, _ = here(*command, VALIDATE_NO_GL="1")
    assert code == 0
    told = json.loads(printed)["study"]
    (one,) = told["calibrations"]
    (E,) = one["parameters"]
    assert (E["name"], E["unit"], E["identified"]) == ("material.E", "Pa", True)
    assert E["low"] < 20e3 < E["high"]
    assert E["value"] == pytest.approx(20e3, rel=0.02)
    assert max(E["rise"]) > 3.4
    assert len(one["starts"]) == 4
    assert told["reused"] == 0
    page = next(out.glob("identified_block/study-identify*/report.html")).read_text("utf-8")
    assert "Fitted: material.E = " in page
    assert "E: profile" in page
    again = json.loads(here(*command, VALIDATE_NO_GL="1")[1])["study"]
    assert again["reused"] == 7  # four starts, two sides
    assert again["calibrations"] == told["calibrations"]


@pytest.mark.slow
def test_run_identifies_with_the_same_cells_and_opens_with_what_was_fitted(
    block: Path, out: Path
) -> None:
    before = len(list(out.glob("identified_block/study-identify/cells/*.json")))
    code, printed, _ = here("run", str(block), "--quick", "--out", str(out), VALIDATE_NO_GL="1")
    assert code == 0
    assert (
        "Identified, with 95 % intervals\n  material.E  " in printed
        or "no check is evidence" in printed
    )
    assert len(list(out.glob("identified_block/study-identify/cells/*.json"))) == before
    (page,) = out.glob("identified_block+quick*/report.html")
    assert "Fitted: material.E = " in page.read_text("utf-8")


@pytest.mark.slow
def test_bounds_make_any_number_free_and_what_is_not_identified_is_told(
    block: Path, tmp_path: Path
) -> None:
    """Bounds so near that the recording says nothing between them."""
    code, printed, errors = here(
        "identify", str(block), "--quick", "-v", "--parameters", "second=900:1100", "--seeds", "2",
        "--out", str(tmp_path), *ALONE, VALIDATE_NO_GL="1",
    )  # fmt: skip
    assert code == 1, errors
    assert "second" in printed
    assert "not identifiable" in printed
    assert "force at larger strain would identify it" in " ".join(printed.split())
    assert "correlations: " in printed


def test_what_cannot_be_asked_is_one_line(block: Path, tmp_path: Path) -> None:
    common = ("identify", str(block), "--out", str(tmp_path), *ALONE)
    line = refused(*common, "--parameters", "mu")
    assert "unknown parameter 'mu'" in line
    line = refused(*common, "--parameters", "material.E=1kPa")
    assert "expected material.E=LOW:HIGH" in line
    line = refused(*common, "--parameters", "material.E=1e5:1e3")
    assert "bounds 100000 to 1000" in line
    line = refused(*common, "--parameters", "material.E,material.E")
    assert "material.E is given twice" in line
    line = refused(*common, "--parameters", "methods.newton.tolerance=1e-9:1e-3")
    assert "a setting of a method cannot be identified" in line
    line = refused(*common, "--seeds", "0")
    assert "--seeds 0: expected at least one start" in line


def test_a_parameter_that_is_not_declared_needs_bounds(block: Path, tmp_path: Path) -> None:
    bare = tmp_path / "identified_block.py"
    kept = [
        line for line in block.read_text("utf-8").splitlines() if 'Free("material.nu"' not in line
    ]
    bare.write_text("\n".join(kept), "utf-8")
    line = refused(
        "identify", str(bare), "--parameters", "material.nu", "--out", str(tmp_path), *ALONE
    )
    assert "--parameters material.nu: no bounds; declared: material.E, second" in line


@pytest.mark.slow
def test_finished_cells_are_not_run_again(block: Path, tmp_path: Path) -> None:
    def found(starts: int) -> IdentifyStudy:
        return identification(load_file(block), starts=starts, out=tmp_path, where=Where(0))

    one = found(1)
    assert (one.done.reused, len(one.done.records)) == (0, 4)
    more = found(2)
    assert more.done.reused == 4
    (first,), (second,) = ([c.found.estimates[0] for c in f.calibrated] for f in (one, more))
    assert first.value == pytest.approx(second.value, rel=1e-4)
    assert first.low < 20e3 < first.high


def _heeds_ctrl_c() -> None:
    """A shell that starts the tests in the background has them ignore it, and theirs too."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.mark.slow
@pytest.mark.parametrize(("by", "code"), [(signal.SIGKILL, -9), (signal.SIGINT, 130)])
def test_what_is_stopped_goes_on_where_it_was(
    block: Path, tmp_path: Path, by: signal.Signals, code: int
) -> None:
    command = [sys.executable, "-m", "validate", "identify", str(block), "--workers", "0"]
    stopped = subprocess.Popen(
        [*command, "--out", str(tmp_path)], stderr=subprocess.PIPE, preexec_fn=_heeds_ctrl_c
    )
    cells = tmp_path / "identified_block" / "study-identify" / "cells"
    end = time.monotonic() + 100
    while len(kept := list(cells.glob("*.json"))) < 2:
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.02)
    stopped.send_signal(by)
    words = stopped.communicate()[1].decode()
    assert stopped.returncode == code
    if by == signal.SIGINT:
        assert "finished cells are kept; the same command resumes from there" in words
    written = {f: f.stat().st_mtime_ns for f in kept}
    found = identification(load_file(block), out=tmp_path, where=Where(0))
    assert 2 <= found.done.reused < len(found.done.records) == 8
    assert {f: f.stat().st_mtime_ns for f in kept} == written


def test_a_cell_that_failed_is_raised_by_its_label() -> None:
    found = SimpleNamespace(records={"k": Record("k", failed="out of memory"), "g": Record("g", 3)})
    assert identify_module._value(found, SimpleNamespace(key="g")) == 3  # type: ignore[arg-type]
    with pytest.raises(ComparisonError, match="start 4: out of memory"):
        identify_module._value(found, SimpleNamespace(key="k", label="start 4"))  # type: ignore[arg-type]
