"""Child processes in Python's isolated mode, without imports from the current folder.

Python puts the current folder, or that of a script, first on its path, so that a `json.py` beside
a recording would be run. Every interpreter that this package starts gets a clean environment
(`clean_environment`), the safe path of Python 3.11, and a folder of its own as current folder.
"""

import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

ROOT = str(Path(__file__).resolve().parents[1])  # of the package that runs
_PREFIX, _SAFE = "PYTHON", "PYTHONSAFEPATH"
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_TEMPORARY = ("TMPDIR", "TMP", "TEMP")
_START = (
    "import runpy, sys; sys.path.append({root!r}); "
    "runpy.run_module({module!r}, run_name='__main__', alter_sys=True)"
)


def clean_environment(folder: Path | None = None) -> dict[str, str]:
    """Return the user's variables without Python's own, with a safe path and one thread.

    `folder` is where temporary files go: they vanish with it, also those of a child that is killed.
    """
    kept = {name: value for name, value in os.environ.items() if not name.startswith(_PREFIX)}
    places = {} if folder is None else dict.fromkeys(_TEMPORARY, str(folder))
    return {**kept, **dict.fromkeys(_THREADS, "1"), **places, _SAFE: "1"}


@contextmanager
def isolating_environment() -> Iterator[None]:
    """Make this process's own environment a clean one, for a library that starts interpreters."""
    before = dict(os.environ)
    try:
        _replace(clean_environment())
        yield
    finally:
        _replace(before)


def users_variables() -> dict[str, str]:
    """Return what such a child sets once it has started, so that programs that *it* starts for the
    user see the user's own variables."""
    theirs = {name: value for name, value in os.environ.items() if name.startswith(_PREFIX)}
    return {_SAFE: "", **theirs}  # Python takes an empty value for none


def _replace(variables: Mapping[str, str]) -> None:
    for name in set(os.environ) - set(variables):
        del os.environ[name]
    os.environ.update(variables)


def python(*arguments: str) -> list[str]:
    """Return the command line of this interpreter in safe-path mode."""
    return [sys.executable, "-P", *arguments]


def python_module(module: str, *arguments: str) -> list[str]:
    """Return the command line that runs a module of this package with `arguments`.

    The package is found where this process has it, behind all that is installed.
    """
    return python("-c", _START.format(root=ROOT, module=module), *arguments)
