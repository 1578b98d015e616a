"""docs/reference/capabilities.md: a command reaches every scheme, filter and part of a scene."""

import re
from pathlib import Path
from typing import get_args, get_type_hints

import pytest

from validate.catalogue import experiment_files
from validate.commands.main import cli
from validate.estimate.filters import FILTERS
from validate.scene import contact
from validate.scene.meshless import MaterialPoint, RigidBody
from validate.scene.scene import Scene
from validate.solve.schemes import SCHEMES, SOLVERS

ROOT = Path(__file__).parents[2]
ROWS = [
    [cell.strip().strip("`") for cell in line.strip("| \n").split("|")]
    for line in (ROOT / "docs" / "reference" / "capabilities.md").read_text("utf-8").splitlines()
    if line.startswith("| `")
]
DECLARING = (
    "experiments/", "validate/pipeline/", "validate/study/",
    "validate/commands/questions/", "validate/scene/contact.py",
)  # fmt: skip


def parts_of_a_scene() -> set[str]:
    """Classes of which a scene holds tuples, and the shapes that touch."""
    found = {
        each.__name__
        for hint in get_type_hints(Scene).values()
        for arg in get_args(hint) if arg is not Ellipsis
        for each in (get_args(arg) or (arg,))
        if isinstance(each, type) and each.__module__.startswith("validate.scene")
    }  # fmt: skip
    shapes = {n for n in vars(contact) if n.startswith("Rigid")}
    return found | shapes | {MaterialPoint.__name__, RigidBody.__name__}


def test_every_class_has_one_row() -> None:
    known = {c.__name__ for c in (*SCHEMES, *SOLVERS, *FILTERS)} | parts_of_a_scene()
    named = [row[0] for row in ROWS]
    assert len(set(named)) == len(named)
    assert set(named) == known


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_a_row_is_true(row: list[str]) -> None:
    name, commands, declaration, test = row
    assert declaration.startswith(DECLARING)
    for path in (declaration, test):
        made = rf"\b{name}\b[(,)]|\b{name}\.|= {name}$"
        assert re.search(made, (ROOT / path).read_text("utf-8"), re.MULTILINE), path
    for command in re.sub(r" \(.*?\)", "", commands).split(", "):
        words = command.split()
        assert words[0] in cli.commands, command
        if words[0] == "run":
            assert words[1] in experiment_files(ROOT)
