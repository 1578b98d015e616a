"""Every run that computes something else has its own folder, and what made it is told."""

import json
from pathlib import Path
from typing import Any

import pytest
from command_line import here
from study_samples import experiment_file

from validate.report import write
from validate.report.stored.folder import MARK

# private: _fill: replaced, to bring a case about.


@pytest.fixture(autouse=True)
def _draws_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages have tests of their own, and take seconds."""

    def fill(result: object, table: object, folder: Path, content: Any, *_: object) -> None:
        write.write_json(content, folder / MARK)

    monkeypatch.setattr(write, "_fill", fill)


@pytest.fixture
def project(tmp_path: Path) -> Path:
    folder = tmp_path / "mein Projekt ü"
    experiment_file(folder)
    return folder


def test_a_changed_run_leaves_the_plain_one(project: Path) -> None:
    assert here("run", "pulled", "--methods", "kf,plain", cwd=project)[0] == 0
    reports = project / "reports"
    plain = (reports / "pulled" / "results.json").read_bytes()
    set_ = ["--set", "methods.kf.Q=2e-11", "--json"]
    code, out, err = here("run", "pulled", *set_, cwd=project)
    assert code in (0, 1), err
    found = json.loads(out)
    assert found["changed"] == [
        {"path": "methods.kf.Q", "default": 1e-11, "value": 2e-11, "unit": "m2"}
    ]
    made = found["made"]
    assert made["command"] == "validate run pulled --set methods.kf.Q=2e-11 --json"
    assert [f["path"] for f in made["files"]] == ["pulled.py"]
    assert (reports / "pulled" / "results.json").read_bytes() == plain
    plain_name, other = sorted(p.name for p in reports.iterdir())
    assert plain_name == "pulled"
    assert other.startswith("pulled+methods.kf.Q-")


def test_several_runs_are_one_document_and_a_failed_one_is_in_it(project: Path) -> None:
    text = (project / "experiments" / "pulled.py").read_text("utf-8")
    broken = text.replace('name="pulled"', 'name="torn"').replace(
        "load=lambda p, folder: (stamped(record(p, lambda _: None), p),),", "load=_torn,"
    )
    broken = broken.replace(
        "EXPERIMENT =",
        "def _torn(p, folder):\n    from validate.errors import RecordingError\n"
        '    raise RecordingError("nothing\\nthere")\n\n\nEXPERIMENT =',
    )
    (project / "experiments" / "torn.py").write_text(broken, "utf-8")
    code, out, err = here("run", "torn", "pulled", "--json", cwd=project)
    failed, done = json.loads(out)
    assert (code, failed) == (2, {"experiment": "torn", "error": "nothing there"})
    assert done["experiment"] == "pulled"
    assert err == "validate: nothing there\n"
    code, out, _ = here("check", "pulled", "torn", "--json", cwd=project)
    assert code == 2
    assert [(c["experiment"], c["holds"]) for c in json.loads(out)] == [
        ("pulled", True), ("torn", False),
    ]  # fmt: skip
    assert here("run", "torn", "--json", cwd=project)[:2] == (2, "")
