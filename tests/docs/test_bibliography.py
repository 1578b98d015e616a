"""Every source that a docstring cites stands in the bibliography, under the key that it cites."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from tree import ONE_PROCESS, nodes

pytestmark = ONE_PROCESS

NAME = r"[A-Z][\w'’-]+"
CITED = re.compile(
    rf"({NAME}(?:(?:, | & | and ){NAME})*(?: et al\.)?),? \(?((?:18|19|20)\d\d)\b(?!-\d)"
)
PAPER = re.compile(r"paper (00\d)", re.IGNORECASE)
STANDARD = re.compile(r"ASME V&V \d+")


def docstrings(root: Path) -> Iterator[tuple[Path, str]]:
    for path in sorted([*(root / "validate").rglob("*.py"), *(root / "experiments").rglob("*.py")]):
        for node in nodes(path):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
                yield path, " ".join((ast.get_docstring(node, clean=False) or "").split())


def cited(text: str) -> set[str]:
    """Keys as the bibliography prints them."""
    works = {f"{names.replace(' and ', ' & ')} ({year})" for names, year in CITED.findall(text)}
    papers = {f"paper {number}" for number in PAPER.findall(text)}
    return works | papers | set(STANDARD.findall(text))


@pytest.fixture(scope="module")
def keys(project_root: Path) -> set[str]:
    text = (project_root / "docs" / "reference" / "bibliography.md").read_text("utf-8")
    return set(re.findall(r"\*\*(.+?)\*\*", text))


def test_every_citation_is_resolved(project_root: Path, keys: set[str]) -> None:
    found = {(path.name, key) for path, text in docstrings(project_root) for key in cited(text)}
    assert len({key for _, key in found}) > 25
    missing = {(name, key) for name, key in found if not any(k.endswith(key) for k in keys)}
    assert missing == set()


def test_the_five_papers_are_there(keys: set[str]) -> None:
    assert {f"paper 00{n}" for n in range(5)} <= keys


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("after Bonet & Burton (1998), for", "Bonet & Burton (1998)"),
        ("(Burgers et al. 1998).", "Burgers et al. (1998)"),
        ("Source: Umeyama 1991, eqs 40", "Umeyama (1991)"),
        ("Hinton, Rock & Zienkiewicz (1976)", "Hinton, Rock & Zienkiewicz (1976)"),
        ("Paper 003, eq 16", "paper 003"),
    ],
)
def test_what_a_citation_is(text: str, key: str) -> None:
    assert cited(text) == {key}
