"""The fluid phantom by its two cheapest methods, compared once: its tests are one group."""

import pytest

from validate.compare.result import Result
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.options import Options
from validate.pipeline.run.pipeline import compare


@pytest.fixture(scope="session")
def result(phantom: Experiment) -> Result:
    return compare(phantom, Options({}, methods=("p1_fluid", "p1_dry")))
