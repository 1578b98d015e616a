"""Catalogue of experiments: names and titles, read without running their files.

An experiment file is code and loads every library that it needs; a list of all of them is to
appear at once and must not fail with one that is being edited.
"""

import ast
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.machinery import PathFinder
from pathlib import Path

from validate.errors import UsageError
from validate.plugins import PlugIn, left_out, plug_ins

_PACKAGE = Path(__file__).resolve().parent
FILE = "experiment.py"  # of an experiment in a folder of its own
_PROJECT = (".git", "pyproject.toml")  # what the top folder of a project holds


@dataclass(frozen=True)
class Card:
    """An experiment's own words about itself; an empty source where it does not print one.

    `needs` names the public data set that it runs on; empty: none. `note` says why a file cannot be
    an experiment; empty for one that can.
    """

    name: str
    title: str
    source: str
    note: str = ""
    needs: str = ""


def experiment_files(start: Path, named: Sequence[Path] = ()) -> dict[str, Path]:
    """Experiment name -> file: those of plug-ins, the shipped ones and those of the project around
    `start`, of the `experiments/` in `start` itself and of the `named` folders.

    Of two with one name the later of these is meant. No other folder is looked at. Raises
    `UsageError` for a named folder without a file that could be an experiment.
    """
    for folder in named:
        if not _files(folder.resolve()):
            raise UsageError(f"--experiments {folder}: no experiment file (*.py) in this folder")
    found = {name_of(f): f for folder in searched_folders(start, named) for f in _files(folder)}
    # Warn of experiments of plug-ins whose names others have.
    for plug_in in plug_ins("experiments"):
        own = folder_of_experiments(plug_in)
        for file in _files(own) if own else ():
            if found[name_of(file)] != file:
                left_out(plug_in, f"another experiment is called '{name_of(file)}'")
    if not found:
        raise UsageError(
            "no experiments/ folder here or in this project; give one with --experiments DIR"
        )
    return found


def searched_folders(start: Path, named: Sequence[Path] = ()) -> tuple[Path, ...]:
    """The folders that experiments are looked for in; of two with one name the later is meant."""
    plugged = {plug_in: folder_of_experiments(plug_in) for plug_in in plug_ins("experiments")}
    for plug_in, folder in plugged.items():
        if folder is None:
            left_out(plug_in, f"there is no folder {plug_in.value}")
    of_plug_ins = (folder for folder in plugged.values() if folder is not None)
    own = (folder / "experiments" for folder in (_project(start), start))
    further = (folder.resolve() for folder in named)
    return tuple(dict.fromkeys((*of_plug_ins, shipped(), *own, *further)))


def folder_of_experiments(plug_in: PlugIn) -> Path | None:
    """The folder of a plug-in's `PACKAGE.FOLDER`, found without running any of it; None where there
    is none."""
    top, *inner = plug_in.value.split(".")
    spec = PathFinder.find_spec(top)
    places = (spec.submodule_search_locations if spec else None) or ()
    folders = (Path(place, *inner) for place in places)
    return next((folder for folder in folders if folder.is_dir()), None)


def reports_of(path: Path | None, out: Path | None) -> Path:
    """The folder of all reports, for the experiment of that file: `out` where it is given."""
    return out or root_of(path, Path.cwd()) / "reports"


def root_of(path: Path | None, start: Path) -> Path:
    """The project an experiment's file belongs to where `start` lies in it, else `start`: nothing
    is written where nobody looks."""
    tops = path.parents[:3] if path else ()
    folder = next((top for top in tops if top.name == "experiments"), None)
    return folder.parent if folder and start.is_relative_to(folder.parent) else start


def shipped() -> Path:
    """The folder of the experiments that come with the package: in its wheel, else in its clone."""
    carried = _PACKAGE / "shipped" / "experiments"
    return carried if carried.is_dir() else _PACKAGE.parent / "experiments"


def _project(start: Path) -> Path:
    tops = (f for f in (start, *start.parents) if any((f / name).exists() for name in _PROJECT))
    return next(tops, start)


def name_of(path: Path) -> str:
    """The name of the experiment that is declared in a file: the file's own, or its folder's."""
    return path.resolve().parent.name if path.name == FILE else path.stem


def _files(folder: Path) -> list[Path]:
    """NAME.py, and experiment.py in folders."""
    found = [*folder.glob("*.py"), *folder.glob(f"*/{FILE}")]
    return sorted((f for f in found if not name_of(f).startswith("_")), key=name_of)


def card(path: Path) -> Card:
    """Name, title and source as the file's `EXPERIMENT = ...` spells them.

    Texts that are computed are unknown without running the file: its docstring's first line is the
    title then.
    """
    try:
        module = ast.parse(path.read_text("utf-8"), path.name)
    except (OSError, SyntaxError, ValueError, RecursionError, MemoryError) as error:
        return Card(name_of(path), "", "", f"cannot be read: {error}")
    if not any(_names_experiment(node) for node in ast.walk(module)):
        return Card(name_of(path), "", "", "defines no EXPERIMENT")
    if any(k.arg == "parameters" for call in _declarations(module) for k in call.keywords):
        return Card(name_of(path), "", "", f"declares `parameters` in place of a scene, as older "
                    f"files did; write it anew: `validate new {name_of(path)} --from RECORDING "
                    "--force`")  # fmt: skip
    # Texts given to `EXPERIMENT = Experiment(...)`; those of the file's constants filled in.
    texts, constants = dict[str, str](), dict[str, str]()
    for node in module.body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            name = node.targets[0].id
            if name == "EXPERIMENT" and isinstance(node.value, ast.Call):
                given = {k.arg: _text(k.value, constants) for k in node.value.keywords}
                texts = {k: v for k, v in given.items() if k is not None and v is not None}
                break
            if (text := _text(node.value, constants)) is not None:
                constants[name] = text
    docstring = (ast.get_docstring(module) or "").partition("\n")[0]
    title, needs = texts.get("title", docstring), texts.get("needs", "")
    return Card(name_of(path), title, texts.get("source", ""), needs=needs)


def _names_experiment(node: ast.AST) -> bool:
    """Whether something is called EXPERIMENT here, or names are imported that nobody lists."""
    if isinstance(node, ast.alias):
        return (node.asname or node.name) in ("EXPERIMENT", "*")
    return isinstance(node, ast.Name) and node.id == "EXPERIMENT"


def _declarations(module: ast.Module) -> list[ast.Call]:
    """`EXPERIMENT = Experiment(...)`."""
    return [
        node.value for node in module.body
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Call)
        and isinstance(node.targets[0], ast.Name) and node.targets[0].id == "EXPERIMENT"
    ]  # fmt: skip


def _text(node: ast.expr, constants: dict[str, str]) -> str | None:
    """A literal text, the name of one, or an f-string of such; None for anything else."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.Name):
        return constants.get(node.id)
    if isinstance(node, ast.FormattedValue):
        return _text(node.value, constants)
    if isinstance(node, ast.JoinedStr):
        parts = [_text(part, constants) for part in node.values]
        return None if None in parts else "".join(part or "" for part in parts)
    return None
