"""Opening data runs no code: canaries beside the files are never imported by a process of ours."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from canaries import folder, plant, ran
from command_line import here
from engine_samples import Waited, Waiting, logged, open_folder
from test_readers import EACH, files_of, sample

from validate.engine.cell import Plan, Where
from validate.engine.execution import finish
from validate.pipeline.run.job import Job
from validate.recording.reader import Reader
from validate.report.scenes import gl
from validate.solve.external.program import Limits, run_program, words

# private: _opens: called alone, case by case.

__all__ = ["folder"]  # a fixture


@EACH
def test_beside_a_recording(reader: Reader, folder: Path, tmp_path: Path) -> None:
    (tmp_path / "made").mkdir()
    path, _ = sample(reader, tmp_path / "made")
    if path.is_dir():
        shutil.copytree(path, folder / path.name)
    for file in files_of(path) if not path.is_dir() else ():
        shutil.copy(file, folder / file.name)
    here("import", path.name, "-o", "out.mcap", cwd=folder)
    if reader.name == "c3d":  # a look decodes by the same processes
        here("inspect", path.name, cwd=folder)
    assert ran(folder) == ""


def test_beside_an_external_simulator_that_keeps_the_user_s_variables(
    folder: Path, tmp_path: Path
) -> None:
    """Its limits are set by a process that imports nothing of its folder; its own path is its."""
    (tmp_path / "mine").mkdir()
    script = tmp_path / "mine" / "mine.py"
    script.write_text(
        "import os, sys\nprint(os.environ['PYTHONPATH'], os.getcwd(), 'SAFE' in os.environ)\n"
    )
    job = tmp_path / "job"
    job.mkdir()
    plant(job)
    ended = run_program((sys.executable, "-E", str(script)), job, Limits(60.0, 2**33, 2**30))
    assert ended.why == ""
    assert ended.said == f"{folder} {job} False"
    assert ran(folder) == ""
    assert words("python mine.py")[0] == str(Path(sys.executable).absolute())


def test_beside_the_workers_of_a_study(folder: Path, tmp_path: Path) -> None:
    """They start without the user's variables, and give them to what they start in turn."""
    cells = tuple(Waiting(f"c{i}") for i in range(4))
    (tmp_path / "log").mkdir()
    plan = Plan(Job(str(tmp_path / "log"), ""), cells, open_folder, variables, Waited)
    before = dict(os.environ)
    done = finish(plan, tmp_path / "log" / "cells", Where(workers=1))
    assert [r.why for r in done.records.values()] == [""] * 4
    assert {row.pid for row in logged(tmp_path / "log")}.isdisjoint({os.getpid()})
    assert (tmp_path / "log" / "seen").read_text().splitlines() == [f"{folder} ''"] * 4
    assert dict(os.environ) == before
    assert ran(folder) == ""


def variables(place: Path, cell: Waiting) -> Waited:
    with (place / "seen").open("a") as out:
        out.write(f"{os.environ['PYTHONPATH']} {os.environ['PYTHONSAFEPATH']!r}\n")
    with (place / "runs").open("a") as out:
        out.write(f"{cell.key} {os.getpid()} 0 0\n")
    return Waited(os.getpid(), 0.0)


@pytest.mark.slow
def test_beside_the_probe_of_off_screen_rendering(folder: Path) -> None:
    gl._opens("vtkEGLRenderWindow")
    assert ran(folder) == ""


def command(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    without = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
    return subprocess.run(
        arguments, cwd=cwd, env=without, capture_output=True, text=True, timeout=100, check=False
    )


@pytest.mark.slow
def test_the_command_itself_runs_none(folder: Path) -> None:
    np.savez(folder / "points_mm.npz", points=np.zeros((2, 3, 3)))
    validate = str(Path(sys.executable).with_name("validate"))
    assert command(validate, "inspect", "points_mm.npz", cwd=folder).returncode in (0, 2)
    assert ran(folder) == ""


@pytest.mark.slow
def test_run_as_a_module_it_refuses_a_folder_that_shadows_an_import(
    tmp_path: Path, project_root: Path
) -> None:
    python = sys.executable
    assert command(python, "-m", "validate", "--version", cwd=tmp_path).returncode == 0
    assert command(python, "-m", "validate", "--version", cwd=project_root).returncode == 0
    (tmp_path / "notes.py").write_text("x = 1\n")  # nobody's module
    assert command(python, "-m", "validate", "--version", cwd=tmp_path).returncode == 0
    (tmp_path / "ezc3d.py").write_text("raise SystemExit(9)\n")
    (tmp_path / "colorsys").mkdir()
    (tmp_path / "colorsys" / "__init__.py").touch()
    done = command(python, "-m", "validate", "--version", cwd=tmp_path)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith("validate: colorsys, ezc3d.py in ")
    assert line.endswith("run 'validate', or 'python -P -m validate'")
    assert command(python, "-P", "-m", "validate", "--version", cwd=tmp_path).returncode == 0
