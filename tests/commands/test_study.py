"""`validate study filters` on a cluster: folder, terminal, exit codes."""

import csv
import json
import shlex
from contextlib import chdir
from pathlib import Path
from types import SimpleNamespace

import jsonschema
import pytest
from command_line import here
from study_samples import experiment_file

from validate.commands import study as studying
from validate.commands.arguments import BAD_INPUT
from validate.commands.main import run
from validate.pipeline.experiment.find import load_file
from validate.pipeline.experiment.options import Options
from validate.pipeline.run.pipeline import compare
from validate.report.stored.store import schema

# private: _places: called alone, case by case.

SWEEPS = ("--sweep", "methods.kf.Q=1e-13,1e-11,-1", "--sweep", "twin.noise=1e-11,1e-10")
CELLS = 6 + 4  # of the sweep, and two baselines for each of two noises


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the experiment and its finished study."""
    folder = tmp_path_factory.mktemp("study")
    arguments = ["study", "filters", str(experiment_file(folder)), *SWEEPS, "--seeds", "3"]
    with chdir(folder):
        assert run([*arguments, "--workers", "1"]) == 0
    return folder


def swept(made: Path) -> Path:
    """The folder of the study, which says what was swept."""
    (folder,) = (made / "reports" / "pulled").glob("study-filters+methods.kf.Q+twin.noise+seeds-*")
    return folder


@pytest.mark.slow
def test_the_folder_holds_what_a_report_holds(made: Path) -> None:
    folder = swept(made)
    content = json.loads((folder / "results.json").read_text("utf-8"))
    jsonschema.validate(content, schema())
    assert len(list((folder.parent / "study-filters" / "cells").glob("*.json"))) == CELLS
    with (folder / "tables" / "cells.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [bool(r["all.rmse_m"]) for r in rows] == [not r["failed"] for r in rows]
    assert sum("variance Q = -1 m2" in r["failed"] for r in rows) == 2
    assert {p.name for p in (folder / "figures").iterdir()} >= {
        "heat_nis_kf.png", "heat_error_kf.png", "chart_pareto_1.png",
    }  # fmt: skip
    page = (folder / "report.html").read_text("utf-8")
    assert "not distinguishable" in page or "worse" in page
    for best in content["study"]["best"]:
        assert best["command"].startswith("validate run pulled --set twin.noise=1e-1")
        assert best["command"] in page.replace("​", "")


@pytest.mark.slow
def test_the_best_line_is_the_best_cell(made: Path) -> None:
    folder = swept(made)
    told = json.loads((folder / "results.json").read_text("utf-8"))["study"]
    best = told["best"][0]
    words = shlex.split(best["command"])
    values = dict(w.split("=", 1) for w in words if "=" in w)
    noise = values["twin.noise"]
    scored = [c for c in told["cells"] if not c["failed"] and not c["baseline"]]
    cells = [c for c in scored if c["values"]["twin.noise"] == noise]
    first = min(cells, key=lambda c: c["scores"]["all.rmse"]["mean"])
    assert first["values"] == values
    assert words[-2:] == ["--methods", "kf,plain"]
    scores = compare(load_file(made / "experiments" / "pulled.py"), Options(values, ("kf",)))
    rmse = {s.name: s.value for s in scores.methods[0].scores}["top.rmse"]
    found = first["scores"]["top.rmse"]
    assert abs(rmse - found["mean"]) < 3 * found["half_95"]  # one seed of three


@pytest.mark.slow
def test_the_best_line_decides_and_names_what_decides(
    made: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = swept(made)
    told = json.loads((folder / "results.json").read_text("utf-8"))["study"]
    monkeypatch.chdir(made)
    words = shlex.split(told["best"][0]["command"])
    assert run(words[1:]) == 0
    assert "top" in capsys.readouterr().out
    assert run([*words[1:-1], "plain"]) == 1  # no check of its own: nothing is decided


@pytest.mark.slow
def test_a_finished_study_is_not_run_again(
    made: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(made)
    monkeypatch.setattr("validate.engine.cluster.connected", None)  # no cluster is started
    file = str(made / "experiments" / "pulled.py")
    assert run(["study", "filters", file, *SWEEPS, "--seeds", "3", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["study"]
    assert told["reused"] == len(told["cells"]) == CELLS  # failed cells are finished ones


def test_bad_input_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("validate.engine.cluster.CONNECT_S", 0.5)
    file = str(experiment_file(tmp_path))
    for arguments, said in (
        (["--sweep", "methods.kf.QQ=1,2"], "nearest: kf.Q"),
        (["--seeds", "many"], "--seeds many"),
        (["--scheduler", "tcp://127.0.0.1:9"], "no scheduler"),
    ):
        assert run(["study", "filters", file, *arguments]) == BAD_INPUT
        error = capsys.readouterr().err
        assert said in error
        assert error.count("\n") == 1


def test_a_ranking_is_one_screen_with_nis_times_and_front(tmp_path: Path) -> None:
    file = str(experiment_file(tmp_path))
    command = ("study", "filters", file, *SWEEPS, "--seeds", "3", "--workers", "0")
    code, out, _ = here(*command, "--out", str(tmp_path), COLUMNS="80")
    lines = out.splitlines()
    assert code == 0
    assert len(lines) <= 25
    title = next(i for i, line in enumerate(lines) if line.startswith("Ranking by "))
    assert "!: NIS outside its 95 % band; *: on the Pareto front" in lines
    assert lines[title + 1].split()[-1] == "front"
    first = lines[title + 2]
    assert first.strip().startswith("1. ")
    assert any(line.endswith("*") for line in lines[title + 2 :])
    whole = here(*command, "--out", str(tmp_path), "--verbose", COLUMNS="200")[1]
    assert "all columns" in whole
    answer = here(*command, "--out", str(tmp_path), "-q")[1]
    assert answer.count("\n") == 1


def test_a_filter_outside_its_band_is_marked(monkeypatch: pytest.MonkeyPatch) -> None:
    def row(r: str) -> tuple[object, ...]:
        verdict = {"sound": "consistent", "sure": "overconfident: interval not used"}[r]
        front = {"sound": "front", "sure": "#1 beats"}[r]
        return (1, r, "", 0.1, 0.01, "", None, None, "", 2.5, verdict, None, 1.0, 2.0, None, front)

    made = SimpleNamespace(headings=("", "", "", "error / mm"), rows=(row("sound"), row("sure")))
    monkeypatch.setattr(studying, "ranking_table", lambda study, ranking, name: made)
    ranking = SimpleNamespace(rows=[SimpleNamespace(cell=SimpleNamespace(settings={}))])
    found = SimpleNamespace(unit="m", by="all.rmse")
    _, sound, sure = studying._places(ranking, found)  # type: ignore[arg-type]
    assert ("!" in sound, sound.endswith("*")) == (False, True)
    assert ("2.50 !" in sure, sure.endswith("*")) == (True, False)
