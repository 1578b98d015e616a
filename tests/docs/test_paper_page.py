"""The table of docs/paper-000.md holds every figure that the experiments of paper 000 declare."""

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

from validate.replay import load


@pytest.fixture(scope="module")
def script(project_root: Path) -> ModuleType:
    path = project_root / "benchmarks" / "paper_table.py"
    spec = importlib.util.spec_from_file_location("paper_table", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def page_rows(script: ModuleType) -> list[list[str]]:
    text = script.PAGE.read_text("utf-8")
    between = text.split(script.BEGIN)[1].split(script.END)[0].strip().splitlines()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in between]


def test_the_page_has_every_declared_figure_and_no_other(script: ModuleType) -> None:
    """What they print and what we claim; ours are of the run that wrote the page."""
    declared = sorted(
        (f.source, f.name, script.shown(f.theirs, f.unit), f.claim, f"`{name}`")
        for name in script.EXPERIMENTS
        for f in load(name).published
    )
    written = sorted((r[0], r[1], r[2], r[4], r[6]) for r in page_rows(script)[2:])
    assert written == declared, "run benchmarks/paper_table.py anew"


def test_it_is_read_as_the_paper_is(script: ModuleType) -> None:
    head, _, *rows = page_rows(script)
    assert tuple(head) == script.HEAD
    places = [script.place(r[0]) for r in rows]
    assert places == sorted(places)
    assert {int(section) for section, _ in places} == {2, 3, 4, 5, 6}


def test_what_is_computed_has_a_number_and_what_is_not_says_why(script: ModuleType) -> None:
    for _, name, _, ours, verdict, why, _ in page_rows(script)[2:]:
        assert why, name
        assert verdict != "reproduced" or ours != "-", name


@pytest.mark.parametrize("picture", range(1, 11))
def test_every_picture_of_the_paper_is_named(script: ModuleType, picture: int) -> None:
    said = " ".join(f"{r[0]} {r[1]}" for r in page_rows(script))
    assert f"Fig. {picture}" in said or f"Figs. {picture}" in said
