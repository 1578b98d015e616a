"""What `pip install .` installs works from any folder, with its experiments and recordings."""

import json
import os
import shutil
import subprocess
import sys
from importlib.metadata import PathDistribution
from pathlib import Path

import pytest

from validate.catalogue import experiment_files, shipped

# Kernels that this clone never ran are compiled in the copy: minutes where the cores are shared.
pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("wheel"), pytest.mark.timeout(600)]


@pytest.fixture(scope="module")
def installed(project_root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The installed package; its libraries are those of the tests, so nothing is downloaded."""
    site = tmp_path_factory.mktemp("site")
    subprocess.run(
        [sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps",
         "--no-build-isolation", "--target", str(site), str(project_root)],
        check=True, timeout=200,
    )  # fmt: skip
    carry_kernels(project_root / "validate", site / "validate")
    return site


def carry_kernels(ours: Path, copy: Path) -> None:
    """Compiled loops, which are those of the same files: numba knows them by size and time."""
    for source in ours.rglob("*.py"):
        if (copied := copy / source.relative_to(ours)).is_file():
            when = source.stat()
            os.utime(copied, ns=(when.st_atime_ns, when.st_mtime_ns))
    for code in ours.rglob("__pycache__/*.nb[ci]"):
        to = copy / code.relative_to(ours)
        to.parent.mkdir(exist_ok=True)
        shutil.copyfile(code, to)


def called(site: Path, cwd: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(site)}
    return subprocess.run(
        [sys.executable, "-m", "validate", *arguments],
        capture_output=True, text=True, cwd=cwd, env=environment, timeout=500,
    )  # fmt: skip


def test_everything_shipped_is_carried(installed: Path, project_root: Path) -> None:
    for folder in ("experiments", "recordings"):
        ours = project_root / folder
        tracked = subprocess.run(
            ["git", "ls-files", "."], cwd=ours, capture_output=True, text=True, check=True
        ).stdout.split()
        assert len(tracked) >= 9
        carried = installed / "validate" / "shipped" / folder
        assert [f for f in tracked if not (carried / f).is_file()] == []
    assert {p.name for p in installed.iterdir()} >= {"validate"}
    assert not {"experiments", "recordings", "tests"} & {p.name for p in installed.iterdir()}


def test_the_python_that_runs_this_is_a_declared_one(installed: Path) -> None:
    found = next(installed.glob("validate_tissue-*.dist-info"))
    metadata = PathDistribution(found).metadata
    assert metadata["Requires-Python"] == ">=3.11"
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    assert f"Programming Language :: Python :: {version}" in metadata.get_all("Classifier", [])


def test_every_shipped_experiment_is_listed_from_an_empty_folder(
    installed: Path, tmp_path: Path
) -> None:
    done = called(installed, tmp_path, "list", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    cards = json.loads(done.stdout)
    assert {c["name"] for c in cards} == set(experiment_files(shipped()))
    assert [c["note"] for c in cards if c["note"]] == []


def test_every_shipped_recording_is_found(installed: Path, tmp_path: Path) -> None:
    """Those of all experiments but the two whose data are made by others and lie elsewhere."""
    script = """
import sys, validate
from pathlib import Path
from validate.catalogue import experiment_files
from validate.pipeline.experiment.find import load_file
print(validate.__file__)
for path in experiment_files(Path.cwd()).values():
    e = load_file(path)
    if e.name not in ("ecoflex_cylinder", "gel_indentation"):
        print(e.name, len(e.load(e.parameters, path.parent)))
"""
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(installed)}, timeout=200,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    home, *lines = done.stdout.splitlines()
    assert home == str(installed / "validate" / "__init__.py")
    assert len(lines) == len(experiment_files(shipped())) - 2
    assert all(int(line.split()[1]) >= 1 for line in lines)


def test_a_run_from_an_empty_folder_reports_there(installed: Path, tmp_path: Path) -> None:
    done = called(installed, tmp_path, "run", "needle_block", "--quick")
    assert done.returncode in (0, 1), done.stderr  # quick: what it finds is tested elsewhere
    assert "report: reports/needle_block" in done.stdout
    assert [p.name for p in tmp_path.iterdir()] == ["reports"]
    assert len(list((tmp_path / "reports").glob("*/report.html"))) == 1


def test_a_check_from_an_empty_folder_holds(installed: Path, tmp_path: Path) -> None:
    done = called(installed, tmp_path, "check", "bending_rod", "--json")
    assert done.returncode == 0, done.stderr
    (found,) = json.loads(done.stdout)
    assert (found["experiment"], found["holds"]) == ("bending_rod", True)
    assert [p.relative_to(tmp_path) for p in tmp_path.glob("*/*")] == [Path("reports/published")]
