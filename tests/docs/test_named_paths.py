"""Dotted names of the code and files that the documentation mentions exist."""

import re
from pathlib import Path
from pkgutil import resolve_name

import pytest

from validate.plugins import KINDS

DOTTED = re.compile(r"`(validate(?:\.\w+)+)")
FILES = re.compile(r"`((?:validate|tests|experiments|benchmarks|docs)/[\w./]+\.(?:py|md))`")


def pages(root: Path) -> list[Path]:
    return [root / "README.md", root / "CONTRIBUTING.md", *sorted((root / "docs").glob("*.md"))]


def test_names_of_the_code_exist(project_root: Path) -> None:
    named = {n for page in pages(project_root) for n in DOTTED.findall(page.read_text("utf-8"))}
    assert len(named) >= 4
    for name in named - {f"validate.{kind}" for kind in KINDS}:  # groups of entry points
        assert resolve_name(name) is not None


def test_files_exist(project_root: Path) -> None:
    named = {n for page in pages(project_root) for n in FILES.findall(page.read_text("utf-8"))}

    named -= {
        "experiments/my_gel.py",
        "experiments/gel.py",
        "experiments/NAME/experiment.py",
    }  # the reader writes them
    missing = [n for n in named if not (project_root / n).is_file()]
    assert missing == []


def test_a_name_that_is_gone_would_be_seen() -> None:
    with pytest.raises((AttributeError, ModuleNotFoundError)):
        resolve_name("validate.recording.nothing_of_the_sort")
