"""Which experiments there are: their files, and what those call themselves, without running any.

An experiment file is code and loads every library that it needs; a list of all of them is to
appear at once and must not fail with one that is being edited.
"""

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from validate.errors import UsageError


@dataclass(frozen=True)
class Card:
    """An experiment's own words about itself; an empty source where it does not print one."""

    name: str
    title: str
    source: str


def experiment_files(start: Path) -> dict[str, Path]:
    """Experiment name -> file, of the nearest `experiments/` folder from `start` upward.

    Where there is none, those of the installed clone; `UsageError` when that has none either.
    """
    for folder in _folders(start):
        files = {f.stem: f for f in sorted(folder.glob("*.py")) if not f.stem.startswith("_")}
        if files:
            return files
    raise UsageError("no experiments/ folder here or above, and none in the installed clone")


def card(path: Path) -> Card:
    """Name, title and source as the file's `EXPERIMENT = ...` spells them.

    Texts that are computed are unknown without running the file: its docstring's first line is the
    title then, or the reason why there is none.
    """
    try:
        module = ast.parse(path.read_text("utf-8"))
    except (OSError, SyntaxError, ValueError) as error:
        return Card(path.stem, f"cannot be read: {error}", "")
    texts = _spelt(module)
    docstring = (ast.get_docstring(module) or "").partition("\n")[0]
    return Card(path.stem, texts.get("title", docstring), texts.get("source", ""))


def _spelt(module: ast.Module) -> dict[str, str]:
    """Texts given to `EXPERIMENT = Experiment(...)`; those of the file's constants filled in."""
    constants: dict[str, str] = {}
    for node in module.body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            name = node.targets[0].id
            if name == "EXPERIMENT" and isinstance(node.value, ast.Call):
                given = {k.arg: _text(k.value, constants) for k in node.value.keywords}
                return {k: v for k, v in given.items() if k is not None and v is not None}
            if (text := _text(node.value, constants)) is not None:
                constants[name] = text
    return {}


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


def _folders(start: Path) -> Iterator[Path]:
    for folder in (start, *start.parents):
        yield folder / "experiments"
    yield Path(__file__).resolve().parents[1] / "experiments"
