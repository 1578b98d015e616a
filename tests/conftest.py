"""Shared fixtures: where real recordings lie, this clone's own files, long runs made once.

Tests run in one process a core. Those that share a long run are given to one of them, first of
all; the others go file by file, so that what a module prepares is prepared once. Drawing is most
of what a command does on a small body: only tests of reports look at figures, all others have
blank ones.
"""

import contextlib
import gc
import io
import json
import os
import resource
import shutil
import subprocess
import sys
import warnings

# Where Python may not keep its code, every process compiles the package and the tests anew: two
# seconds a command, a third of collection. Before the tests are imported.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# Before numpy is loaded: several processes of several threads each would quarrel over the cores.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

os.environ.setdefault("VALIDATE_WORKERS", "1")  # of `run`: the tests themselves run side by side

from collections.abc import Callable, Generator, Iterator
from functools import cache
from importlib.metadata import version
from itertools import count
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

ROOT = Path(__file__).resolve().parents[1]
if (_data := ROOT.parent / "shared" / "data").is_dir():  # found by tests is found by what they test
    os.environ.setdefault("VALIDATE_SHARED_DATA", str(_data))

import pytest
from hypothesis import settings

if TYPE_CHECKING:  # the process that hands tests out would take a second to import what none runs
    from validate.compare.result import Result
    from validate.pipeline.experiment.experiment import Experiment

# private: _ended, _decode: the process between them is what `decoded_here` leaves out.

LONG_RUNS = ("phantom_result", "whole")
LONG = {"phantom_result", "cheap"}  # fixtures that take tens of seconds: so do their tests
# Groups that take minutes begin first: a short one ends each process.
FIRST = (*LONG_RUNS, "test_help.py", "examples of studies", "test_site.py", "tree",
         "test_plugins.py")  # fmt: skip
# The same examples each time, and no test judges the time that it takes.
settings.register_profile("validate", deadline=None, derandomize=True, max_examples=50)
settings.load_profile("validate")
BLANK = ("commands", "engine", "experiments", "library", "pipeline", "study",  # no figure is read
         "test_browser.py", "test_exhibits.py", "test_history.py", "test_long_table.py",
         "test_page.py", "test_page_data.py", "test_paraview.py", "test_printed_figures.py",
         "test_store.py", "test_views.py", "test_write.py")  # fmt: skip
_NUMBERS = count()  # of folders


def pytest_configure(config: pytest.Config) -> None:
    config.option.loadscopereorder = False  # xdist would begin with groups of many short tests


@pytest.hookimpl(tryfirst=True)  # before xdist reads the groups
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        shared = next((name for name in LONG_RUNS if name in item.fixturenames), "")
        if LONG & set(item.fixturenames):
            item.add_marker(pytest.mark.slow)
        if item.get_closest_marker("xdist_group") is None:
            item.add_marker(pytest.mark.xdist_group(shared or item.path.name))
    rank = {name: k for k, name in enumerate(FIRST)}
    items.sort(key=lambda item: rank.get(_group(item), len(rank)))


def _group(item: pytest.Item) -> str:
    marker = item.get_closest_marker("xdist_group")
    return str(marker.args[0]) if marker else ""


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Thousands of tests are no garbage: looking for it among them takes a third of the time."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.fixture(scope="session", autouse=True)
def _machine_stays() -> Iterator[None]:
    """Files of tests need not outlive a loss of power, and packages stay as they are installed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda descriptor: None)
        patch.setattr("validate.report.stored.environment.version", cache(version))
        yield


@pytest.fixture
def tmp_path(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Path]:
    """A folder of a test's own, removed where the test passes. That of pytest looks at the folders
    of all tests before it, and keeps all for the next run to remove."""
    before = request.session.testsfailed
    path = tmp_path_factory.getbasetemp() / f"{request.node.originalname[:30]}_{next(_NUMBERS)}"
    path.mkdir()
    yield path
    if request.session.testsfailed == before:
        shutil.rmtree(path, ignore_errors=True)


@cache
def _drawn() -> Any:
    """How figures are drawn; asked first before they are blank."""
    from matplotlib.figure import Figure

    return Figure.draw


@pytest.fixture(scope="module", autouse=True)
def _blank_figures(request: pytest.FixtureRequest) -> Iterator[None]:
    """Figures are composed, but not drawn, in folders and files where no test reads one."""
    _drawn()
    from matplotlib.figure import Figure

    with pytest.MonkeyPatch.context() as patch:
        if {request.path.parent.name, request.path.name} & set(BLANK):
            patch.setattr(Figure, "draw", lambda figure, renderer: None)
            patch.setenv("VALIDATE_NO_GL", "1")
        yield


@pytest.fixture
def decoded_here(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Files are decoded in this process and without limits, for tests of what a file says.

    Tests marked `own_process`, and those of every format in `test_nothing_beside_is_run`, show the
    process that decodes a user's files."""
    if request.node.get_closest_marker("own_process"):
        return
    from validate.recording.formats import subprocess_decoder as module

    free = SimpleNamespace(**{**vars(resource), "setrlimit": lambda *limits: None})

    def ended(decoder: str, path: Path, out: Path, given: Any, least: int) -> Any:
        told = io.StringIO()
        with contextlib.redirect_stdout(told), warnings.catch_warnings(action="ignore"):
            code = module._decode(decoder, path.absolute(), out, "[0, 0]", json.dumps(dict(given)))
        return subprocess.CompletedProcess((), code, told.getvalue().encode())

    monkeypatch.setattr(module, "_ended", ended)
    monkeypatch.setattr(module, "resource", free)


@pytest.fixture
def one_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures are not even composed, which is half of a small run: for tests that write reports
    again and again."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(0.1, 0.1))
    FigureCanvasAgg(figure).draw()
    monkeypatch.setattr("validate.report.charts.style.painted", lambda *_, **__: figure)


@pytest.fixture
def drawn_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures as a user has them, for a test that reads one in such a folder."""
    monkeypatch.setattr("matplotlib.figure.Figure.draw", _drawn())
    monkeypatch.delenv("VALIDATE_NO_GL", raising=False)


@pytest.fixture(scope="session")
def project_root() -> Path:
    return ROOT


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real recordings made by others; skips where it is absent."""
    folder = Path(os.environ.get("VALIDATE_SHARED_DATA") or ROOT.parent / "shared" / "data")
    if not folder.is_dir():
        pytest.skip(f"real data absent: {folder} (set VALIDATE_SHARED_DATA)")
    return folder


@pytest.fixture(scope="session")
def phantom(project_root: Path) -> "Experiment":
    from validate.pipeline.experiment.find import find

    return find("fluid_phantom", project_root)


@pytest.fixture(scope="session")
def phantom_result(phantom: "Experiment") -> "Result":
    """The whole fluid phantom, all methods, as `validate run fluid_phantom` compares it."""
    from validate.pipeline.experiment.options import Options
    from validate.pipeline.run.pipeline import compare

    return compare(phantom, Options({}))


@pytest.fixture(scope="session")
def whole(project_root: Path) -> "Callable[[str], Result]":
    """A whole experiment, as `validate run` compares it: minutes, once a session."""
    from validate.pipeline.experiment.find import find
    from validate.pipeline.experiment.options import Options
    from validate.pipeline.run.pipeline import compare

    @cache
    def run(name: str) -> "Result":
        return compare(find(name, project_root), Options({}))

    return run
