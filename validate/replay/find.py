"""Experiments by name or by file: the one that is asked for is run, and only that."""

import ast
import importlib.util
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path
from shlex import quote
from types import ModuleType

from validate.catalogue import FILE, card, experiment_files, name_of, searched_folders
from validate.errors import UsageError, ValidateError
from validate.files import read_text
from validate.parameters import nearest_names
from validate.replay.completed import completed
from validate.replay.declaration import from_json
from validate.replay.declared_paths import require_paths
from validate.replay.experiment import Experiment

_LARGEST = 16_000_000  # bytes of a declaration as JSON


def find(name: str, start: Path, named: Sequence[Path] = ()) -> Experiment:
    """The experiment of that name, or of that file when it ends in .py or .json.

    Names are looked for as `experiment_files` says. Raises `UsageError` naming the nearest ones
    when there is none.
    """
    if name.endswith((".py", ".json")):
        return load_file(Path(name))
    files = experiment_files(start, named)
    if name not in files:
        from validate.recording.readers import told_apart  # all formats: only where needed

        if said := told_apart(Path(name)):
            raise UsageError(said)
        near = nearest_names(name, set(files))
        places = ", ".join(str(p) for p in searched_folders(start, named))
        raise UsageError(f"unknown experiment '{name}'; {near}; searched: {places}")
    return load_file(files[name])


def load_file(path: Path) -> Experiment:
    """Runs an experiment file (it is code) and returns its EXPERIMENT, which knows its path.

    Of a declaration as JSON, which is data, nothing is executed.
    Raises `UsageError` with line and reason for a file that fails, and before anything of it is
    run for one that is no Python or defines none.
    """
    if not path.is_file():
        raise UsageError(f"no experiment file {path}")
    if path.suffix == ".json":
        return from_json(read_text(path, _LARGEST), path)
    if note := card(path).note:
        raise UsageError(f"{path}: {note}")
    experiment = getattr(_executed(path), "EXPERIMENT", None)
    if not isinstance(experiment, Experiment):
        raise UsageError(f"{path} defines no EXPERIMENT of type Experiment")
    if experiment.name != name_of(path):
        of = "folder" if path.name == FILE else "file"
        raise UsageError(f"{path}: EXPERIMENT.name is '{experiment.name}', not the {of}'s name")
    require_paths(experiment, path)
    return completed(experiment, path)


def module_name(path: Path) -> str:
    """The name of the module that an experiment's file is loaded as."""
    return f"validate_experiment_{name_of(path)}"


def _executed(path: Path) -> ModuleType:
    # Not by its bare name: a file called random.py would be everybody's module of that name.
    name = module_name(path)
    # In a folder of its own it is a package: `from .twin import record` is the file beside it.
    beside = [str(path.resolve().parent)] if path.name == FILE else None
    spec = importlib.util.spec_from_file_location(
        name, path.resolve(), submodule_search_locations=beside
    )
    if spec is None or spec.loader is None:
        raise UsageError(f"{path} cannot be loaded as Python")
    module = importlib.util.module_from_spec(spec)
    # Dataclasses look their module up by name while they are made.
    for own in [known for known in sys.modules if known.startswith(f"{name}.")]:
        del sys.modules[own]
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        raise UsageError(
            f"{path}{_place(error, path)}: {_kind(error)}{error}; correct the file "
            f"(`python {quote(str(path))}` shows the full traceback)"
        ) from error
    return module


def _kind(error: BaseException) -> str:
    """What is wrong in the words of the library, which need no class; else the class."""
    return "" if isinstance(error, ValidateError) else f"{type(error).__name__}: "


def _place(error: BaseException, path: Path) -> str:
    """The file's own line that failed, whatever lies below it; "" where there is none."""
    own = str(path.resolve())
    lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == own]
    if not lines or lines[-1] is None:
        return ""
    within = _declared_at(path, lines[-1])
    return f", line {lines[-1]}" + (f", {within}" if within else "")


def _declared_at(path: Path, line: int) -> str:
    """The path of the declaration that a line belongs to: `material`, `methods.fem`."""
    names: list[tuple[int, str]] = []
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        pairs = [(node.arg, node.value)] if isinstance(node, ast.keyword) else []
        if isinstance(node, ast.Dict):
            pairs = [(k.value, v) for k, v in zip(node.keys, node.values, strict=True)
                     if isinstance(k, ast.Constant) and isinstance(k.value, str)]  # fmt: skip
        names += [
            (value.lineno, name) for name, value in pairs
            if name and value.lineno <= line <= (value.end_lineno or value.lineno)
            and any(isinstance(n, ast.Call) for n in ast.walk(value))  # no number has parts
        ]  # fmt: skip
    return ".".join(name for _, name in sorted(names, key=lambda n: n[0])
                    if name not in ("scene", "settings", "parameters"))  # fmt: skip


def sources_of(path: Path) -> tuple[Path, ...]:
    """An experiment's file and those beside it that it names."""
    if path.suffix == ".json":
        return (path,)
    text = path.read_text(encoding="utf-8")
    whole = path.name == FILE  # whose folder is its own
    beside = (
        f for f in sorted(path.parent.glob("*.py")) if f != path and (whole or f.stem in text)
    )
    return (path, *beside)


def root_of(path: Path | None, start: Path) -> Path:
    """The project an experiment's file belongs to where `start` lies in it, else `start`: nothing
    is written where nobody looks."""
    tops = path.parents[:3] if path else ()
    folder = next((top for top in tops if top.name == "experiments"), None)
    return folder.parent if folder and start.is_relative_to(folder.parent) else start
