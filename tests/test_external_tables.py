"""The tables of external simulators: what they are made by, and that they are today's."""

import json
import re
import shutil
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

import pytest
from command_line import here
from script_modules import module_of

from validate.compare.result import Result
from validate.numbers import significant
from validate.pipeline import load


def script(root: Path, name: str) -> ModuleType:
    return module_of(root / "benchmarks" / f"{name}.py")


@pytest.fixture(scope="module")
def rates(project_root: Path) -> ModuleType:
    return script(project_root, "external_rates")


@pytest.fixture(scope="module")
def table(project_root: Path) -> ModuleType:
    return script(project_root, "external_table")


def cells(root: Path, module: ModuleType) -> list[list[str]]:
    page = (root / "docs" / "explanation" / "results.md").read_text("utf-8")
    text = page.split(module.BEGIN)[1].split(module.END)[0]
    return [[c.strip() for c in line.strip("|").split("|")] for line in text.strip().splitlines()]


def test_at_an_error_stands_the_least_time_on_a_line_of_one_kind(rates: ModuleType) -> None:
    points = [
        rates.Point("ours", "a 1", 10, 1e-1, 1.0),
        rates.Point("ours", "a 2", 20, 1e-3, 100.0),
        rates.Point("ours", "b 1", 15, 5e-3, 15.0),
        rates.Point("other", "a 1", 10, 1e-4, 3.0),
        rates.Point("other", "a 2", 20, 2e-2, 9.0),
    ]
    assert rates.at_error(points, "ours", 1e-2) == (pytest.approx(10.0), "a")
    assert rates.at_error(points, "ours", 5e-3) == (15.0, "b")
    assert rates.at_error(points, "ours", 1e-4) is None
    assert rates.at_error(points, "other", 1e-3) is None  # near by accident: a finer one is not
    assert rates.at_error(points, "other", 5e-2) == (3.0, "a")
    (row,) = rates.rows("bar", points, (5e-2,))
    assert row == ["bar", "5 %", f"{significant(2000.0)} (a)", *["-"] * len(rates.SIMULATORS)]


def test_the_rates_name_the_cells_that_were_tried_and_no_winner(
    project_root: Path, rates: ModuleType
) -> None:
    head, _, *rows = cells(project_root, rates)
    assert head == rates.head()
    assert head[2:] == [
        "ours, ms: hex8, tet10, hex27", "FElupe: hex8, tet10", "CalculiX: hex8, tet10",
        "MuJoCo: tet4",
    ]  # fmt: skip
    assert {row[0] for row in rows} == {"beam at rest", "hanging bar", "beam let go"}
    for row in rows:
        assert len(row) == len(head)
        for column, cell in zip(head[2:], row[2:], strict=True):
            kind = re.fullmatch(r"[\d\s.]+ \((\w+)(?:/\d)?\)", cell)
            assert cell == "-" or (kind and kind[1] in column.partition(": ")[2].split(", "))


def test_a_row_is_called_as_its_experiment_calls_the_method(
    project_root: Path, shared_data: Path, table: ModuleType
) -> None:
    printed = cells(project_root, table)[2:]
    for one in table.judged():
        own = load(one.name).methods
        named = [r[2] for r in printed if r[0] == f"`{one.name}` {one.called}".strip()]
        assert named
        for name in named:
            assert any(name == (label := own[key].label) or name.startswith(f"{label} (")
                       for key in one.methods), name  # fmt: skip


@pytest.mark.parametrize(
    ("name", "method", "cells"),
    [
        # each cut into six linear tetrahedra
        pytest.param("silicone_beam", "mujoco", "hex8", marks=pytest.mark.slow),
        pytest.param("ecoflex_cylinder", "felupe", "tet10", marks=pytest.mark.slow),
        pytest.param("ecoflex_cylinder", "calculix", "tet10", marks=pytest.mark.slow),
        pytest.param("ecoflex_cylinder", "mujoco", "tet4", marks=pytest.mark.slow),
        ("hanging_bar", "mujoco", "tet4"),
    ],
)
def test_a_label_names_the_nodes_that_are_solved(
    shared_data: Path, tmp_path: Path, name: str, method: str, cells: str
) -> None:
    code, _, error = here("external", "job", name, "-o", str(tmp_path / "j"), "--method", method)
    assert code == 0, error
    mesh = json.loads((tmp_path / "j" / "job.json").read_text("utf-8"))["mesh"]
    assert mesh["kind"] == cells
    assert f" tetrahedra, {mesh['nodes']} nodes" in load(name).methods[method].label


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.skipif(find_spec("felupe") is None, reason="felupe absent: the extra 'peers' has it")
@pytest.mark.skipif(find_spec("mujoco") is None, reason="mujoco absent: the extra 'peers' has it")
@pytest.mark.skipif(shutil.which("ccx") is None, reason="ccx absent: apt-get calculix-ccx")
def test_errors_and_verdicts_are_todays(
    project_root: Path, shared_data: Path, table: ModuleType, whole: Callable[[str], Result]
) -> None:
    """Of all but the beam under its mass: all but the last two columns, which are timings."""
    head, _, *printed = cells(project_root, table)
    assert tuple(head) == table.HEAD
    shown = [one for one in table.judged() if not one.values and one.name != "silicone_beam"]
    for one in shown:
        every = set(one.methods) == set(load(one.name).methods)
        result: Result = whole(one.name) if every else table.run(one)
        today = [row[:-2] for row in table.rows_of(one, result)]
        rows = [row[:-2] for row in printed if row[0] == f"`{one.name}`"]
        assert sorted(rows) == sorted(today)  # a shared run has the methods in its own order
