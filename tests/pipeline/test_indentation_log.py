"""An indentation log of FElupe's on a compliant machine, through the commands of a user."""

import sys
from pathlib import Path
from types import ModuleType

import pytest
from command_line import called
from script_modules import module_of

from validate.pipeline import run_in_memory
from validate.pipeline.experiment.find import load_file

pytest.importorskip("felupe")
FILE = Path(__file__).parents[2] / "benchmarks" / "indentation_log.py"
SMALL = {"body.cells": "8,2", "seen.states": "10"}


def benchmark() -> ModuleType:
    return module_of(FILE)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_with_the_compliance_the_verdict_is_right_and_without_it_wrong(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    log = benchmark()
    monkeypatch.setattr(sys, "argv", ["indentation_log.py", "-o", "."])
    log.main()
    for name in ("layer", "rigid"):
        read = ("import", f"{name}.csv", "--map", "test=compression", "-o", f"{name}.mcap")
        assert called(*read)[0] == 0
    answers = {}
    for name in ("declared", "unknown"):
        made = ("new", name, "--from", "layer.mcap", "--answers", f"{name}.toml")
        assert called(*made)[0] == 0
        answers[name] = load_file(tmp_path / "experiments" / f"{name}.py")
    right = run_in_memory(answers["declared"], SMALL, quick=True)
    measured = run_in_memory(
        answers["unknown"], {**SMALL, "machine.measured": "../rigid.mcap"}, quick=True
    )
    wrong = run_in_memory(answers["unknown"], SMALL, quick=True)
    for result in (right, measured):
        assert {c.validation for c in result.checks} == {"not distinguishable"}
        assert not result.warnings
    checks = {c.name: c for c in wrong.checks}
    assert checks["force.max@high"].validation == "differs"
    assert wrong.warnings[0].startswith("machine.compliance is not set")
    assert "largest warning: the machine's compliance" in wrong.sentence
