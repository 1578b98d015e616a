"""Runs as cells: what was computed is kept and taken up, by whoever asks for the same."""

import itertools
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from beside import experiment
from command_line import here
from study_samples import TEXT
from test_external_methods import FAKE

from validate.catalogue import experiment_files, shipped
from validate.engine import execution
from validate.engine.cluster import Drain
from validate.parameters import describe
from validate.pipeline.calibration.calibrated import middle
from validate.pipeline.checks.checks import variants_of
from validate.pipeline.experiment.declaration import decoded, encoded
from validate.pipeline.run.runs import ExperimentRuns
from validate.report.export.table_file import stored_table

# private: _PATIENCE, _WORTH: replaced by a small number: a short test.
# private: _collect: replaced, to bring a case about.

NAMES = sorted(experiment_files(shipped().parent))
STORED = re.compile(r"(\d+) of (\d+) computations were stored")


pytestmark = pytest.mark.usefixtures("one_picture")


@pytest.mark.parametrize("name", NAMES)
def test_parameters_of_every_run_reach_a_worker_as_they_are(name: str) -> None:
    declared = experiment(name)
    parameters = middle(declared, declared.parameters)
    runs = ExperimentRuns(declared, declared.methods, parameters, None, quick=False)
    wanted = [parameters, *(runs.wanted(v).parameters for v in variants_of(runs))]
    for one in [*wanted, *(case.change(parameters) for case in declared.cases)]:
        text = encoded(one, "parameters")
        there = decoded(text, "parameters", declared)
        assert describe(there) == describe(one)
        assert there == one
        assert encoded(there, "parameters") == text
    for key, method in declared.methods.items():
        at = f"methods.{key}"
        assert decoded(encoded(method, at), at, declared) == method


def pulled(folder: Path) -> Path:
    """The pulled block with a method that comes last and may wait."""
    path = folder / "experiments" / "pulled.py"
    path.parent.mkdir()
    last = '"late": Method("late", Filter(), markers=("top",))'
    path.write_text(TEXT.replace("Newmark())},", f"Newmark()), {last}}},"), "utf-8")
    return path


def asked(folder: Path, path: Path, *more: str) -> str:
    trap = f"methods.late.trap=count:{folder}"
    code, out, err = here("run", str(path), "--out", str(folder / "out"), "--set", trap, *more)
    assert code in (0, 1), err
    return out + err


def prepared(folder: Path) -> int:
    """How often the late method was prepared."""
    return len((folder / "runs").read_text().splitlines())


def test_an_unchanged_run_computes_nothing_and_keeps_its_report(tmp_path: Path) -> None:
    path = pulled(tmp_path)
    assert not STORED.search(asked(tmp_path, path))
    (page,) = (tmp_path / "out").glob("pulled+*/report.html")
    written = page.stat().st_mtime_ns
    said = asked(tmp_path, path)
    found = STORED.search(said)
    assert found is not None
    assert found[1] == found[2] == "4"  # three methods and the truth of the twin
    assert "is unchanged" in said
    assert page.stat().st_mtime_ns == written
    assert prepared(tmp_path) == 1


def test_what_changed_is_computed_and_nothing_else(tmp_path: Path) -> None:
    path = pulled(tmp_path)
    asked(tmp_path, path)
    said = STORED.search(asked(tmp_path, path, "--set", "methods.kf.Q=2e-11"))
    assert said is not None
    assert said[0].startswith("3 of 4")
    assert prepared(tmp_path) == 1
    assert not STORED.search(asked(tmp_path, path, "--set", "twin.seed=9"))  # another recording
    assert prepared(tmp_path) == 2
    path.write_text(path.read_text("utf-8") + "\n# other code\n", "utf-8")
    assert not STORED.search(asked(tmp_path, path))
    assert prepared(tmp_path) == 3


COMPARES = """
def compares(recordings, parameters, methods, solves):
    own, stiffer = solves([Variant("late"), Variant("late", {"material.E": "x 2"})])
    assert own.keys() == stiffer.keys()
    assert any((own[k].values != stiffer[k].values).any() for k in own)
    return Identified(parameters, (), ("a stiffer one was compared",))


EXPERIMENT = """


def test_runs_that_an_identification_compares_are_kept_and_are_those_of_the_report(
    tmp_path: Path,
) -> None:
    """Two of them, of which one is the method as it is."""
    path = pulled(tmp_path)
    text = path.read_text("utf-8").replace("EXPERIMENT = ", COMPARES, 1)
    text = text.replace("import Experiment, Twin", "import (\n    Experiment, Identified, "
                        "IdentifiedByRuns, Twin, Variant)")  # fmt: skip
    text = text.replace("Experiment(\n", "Experiment(\n    identify=IdentifiedByRuns(compares),\n")
    path.write_text(text, "utf-8")
    assert not STORED.search(asked(tmp_path, path))
    assert prepared(tmp_path) == 2
    found = STORED.search(asked(tmp_path, path))
    assert found is not None
    assert found[1] == found[2] == "5"
    assert prepared(tmp_path) == 2
    said = asked(tmp_path, path, "--set", "material.E=11kPa")
    assert not STORED.search(said)
    assert prepared(tmp_path) == 4


ADDS = """
def adds(parameters, cases, progress):
    with (Path(__file__).parent / "added").open("a") as out:
        out.write("x")
    rows = (("top", 1.5, None), (TableCell(2.0, "m", "two", "good"), 3, "text"))
    table = NumberTable("added", "Added", ("a", "b", "c"), rows)
    line = Series("line", np.arange(300.0), np.full(300, 2.0))
    picture = Picture("p", "Shown", "A picture", np.zeros((20, 30, 3), np.uint8))
    images = (picture.pixels, picture.pixels + 9)
    moves = ImageSeries("m", "Moves", "It moves", images, ("0 mm", "1 mm"))
    shown = Exhibit("added", "Added", ("Words.",), (table,), (Chart("c", "C", "x", "y", (line,)),),
                    pictures=(picture, moves))
    row = RowBlock(LongRow(quantity="gain", unit="1", sd=0.5), np.arange(300.0))
    return ReportAdditions((shown,), {"number": 0.25}, (row,))


EXPERIMENT = """


def test_what_an_experiment_adds_is_kept_until_its_runs_or_parameters_change(
    tmp_path: Path,
) -> None:
    path = pulled(tmp_path)
    text = path.read_text("utf-8").replace("EXPERIMENT = ", ADDS, 1)
    text = text.replace("import Experiment, Twin", "import Experiment, ReportAdditions, Twin\n"
                        "from validate.compare.exhibit import (Chart, Exhibit, ImageSeries, "
                        "NumberTable, Picture, Series, TableCell)\n"
                        "from validate.compare.row import LongRow, RowBlock")  # fmt: skip
    text = text.replace("Experiment(\n", "Experiment(\n    exhibits=adds,\n", 1)
    path.write_text(text, "utf-8")
    added, asks = path.parent / "added", (*itertools.repeat((), 2), ("material.E=11kPa",))
    for change, times in zip(asks, (1, 1, 2), strict=True):
        found = STORED.search(asked(tmp_path, path, *(w for c in change for w in ("--set", c))))
        assert len(added.read_text()) == times
    assert found is None
    said = asked(tmp_path, path)
    assert "5 of 5 computations were stored" in said
    assert "is unchanged" in said  # what came from the store is what was computed
    page = max(tmp_path.rglob("report.html"), key=lambda p: len(p.parent.name) < 10)
    page.unlink()  # the report is written anew, of what is stored
    asked(tmp_path, path)
    assert len(added.read_text()) == 2
    found_rows = stored_table(page.parent, quantity="gain").rows
    assert [(r.value, r.sd, r.unit) for r in found_rows[:2]] == [(0.0, 0.5, "1"), (1.0, 0.5, "1")]


def test_a_recording_without_a_hash_is_known_by_its_content(tmp_path: Path) -> None:
    """A file that the experiment reads itself, and says nothing of."""
    path = pulled(tmp_path)
    plain = "stamped(record(p, lambda _: None), p)"
    note = "{'text': (folder / 'note').read_text()}"
    read = f"replace(r := {plain}, metadata={{**r.metadata, 'note': {note}}})"
    text = path.read_text("utf-8").replace(f"({plain},)", f"({read},)")
    path.write_text(
        text.replace("import os", "import os\nfrom dataclasses import replace", 1), "utf-8"
    )
    for words, stored in (("one", False), ("one", True), ("other", False)):
        (path.parent / "note").write_text(words)
        assert bool(STORED.search(asked(tmp_path, path))) == stored


def test_an_error_in_a_run_is_what_it_was(tmp_path: Path) -> None:
    path = pulled(tmp_path)
    trap = ("run", str(path), "--out", str(tmp_path / "out"), "--set", "methods.late.trap=raise")
    for _ in range(2):  # stored or not
        code, _, err = here(*trap)
        assert code == 70
        assert "Traceback" in err
        assert "ZeroDivisionError: a trap" in err


def test_a_mistake_of_the_experiments_own_code_is_named_below_its_traceback(tmp_path: Path) -> None:
    """Also where a library below it raised; a bug of the package has no such line."""
    path = pulled(tmp_path)
    text = path.read_text("utf-8")
    wrong = "load=lambda p, folder: np.zeros(2).reshape(3),"
    kept = next(line for line in text.splitlines() if line.strip().startswith("load="))
    path.write_text(text.replace(kept.strip(), wrong), "utf-8")
    line = next(i for i, t in enumerate(path.read_text("utf-8").splitlines(), 1) if wrong in t)
    code, _, err = here("run", str(path), "--out", str(tmp_path / "out"))
    assert code == 70
    assert "Traceback" in err
    assert f"{path.name}, line {line}: raised by the experiment's own code" in err


@pytest.mark.slow
def test_an_external_simulator_is_run_anew_once_it_changed(tmp_path: Path) -> None:
    place = tmp_path / "own"
    place.mkdir()
    script, ran = place / "own.py", tmp_path / "ran"
    script.write_text(FAKE.replace("import json, sys", "import json, sys\nprint('ran')\nopen("
                      f"{str(ran)!r}, 'a').write('x')"), "utf-8")  # fmt: skip
    out, program = str(tmp_path / "out"), f"{sys.executable} {script}"
    command = ("run", "hanging_bar", "--quick", "--methods", "hexahedra", "--out", out,
               "--external", program)  # fmt: skip
    for step, count in ((None, 1), (None, 1), ("table.csv", 2), ("own.py", 3)):
        if step:  # a file beside it, or itself
            with (place / step).open("a") as file:
                file.write("# other\n")
        code, _, err = here(*command)
        assert code in (0, 1), err
        assert ran.read_text() == "x" * count


def _heeds_ctrl_c() -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.mark.slow
@pytest.mark.parametrize(("by", "code"), [(signal.SIGKILL, -9), (signal.SIGINT, 130)])
def test_a_run_that_is_stopped_goes_on_where_it_was(
    tmp_path: Path, by: signal.Signals, code: int
) -> None:
    path = pulled(tmp_path)
    trap = f"methods.late.trap=count:{tmp_path}"
    command = [sys.executable, "-m", "validate", "run", str(path), "--out", str(tmp_path / "out")]
    stopped = subprocess.Popen(
        [*command, "--set", trap], stderr=subprocess.PIPE, preexec_fn=_heeds_ctrl_c,
        env={**os.environ, "TRAP_SECONDS": "100"},
    )  # fmt: skip
    end = time.monotonic() + 100
    while not (tmp_path / "runs").exists():
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.02)
    stopped.send_signal(by)
    words = stopped.communicate()[1].decode()
    assert stopped.returncode == code
    if by == signal.SIGINT:
        assert "what was computed is kept; the same command goes on from there" in words
    said = STORED.search(asked(tmp_path, path))
    assert said is not None
    assert said[0].startswith("2 of 4")


def numbers(folder: Path) -> dict[str, Any]:
    """Scores and checks of the run in a folder, without times."""
    (file,) = folder.glob("*/results.json")
    methods = json.loads(file.read_text("utf-8"))["methods"]
    found = {
        f"{m['name']} {s['name']}": s["value"] for m in methods for s in m["scores"]
        if not s["name"].startswith(("step", "setup"))
    }  # fmt: skip
    return found | {f"{m['name']} {c['name']}": c["u_val"] for m in methods for c in m["checks"]}


@pytest.mark.slow
def test_workers_find_the_same_numbers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    collected: list[str] = []
    collect = Drain._collect  # who computed what is nowhere else

    def seen(self: Drain, one: Any, queue: Any) -> bool:
        collected.extend(cell.key for cell in one.batch)
        return collect(self, one, queue)

    monkeypatch.setattr(Drain, "_collect", seen)
    monkeypatch.setattr(execution, "_WORTH", 0.0)
    monkeypatch.setattr(execution, "_PATIENCE", 0.01)
    for workers in ("1", "2"):
        out = str(tmp_path / workers)
        some = ("--quick", "--methods", "fem,kf_printed,kf_load,kf_reduced,roukf,enkf")
        code, _, err = here("run", "kf_cube", *some, "--out", out, "--workers", workers)
        assert code in (0, 1), err
        assert bool(collected) == (workers == "2")
    assert numbers(tmp_path / "1") == numbers(tmp_path / "2")
    assert len(numbers(tmp_path / "1")) > 40
