"""The tables of a paper's page hold every figure that the experiments of that paper declare."""

import re
from pathlib import Path
from types import ModuleType

import pytest
from script_modules import module_of

from validate.compare.published import Figure
from validate.pipeline import load


@pytest.fixture(scope="module")
def script(project_root: Path) -> ModuleType:
    path = project_root / "benchmarks" / "paper_table.py"
    return module_of(path)


PICTURES = {"paper-000": 10, "paper-001": 5, "paper-002": 11, "paper-003": 7, "paper-004": 8}
SECTIONS = {
    "paper-000": {2, 3, 4, 5, 6},
    "paper-001": {0, 2, 3},
    "paper-002": {3, 4, 5, 6, 7},
    "paper-003": {2, 3},
    "paper-004": {1, 4, 5, 6},
}


def rows_between(script: ModuleType, page: str, begin: str, end: str) -> list[list[str]]:
    text = script.path(page).read_text("utf-8")
    between = text.split(begin)[1].split(end)[0].strip().splitlines()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in between]


def page_rows(script: ModuleType, page: str) -> list[list[str]]:
    """Of printed results."""
    return rows_between(script, page, script.BEGIN, script.END)


def settings(script: ModuleType, page: str) -> list[tuple[str, str]]:
    """Settings, sketches and citations, each with its experiment."""
    rows = rows_between(script, page, script.SETTINGS_BEGIN, script.SETTINGS_END)
    return [(line, name) for _, lines, name in rows[2:] for line in lines.split("<br>")]


def declared(script: ModuleType, page: str) -> list[tuple[str, Figure]]:
    return [(f"`{name}`", f) for name in script.PAGES[page] for f in load(name).published]


def is_result(f: Figure) -> bool:
    return not f.setting and (f.theirs is not None or f.claim != "not comparable")


def test_every_page_is_tested(script: ModuleType) -> None:
    assert script.PAGES.keys() == PICTURES.keys() == SECTIONS.keys()


@pytest.mark.parametrize("page", PICTURES)
def test_the_page_has_every_printed_result_and_no_other(script: ModuleType, page: str) -> None:
    """What they print and what we claim; ours are of the run that wrote the page."""
    results = sorted(
        (f.source, f.name, script.shown(f.theirs, f.unit), f.claim, name)
        for name, f in declared(script, page)
        if is_result(f)
    )
    written = sorted((r[0], r[1], r[2], r[4], r[6]) for r in page_rows(script, page)[2:])
    assert written == results, f"run benchmarks/paper_table.py DIR {page} --write anew"


@pytest.mark.parametrize("page", PICTURES)
def test_the_page_has_every_setting_and_no_other(script: ModuleType, page: str) -> None:
    expected = sorted(
        (script.entry((f.source, f.name, script.shown(f.theirs, f.unit), "-")), name)
        for name, f in declared(script, page)
        if not is_result(f)
    )
    written = sorted(
        (re.sub(r" \(ours [^)]*\)$", "", line), name) for line, name in settings(script, page)
    )
    assert written == expected, f"run benchmarks/paper_table.py DIR {page} --write anew"


@pytest.mark.parametrize("page", PICTURES)
def test_it_is_read_as_the_paper_is(script: ModuleType, page: str) -> None:
    head, _, *rows = page_rows(script, page)
    assert tuple(head) == script.HEAD
    places = [script.place(r[0]) for r in rows]
    assert places == sorted(places)
    sources = [*(r[0] for r in rows), *(line for line, _ in settings(script, page))]
    assert {int(script.place(source)[0]) for source in sources} == SECTIONS[page]


@pytest.mark.parametrize("page", PICTURES)
def test_what_is_computed_has_a_number_and_what_is_not_says_why(
    script: ModuleType, page: str
) -> None:
    for _, name, _, ours, verdict, why, _ in page_rows(script, page)[2:]:
        assert why, name
        assert verdict != "reproduced" or ours != "-", name


@pytest.mark.parametrize("page", PICTURES)
def test_every_picture_of_the_paper_is_named(script: ModuleType, page: str) -> None:
    lines = [f"{r[0]} {r[1]}" for r in page_rows(script, page)]
    text = " ".join([*lines, *(line for line, _ in settings(script, page))])
    named = {int(n) for first in re.findall(r"Figs?\. ([\d, and]+)", text)
             for n in re.findall(r"\d+", first)}  # fmt: skip
    assert named >= set(range(1, PICTURES[page] + 1))


def test_the_results_page_gives_the_same_verdicts(script: ModuleType, project_root: Path) -> None:
    """Rows of its table of printed figures that a page has, too."""
    page = (project_root / "docs" / "explanation" / "results.md").read_text("utf-8")
    text = page.split("<!-- printed: begin -->")[1].split("<!-- printed: end -->")[0]
    rows = [[c.strip() for c in line.strip("|").split("|")] for line in text.strip().splitlines()]
    paged = {f"{r[6]}: {r[1]}": r[4] for page in PICTURES for r in page_rows(script, page)[2:]}
    shared = [(row[0], row[3].split(" (within")[0]) for row in rows[2:] if row[0] in paged]
    assert len(shared) >= 3
    assert [verdict for _, verdict in shared] == [paged[what] for what, _ in shared]
