"""Shared fixtures: where real recordings lie, and a folder of this clone's own files."""

import os
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from validate.compare.result import Result
from validate.replay.experiment import Experiment
from validate.replay.find import load_file
from validate.replay.options import Options
from validate.replay.road import compare

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def project_root() -> Path:
    return ROOT


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real recordings made by others; skips where it is absent."""
    named = os.environ.get("VALIDATE_SHARED_DATA")
    folder = Path(named) if named else ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"real data absent: {folder} (set VALIDATE_SHARED_DATA)")
    return folder


@pytest.fixture(scope="session")
def phantom(project_root: Path) -> Experiment:
    return load_file(project_root / "experiments" / "fluid_phantom.py")


@pytest.fixture(scope="session")
def phantom_result(phantom: Experiment) -> Result:
    """The whole fluid phantom, all methods, as `validate run fluid_phantom` compares it."""
    return compare(phantom, Options({}))


@pytest.fixture(scope="session")
def whole(project_root: Path) -> Callable[[str], Result]:
    """A whole experiment over time, as `validate run` compares it: minutes, once a session."""

    @cache
    def run(name: str) -> Result:
        return compare(load_file(project_root / "experiments" / f"{name}.py"), Options({}))

    return run
