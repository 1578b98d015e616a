"""One small run and its variation, stored once."""

from pathlib import Path

import pytest
from study_samples import experiment_file

import validate
from validate.library.run_result import RunResult


@pytest.fixture(scope="session")
def pulled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return experiment_file(tmp_path_factory.mktemp("library"))


@pytest.fixture(scope="session")
def reports(pulled: Path) -> Path:
    return pulled.parents[1] / "reports"


@pytest.fixture(scope="module")  # after the figures of the module are blank
def ran(pulled: Path, reports: Path) -> RunResult:
    return validate.run(str(pulled), quick=True, out=str(reports))


@pytest.fixture(scope="module")
def softer(pulled: Path, reports: Path) -> RunResult:
    return validate.run(pulled, {"material.E": 8000.0}, quick=True, out=reports)
