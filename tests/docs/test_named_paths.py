"""Dotted names of the code and files that the documentation mentions exist."""

import re
from pathlib import Path
from pkgutil import resolve_name
from types import ModuleType

import pytest

from validate.plugins import KINDS

DOTTED = re.compile(r"`(validate(?:\.\w+)+)")
FILES = re.compile(r"`((?:validate|tests|experiments|benchmarks|docs)/[\w./]+\.(?:py|md))`")


def pages(root: Path) -> list[Path]:
    return [root / "README.md", root / "CONTRIBUTING.md", *sorted((root / "docs").rglob("*.md"))]


def test_names_of_the_code_exist(project_root: Path) -> None:
    named = {n for page in pages(project_root) for n in DOTTED.findall(page.read_text("utf-8"))}
    assert len(named) >= 4
    for name in named - {f"validate.{kind}" for kind in KINDS}:  # groups of entry points
        assert resolve_name(name) is not None


def of_layers(root: Path, text: str) -> list[str]:
    """Names in backticks that begin with a layer, as the architecture page writes them."""
    parts = (root / "validate").iterdir()
    layers = {p.stem for p in parts if p.suffix in ("", ".py") and p.stem[0] != "_"}
    named = re.findall(r"`(\w+(?:\.\w+)+)`", text)
    return [n for n in named if n.split(".")[0] in layers]


def test_names_of_the_architecture_page_exist(project_root: Path) -> None:
    text = (project_root / "docs" / "developers" / "architecture.md").read_text("utf-8")
    named = set(of_layers(project_root, text))
    assert len(named) >= 120
    for name in sorted(named):
        assert resolve_name(f"validate.{name}") is not None


def test_walks_count_their_files(project_root: Path) -> None:
    text = (project_root / "docs" / "developers" / "architecture.md").read_text("utf-8")
    walks = re.findall(r"\n### [^\n]*\((\d+) files\)\n\n(.*?)(?=\n##)", text, flags=re.DOTALL)
    assert len(walks) == 5
    for count, steps in walks:
        named = [of_layers(project_root, line)[0] for line in steps.splitlines() if line.strip()]
        assert len({module_of(n) for n in named}) == int(count)


def module_of(name: str) -> str:
    """The module that defines a name."""
    part = f"validate.{name}"
    while not isinstance(resolve_name(part), ModuleType):
        part = part.rpartition(".")[0]
    return part


def test_files_exist(project_root: Path) -> None:
    named = {n for page in pages(project_root) for n in FILES.findall(page.read_text("utf-8"))}

    named -= {
        "experiments/my_gel.py",
        "experiments/gel.py",
        "experiments/NAME.py",
        "experiments/NAME/experiment.py",
        "validate/commands/NAME.py",
    }  # the reader writes them
    missing = [n for n in named if not (project_root / n).is_file()]
    assert missing == []


def test_pages_that_the_code_names_exist(project_root: Path) -> None:
    """Messages and docstrings send a reader to them."""
    folders = [project_root / name for name in ("validate", "experiments", "benchmarks", "tests")]
    named = {
        name
        for folder in folders
        for file in folder.rglob("*.py")
        for name in re.findall(
            r"(?<![\w/])docs/[\w/-]+\.(?:md|csv|svg|png|py)\b", file.read_text("utf-8")
        )
    }
    assert len(named) > 10
    assert [name for name in sorted(named) if not (project_root / name).is_file()] == []


def test_links_of_pages_outside_the_documentation_exist(project_root: Path) -> None:
    """Sphinx tests the links inside it."""
    outside = [*project_root.glob("*.md"), *(project_root / "experiments").rglob("*.md")]
    links = [
        page.parent / link
        for page in outside
        for link in re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", page.read_text("utf-8"))
    ]
    assert len(links) > 20
    assert [link for link in links if not link.exists()] == []


def test_a_name_that_is_gone_would_be_seen() -> None:
    with pytest.raises((AttributeError, ModuleNotFoundError)):
        resolve_name("validate.recording.nothing_of_the_sort")
