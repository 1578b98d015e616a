"""Experiments by name or file; only the requested file is run."""

import ast
import importlib.util
import re
import sys
import traceback
from collections.abc import Sequence
from importlib.machinery import SourceFileLoader
from pathlib import Path
from shlex import quote
from types import CodeType, ModuleType

from validate.catalogue import FILE, card, experiment_files, name_of, searched_folders, shipped
from validate.errors import UsageError, ValidateError
from validate.files import read_text
from validate.parameters import nearest_names
from validate.pipeline.experiment.declaration import completed, from_json, require_paths
from validate.pipeline.experiment.experiment import Experiment

_LARGEST = 16_000_000  # bytes of a declaration as JSON
_KEPT = 8  # experiments of one file
_LOADED: dict[Path, tuple[Experiment, ...]] = {}  # by file


def find(name: str, start: Path, named: Sequence[Path] = ()) -> Experiment:
    """Return the experiment of that name, or of that file when it ends in .py or .json.

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
    found = completed(experiment, path)
    place = path.resolve()
    _LOADED[place] = (found, *_LOADED.get(place, ())[: _KEPT - 1])
    return found


def loaded_from(path: Path) -> tuple[Experiment, ...]:
    """Return the experiments that a file gave this process, the last one first; each load makes
    another one, with functions of its own."""
    return _LOADED.get(path.resolve(), ())


def package_name(path: Path) -> str:
    """Return the name of the package that holds an experiment's modules and their neighbours."""
    return f"validate_experiment_{name_of(path)}"


def module_name(path: Path) -> str:
    """Return the name of the module that an experiment's file is loaded as."""
    return f"{package_name(path)}.{name_of(path)}"


def _executed(path: Path) -> ModuleType:
    # Not by its bare name: a file called random.py would be everybody's module of that name.
    name, file = module_name(path), path.resolve()
    # In a folder of its own it is a package: `from .twin import record` is the file beside it,
    # `from ..other.twin import record` that of the experiment `other` in the next folder, else of
    # the shipped one.
    beside = [str(file.parent)] if path.name == FILE else None
    spec = importlib.util.spec_from_file_location(name, file, submodule_search_locations=beside)
    if spec is None or spec.loader is None:
        raise UsageError(f"{path} cannot be loaded as Python")
    spec.loader = _AsItStands(name, str(file))
    module = importlib.util.module_from_spec(spec)
    package = ModuleType(package_name(path))
    package.__path__ = [str(file.parents[1] if beside else file.parent), str(shipped())]
    _unload(package.__name__)
    sys.modules[package.__name__] = package
    # Dataclasses look their module up by name while they are made.
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        _unload(package.__name__)
        # What is wrong in the words of the library needs no class.
        kind = "" if isinstance(error, ValidateError) else f"{type(error).__name__}: "
        advice = f"correct the file (`python {quote(str(path))}` shows the full traceback)"
        missing = error.name if isinstance(error, ModuleNotFoundError) else None
        if missing and (file.parent / f"{missing}.py").is_file():
            advice = f"a file beside it is imported with a dot: `from .{missing} import ...`"
        raise UsageError(f"{path}{_place(error, path)}: {kind}{error}; {advice}") from error
    return module


class _AsItStands(SourceFileLoader):
    """Runs the text of a file: code that Python keeps of it may be that of another text, as long
    and written in the same second."""

    def get_code(self, fullname: str) -> CodeType:
        path = self.get_filename(fullname)
        return self.source_to_code(self.get_data(path), path)


def _unload(package: str) -> None:
    for name in [n for n in list(sys.modules) if n == package or n.startswith(f"{package}.")]:
        del sys.modules[name]


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
    """Return an experiment's file, those beside it that it names, and those of other experiments'
    folders that it imports from; none of one without a file."""
    if not path.is_file():
        return ()
    if path.suffix == ".json":
        return (path,)
    if path.name == FILE:  # whose folder is its own
        return tuple(dict.fromkeys((path, *_folder_sources(path.parent))))
    text = path.read_text(encoding="utf-8")
    beside = [f for f in sorted(path.parent.glob("*.py")) if f != path and f.stem in text]
    names = re.findall(r"^\s*from \.(\w+)\.", text, re.MULTILINE)
    others = [_neighbour(path.parent, name) for name in names]
    return tuple(dict.fromkeys((path, *beside, *_folder_sources(*others))))


def _folder_sources(*folders: Path) -> list[Path]:
    """The Python files of folders and of the neighbours that any of them imports from."""
    left, read, found = list(folders), set(), []
    while left:
        folder = left.pop(0)
        if folder in read:
            continue
        read.add(folder)
        for file in sorted(folder.glob("*.py")):
            found.append(file)
            names = re.findall(r"^\s*from \.\.(\w+)", file.read_text("utf-8"), re.MULTILINE)
            left += [_neighbour(folder.parent, name) for name in dict.fromkeys(names)]
    return found


def _neighbour(experiments: Path, name: str) -> Path:
    """The folder of another experiment, as its import finds it: of the same place, else shipped."""
    own = experiments / name
    return own if own.is_dir() else shipped() / name
