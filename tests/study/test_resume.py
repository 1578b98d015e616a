"""A study on a real cluster: killed in the middle it goes on, and nothing finished runs again."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from study_samples import experiment_file

from validate.study.filters.study import study

VALUES = 12
BASELINES = 2  # the filter given nothing, the last measurement held
DECLARED = 1e-11  # Q of the filter as it is declared
SWEEP = "methods.kf.Q=log:1e-14:1e-9:12"


@pytest.mark.slow
def test_a_killed_study_goes_on_without_repeating_cells(tmp_path: Path) -> None:
    file, out = experiment_file(tmp_path), tmp_path / "reports"
    arguments = ["study", "filters", str(file), "--sweep", SWEEP, "--seeds", "2"]
    arguments += ["--set", f"methods.kf.trap=count:{tmp_path}", "--out", str(out), "--json"]
    command = [sys.executable, "-m", "validate", *arguments]
    cells = out / "pulled" / "study-filters" / "cells"
    killed = subprocess.Popen(
        command, env={**os.environ, "TRAP_SECONDS": "0.5"}, stdout=subprocess.DEVNULL
    )
    _wait(lambda: len(list(cells.glob("*.json"))) >= 3)
    killed.send_signal(signal.SIGKILL)
    killed.wait()
    stored = [json.loads(f.read_text("utf-8"))["cell"] for f in cells.glob("*.json")]
    kept = {float(dict(c["settings"])["methods.kf.Q"]) for c in stored if not c["baseline"]}
    assert 3 <= len(stored) < VALUES
    (tmp_path / "runs").rename(tmp_path / "runs-before")
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    lines = (tmp_path / "runs").read_text("utf-8").splitlines()
    again = [q for line in lines if (q := float(line)) != DECLARED]  # that of the baseline
    assert not kept & set(again)
    assert len(again) == len(set(again)) == VALUES - len(kept)
    told = json.loads(done.stdout)["study"]
    assert told["reused"] == len(stored)
    assert all(c["failed"] is None for c in told["cells"])
    assert len(told["cells"]) == VALUES + BASELINES


@pytest.mark.slow
def test_a_cell_that_kills_its_worker_is_a_row_and_the_others_finish(tmp_path: Path) -> None:
    file, out = experiment_file(tmp_path), tmp_path / "reports"
    sweep = ["methods.kf.Q=log:1e-13:1e-9:5"]
    found = study(str(file), sweep, values={"methods.kf.trap": "die"}, seeds=2, out=out)
    cell, why = next(f for f in found.rankings[0].failed if f[0].values["methods.kf.Q"] == "1e-09")
    assert cell.values == {"methods.kf.Q": "1e-09"}
    assert "its worker process died" in why
    assert len(found.rankings[0].rows) == 4 + BASELINES
    kept = list((out / "pulled" / "study-filters" / "cells").glob("*.json"))
    assert len(kept) == 4 + BASELINES  # another try may have more memory


def _wait(holds: object, limit: float = 100.0) -> None:
    """Until a condition on the file system holds."""
    end = time.monotonic() + limit
    while not holds():  # type: ignore[operator]
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.02)
