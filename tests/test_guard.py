"""The guard of results: what it reads of a report, what it calls equal, and how it ends."""

import json
from pathlib import Path
from types import ModuleType

import pytest
from click.testing import CliRunner
from script_modules import module_of


@pytest.fixture(scope="module")
def guard(project_root: Path) -> ModuleType:
    path = project_root / "benchmarks" / "guard.py"
    return module_of(path)


def score(name: str, value: float | None, unit: str = "m") -> dict[str, object]:
    return {"name": name, "value": value, "unit": unit}


def report(folder: Path, value: float = 1e-3, *, effects: bool = True) -> Path:
    """A run with a score, two timings, a check, a figure; a study with a table of cells."""
    check = {"name": "tip.rms@all", "value": 1e-4, "u_val": 2e-4, "limit": 1e-3, "unit": "m"}
    figure = {"name": "nodes", "ours": 8.0, "theirs": 9.0, "tolerance": None, "unit": "1"}
    timed = [score("step.p50", 1.0, "s"), score("updates.rate", 3.0, "Hz")]
    method = {
        "name": "fem",
        "scores": [score("tip.rms@all", value), score("tip.bias@all", None), *timed],
        "checks": [check],
        "published": [figure],
    }
    run, study = folder / "run" / "rod", folder / "study" / "rod" / "study-tradeoff"
    for place in (run, study):
        (place / "tables").mkdir(parents=True)
    change = {"name": "contour@3mm", "rms": 1e-4, "max": 2e-4, "unit": "m", "separation": 3.0}
    document = {
        "methods": [method], "published": [], "identified": [],
        "effects": [{"name": "fluid", "changes": [change]}] if effects else [],
    }  # fmt: skip
    (run / "results.json").write_text(json.dumps(document), "utf-8")
    (study / "results.json").write_text("{}", "utf-8")
    (study / "tables" / "cells.csv").write_text(
        "solver,law,element,mesh,dt_s,time_s,error_m,front\nmodal,linear,P2,4,0.01,3e-5,1e-4,True\n"
    )
    return folder


NAMES = {
    "run/rod: fem score tip.rms@all",
    "run/rod: fem check tip.rms@all value",
    "run/rod: fem check tip.rms@all u_val",
    "run/rod: fem check tip.rms@all limit",
    "run/rod: fem published nodes ours",
    "run/rod: fem published nodes theirs",
    "run/rod: effect fluid contour@3mm rms",
    "run/rod: effect fluid contour@3mm max",
    "run/rod: effect fluid contour@3mm separation",
    "study/rod/study-tradeoff: cells [modal, linear, P2, 4, 0.01] error_m",
}


def test_it_holds_every_result_and_no_time(guard: ModuleType, tmp_path: Path) -> None:
    assert set(guard.collect(report(tmp_path))) == NAMES


@pytest.mark.parametrize(
    ("change", "differ"),
    [(1 + 1e-9, 1), (1 + 1e-11, 0), (float("nan"), 1)],
)
def test_equal_is_within_the_tenth_digit(
    guard: ModuleType, tmp_path: Path, change: float, differ: int
) -> None:
    a = guard.collect(report(tmp_path / "a"))
    b = guard.collect(report(tmp_path / "b", value=1e-3 * change))
    assert len(guard.compared(a, b).differ) == differ


def test_roundoff_of_what_is_nearly_zero_is_of_its_quantity_s_scale(guard: ModuleType) -> None:
    scale = guard.Entry(2.0, "tip", "m")
    a = {"large": scale, "small": guard.Entry(1e-14, "tip", "m")}
    within = {"large": scale, "small": guard.Entry(1.9e-12, "tip", "m")}
    other = {"large": scale, "small": guard.Entry(1.9e-12, "tip", "N")}
    assert guard.compared(a, within).differ == ()
    assert guard.compared({"small": a["small"]}, {"small": within["small"]}).differ == ("small",)
    assert guard.compared(a, {**other, "small": guard.Entry(3e-12, "tip", "m")}).differ == (
        "small",
    )


def test_words_differ_when_they_are_not_the_same(guard: ModuleType) -> None:
    a, b = guard.Entry("stable", "regime", ""), guard.Entry("unstable", "regime", "")
    assert guard.compared({"x": a}, {"x": b}).differ == ("x",)


def stored(guard: ModuleType, folder: Path) -> str:
    out = folder.with_suffix(".json")
    assert CliRunner().invoke(guard.main, ["collect", str(folder), "-o", str(out)]).exit_code == 0
    return str(out)


def test_it_ends_with_1_on_a_difference_and_on_what_is_missing(
    guard: ModuleType, tmp_path: Path
) -> None:
    first = stored(guard, report(tmp_path / "a"))
    moved = stored(guard, report(tmp_path / "b", value=2e-3))
    less = report(tmp_path / "c", effects=False)
    ends = {
        other: CliRunner().invoke(guard.main, ["compare", first, other])
        for other in (first, moved, stored(guard, less))
    }
    assert [done.exit_code for done in ends.values()] == [0, 1, 1]
    last = [done.output.splitlines()[-1] for done in ends.values()]
    assert last == [
        "10 equal, 0 differ, 0 missing, 0 new, 0 intended",
        "9 equal, 1 differ, 0 missing, 0 new, 0 intended",
        "7 equal, 0 differ, 3 missing, 0 new, 0 intended",
    ]


def test_what_was_renamed_on_purpose_is_compared_under_its_new_name(
    guard: ModuleType, tmp_path: Path
) -> None:
    a, b = tmp_path / "a.json", tmp_path / "b.json"
    guard.write({"run/rod: fem score tip.rms": guard.Entry(1.0, "tip", "m")}, a)
    guard.write({"run/rod: plain_fem score tip.rms": guard.Entry(1.0, "tip", "m")}, b)
    names = tmp_path / "renames"
    compare = ["compare", str(a), str(b)]
    assert CliRunner().invoke(guard.main, compare).exit_code == 1
    names.write_text("fem plain_fem\n", "utf-8")
    assert CliRunner().invoke(guard.main, [*compare, "--renames", str(names)]).exit_code == 0


def test_a_folder_without_a_report_is_refused(guard: ModuleType, tmp_path: Path) -> None:
    done = CliRunner().invoke(guard.main, ["collect", str(tmp_path), "-o", str(tmp_path / "x")])
    assert done.exit_code == 2
    assert "no report" in done.output


def test_it_makes_every_experiment_and_every_kind_of_study(guard: ModuleType) -> None:
    made = list(guard.commands(Path("out"), quick_studies=True))
    assert made[0][:2] == ["run", "--all"]
    assert {arguments[1] for arguments in made[1:]} == {
        "stability", "tradeoff", "choose", "filters",
    }  # fmt: skip
    assert all("--quick" in arguments for arguments in made[1:])


def test_a_quick_make_runs_every_experiment_and_no_study(guard: ModuleType) -> None:
    assert list(guard.commands(Path("out"), quick_studies=False, quick=True)) == [
        ["run", "--all", "--quick", "--out", "out/run"]
    ]
    done = CliRunner().invoke(guard.main, ["make", "out", "--quick", "--quick-studies"])
    assert done.exit_code == 2
    assert "no studies" in done.output


def quick_report(folder: Path, settings: str, value: float = 1e-3) -> Path:
    run = report(folder, value) / "run" / "rod"
    run.rename(run.with_name(f"rod+quick-{settings}"))
    return folder


def test_quick_runs_are_compared_by_experiment_and_never_with_full_ones(
    guard: ModuleType, tmp_path: Path
) -> None:
    """The folder's hash of settings is no part of a name."""
    first = stored(guard, quick_report(tmp_path / "a", "3fa2c1"))
    same = stored(guard, quick_report(tmp_path / "b", "8ab12c"))
    moved = stored(guard, quick_report(tmp_path / "c", "3fa2c1", value=2e-3))
    full = stored(guard, report(tmp_path / "d"))
    assert "run/rod+quick: fem score tip.rms@all" in guard.read(Path(first))
    ends = [CliRunner().invoke(guard.main, ["compare", first, x]) for x in (same, moved, full)]
    assert [done.exit_code for done in ends] == [0, 1, 2]
    assert f"{first} holds quick runs" in " ".join(ends[-1].output.split())


TIP = "run/rod: fem score tip.rms@all"


def compared_with(
    guard: ModuleType, folder: Path, intended: str, value: float = 2e-3
) -> tuple[int, list[str]]:
    """Exit code and lines of a comparison in which the score went from 1 mm to `value` m."""
    first = stored(guard, report(folder / "a", value=1e-3))
    second = stored(guard, report(folder / "b", value=value))
    listed = folder / "intended.toml"
    listed.write_text(intended, "utf-8")
    done = CliRunner().invoke(guard.main, ["compare", first, second, "--intended", str(listed)])
    return done.exit_code, done.output.splitlines()


def entry(name: str, values: str = "") -> str:
    return f"[[intended]]\nname = '{name}'\n{values}\nreason = 'finer mesh'\n"


@pytest.mark.parametrize(
    ("listed", "code"),
    [
        (entry(TIP, "old = 1e-3\nnew = 2.0001e-3"), 0),
        (entry("run/rod: * score tip.rms*"), 0),
        (entry(TIP, "old = 1e-3"), 0),
        (entry(TIP, "old = 1e-3\nnew = 2.001e-3"), 1),
        (entry(TIP, "old = 2e-3\nnew = 1e-3"), 1),
        (entry("run/rod: fem score tip"), 1),
        (entry(TIP, "new = nan"), 1),
        (entry(TIP, "old = 2e-3"), 1),
        ("", 1),
    ],
)
def test_a_listed_change_is_no_failure_where_name_and_values_agree(
    guard: ModuleType, tmp_path: Path, listed: str, code: int
) -> None:
    done, lines = compared_with(guard, tmp_path, listed)
    assert done == code
    known = f"intended {TIP}: 0.001 | 0.002 (finer mesh)"
    assert (known in lines) == (code == 0)
    assert (f"differs  {TIP}: 0.001 | 0.002" in lines) == (code == 1)
    assert any(line.startswith("listed, not seen") for line in lines) == (
        code == 1 and listed != ""
    )
    assert lines[-1].endswith(f"{code} differ, 0 missing, 0 new, {1 - code} intended")


def test_a_listed_change_that_did_not_come_is_reported_and_no_failure(
    guard: ModuleType, tmp_path: Path
) -> None:
    done, lines = compared_with(guard, tmp_path, entry(TIP), value=1e-3)
    assert (done, lines[0]) == (0, f"listed, not seen {TIP} (finer mesh)")


def test_a_row_of_a_table_is_listed_by_its_printed_name(guard: ModuleType) -> None:
    change = guard.Intended("x: cells [modal, 4] error_m", "finer mesh", new="unstable")
    assert change.covers("x: cells [modal, 4] error_m", "stable", "unstable")
    assert not change.covers("x: cells [modal, 4] error_m", "unstable", "stable")
    assert not change.covers("x: cells m error_m", "stable", "unstable")


@pytest.mark.parametrize(
    ("listed", "words"),
    [
        ("[[intended]]\nname = 'x'\n", "entry 1: reason = None"),
        (entry("x", "valu = 2"), "entry 1: valu: use name"),
        (entry("x", "old = [1, 2]"), r"entry 1: old = \[1, 2\]: write a number"),
        ("name = 'x'", r"tables \[\[intended\]\] only"),
        ("[[intended", "correct the file"),
    ],
)
def test_a_list_that_cannot_be_read_is_refused(
    guard: ModuleType, tmp_path: Path, listed: str, words: str
) -> None:
    path = tmp_path / "intended.toml"
    path.write_text(listed, "utf-8")
    with pytest.raises(Exception, match=words):
        guard.read_intended(path)


def test_the_committed_list_can_be_read(guard: ModuleType) -> None:
    assert isinstance(guard.read_intended(guard.INTENDED), tuple)
