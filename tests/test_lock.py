"""The tested lock names every library by an exact version, and no place that it came from."""

import re
import tomllib
from pathlib import Path

import pytest


@pytest.fixture
def locked(project_root: Path) -> list[str]:
    return (project_root / ".ci" / "constraints.txt").read_text("utf-8").splitlines()


def test_every_line_is_a_library_and_its_version(locked: list[str]) -> None:
    """No index, host, path, hash or option: a line with one does not match."""
    line = re.compile(r"[a-z0-9][a-z0-9.-]*==[0-9][A-Za-z0-9.+]*( ; [a-z_]+ [<>=!]+ [^:/]+)?")
    assert [text for text in locked if not line.fullmatch(text)] == []


def test_every_declared_library_is_locked(locked: list[str], project_root: Path) -> None:
    project = tomllib.loads((project_root / "pyproject.toml").read_text("utf-8"))["project"]
    extras = [line for extra in project["optional-dependencies"].values() for line in extra]
    names = {re.split(r"[<>=\[]", line)[0].lower() for line in (*project["dependencies"], *extras)}
    held = {line.partition("==")[0] for line in locked}
    assert names - held == {project["name"]}
