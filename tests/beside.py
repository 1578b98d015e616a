"""The modules that lie beside a shipped experiment's declaration."""

import sys
from functools import cache
from importlib import import_module
from typing import Any

from validate.catalogue import experiment_files, shipped
from validate.replay.experiment import Experiment
from validate.replay.find import load_file, module_name


@cache
def experiment(name: str) -> Experiment:
    """A shipped experiment, loaded once: its classes are then one."""
    return load_file(experiment_files(shipped().parent)[name])


def beside(name: str, module: str) -> Any:
    """experiments/NAME/MODULE.py."""
    path = experiment(name).path
    assert path is not None
    package = module_name(path)
    return sys.modules.get(f"{package}.{module}") or import_module(f"{package}.{module}")
