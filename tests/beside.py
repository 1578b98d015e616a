"""The modules that lie beside a shipped experiment's declaration."""

import sys
from functools import cache
from importlib import import_module
from types import ModuleType
from typing import Any

from validate.catalogue import experiment_files, shipped
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import load_file, module_name


@cache
def _loaded(name: str) -> tuple[Experiment, dict[str, ModuleType]]:
    """A shipped experiment and what it imported: another load of the file makes other modules."""
    found = load_file(experiment_files(shipped().parent)[name])
    assert found.path is not None
    package = f"{module_name(found.path)}."
    own = {m.removeprefix(package): sys.modules[m] for m in sys.modules if m.startswith(package)}
    return found, own


def experiment(name: str) -> Experiment:
    """A shipped experiment, loaded once: its classes are then one."""
    return _loaded(name)[0]


def beside(name: str, module: str) -> Any:
    """experiments/NAME/MODULE.py, as the loaded experiment has it."""
    found, own = _loaded(name)
    if module not in own:
        assert found.path is not None
        own[module] = import_module(f"{module_name(found.path)}.{module}")
    return own[module]
