"""Shipped experiments import the listed public API and their neighbours: a user's own can do the
same."""

import ast
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest
from script_modules import module_of
from tree import nodes


@pytest.fixture(scope="module")
def public(project_root: Path) -> frozenset[str]:
    reference: ModuleType = module_of(project_root / "docs" / "reference_page.py")
    return frozenset(f"{module}.{name}" for module, name in reference.public())


def imported(path: Path) -> Iterator[str]:
    """Names of the package that a file imports, with their modules; at any depth of the file."""
    for node in nodes(path):
        if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def unlisted(path: Path, public: frozenset[str]) -> set[str]:
    ours = {name for name in imported(path) if name.partition(".")[0] == "validate"}
    return {name.removeprefix("validate.") for name in ours - public}


def test_shipped_experiments_import_listed_names_only(
    project_root: Path, public: frozenset[str]
) -> None:
    root = project_root / "experiments"
    found = {
        path.relative_to(root).as_posix(): sorted(names)
        for path in sorted(root.rglob("*.py"))
        if (names := unlisted(path, public))
    }
    assert found == {}


def test_an_import_beyond_the_list_is_found(tmp_path: Path, public: frozenset[str]) -> None:
    path = tmp_path / "experiment.py"
    path.write_text(
        "import numpy as np\nimport validate.checksums\nfrom .twin import record\n"
        "from validate.scene.geometries.specification import Box\n\n\ndef f():\n"
        "    from validate.scene.geometries.specification import Unlisted\n"
    )
    assert unlisted(path, public) == {"checksums", "scene.geometries.specification.Unlisted"}
