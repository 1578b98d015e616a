"""README.md and the pages that it points to are tested from their text."""

import re
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest
from click.testing import CliRunner
from script_modules import module_of

from validate.catalogue import experiment_files
from validate.commands.main import cli
from validate.compare.result import Result


@pytest.fixture(scope="module")
def readme(project_root: Path) -> str:
    return (project_root / "README.md").read_text("utf-8")


@pytest.fixture(scope="module")
def commands(project_root: Path) -> str:
    return (project_root / "docs" / "reference" / "commands.md").read_text("utf-8")


@pytest.fixture(scope="module")
def script(project_root: Path) -> ModuleType:
    path = project_root / "benchmarks" / "readme_table.py"
    return module_of(path)


def test_its_first_two_shell_blocks_are_one_line_each(readme: str) -> None:
    blocks = re.findall(r"```sh\n(.*?)```", readme, flags=re.DOTALL)
    assert len(blocks) == 2
    assert all(block.count("\n") == 1 for block in blocks)
    assert "validate run fluid_phantom" in blocks[0]
    assert "pytest" in blocks[1]


def test_its_table_is_todays_run_but_for_the_rates(
    readme: str, script: ModuleType, phantom_result: Result
) -> None:
    text = readme.split(script.BEGIN)[1].split(script.END)[0]
    cells = [[c.strip() for c in line.strip("|").split("|")] for line in text.strip().splitlines()]
    printed = cells[2:-1]
    assert [row[:-1] for row in printed] == [row[:-1] for row in script.rows(phantom_result)]
    assert all(float(row[-1]) > 0 for row in printed)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_its_tables_of_filters_are_todays_runs(
    project_root: Path, script: ModuleType, whole: Callable[[str], Result]
) -> None:
    """All but the last column of the filters' table, which is a timing."""
    page = (project_root / "docs" / "explanation" / "results.md").read_text("utf-8")
    results = {name: whole(name) for name in script.PRINTED}
    ours = [row[:-1] for row in script.filter_rows(results["kf_cube"])]
    assert [row[:-1] for row in _cells(page, "filters")] == ours
    assert _cells(page, "printed") == script.printed_rows(results)


def _cells(page: str, name: str) -> list[list[str]]:
    text = page.split(f"<!-- {name}: begin -->")[1].split(f"<!-- {name}: end -->")[0]
    lines = text.strip().splitlines()[2:]
    return [[c.strip() for c in line.strip("|").split("|")] for line in lines]


def test_the_readme_is_short_and_has_one_small_table_before_the_tour(readme: str) -> None:
    assert len(readme.splitlines()) <= 150
    before = readme.split("## Five minutes")[0]
    assert sum(line.startswith("|") for line in before.splitlines()) - 2 <= 10


def test_its_parameters_exist(commands: str) -> None:
    listed = "".join(
        CliRunner().invoke(cli, ["list", name, "--json"]).output
        for name in ("fluid_phantom", "ecoflex_cylinder", "kf_cube")
    )
    for path in re.findall(r"`--set ([\w.]+)=", commands):
        if path != "PATH":
            assert f'"path": "{path}"' in listed, path


def test_its_pictures_are_there_and_small(readme: str, project_root: Path) -> None:
    pictures = re.findall(r"!\[.+?\]\((.+?)\)", readme)
    assert len(pictures) == 1
    assert 0 < (project_root / pictures[0]).stat().st_size < 500_000


def test_every_shipped_experiment_has_a_row_with_its_exit_code(project_root: Path) -> None:
    """`benchmarks/exit_codes.py` runs them and holds each to its row."""
    table = (project_root / "docs" / "reference" / "experiments.md").read_text("utf-8")
    rows = re.findall(r"^\| `(\w+)` \|.*\| ([01]) \|$", table, re.M)
    assert sorted(name for name, _ in rows) == sorted(experiment_files(project_root))
