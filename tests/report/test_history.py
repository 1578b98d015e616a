"""Replaced runs leave a line; from one run to the next what changed is told by hand-made cases."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from report_samples import small_result

from validate.checksums import sealed
from validate.report import write
from validate.report.export.table_file import CSV, PARQUET
from validate.report.stored.environment import Commit, Made
from validate.report.stored.folder import MARK
from validate.report.stored.history import LINES, current, replaced
from validate.report.stored.run_changes import history, since
from validate.report.write import write_report

# private: _fill: replaced, to bring a case about.

DAYS = [f"2026-11-2{i}T04:00:00+00:00" for i in range(1, 6)]


@pytest.fixture(autouse=True)
def _draws_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def fill(result: object, table: object, folder: Path, content: Any, *_: object) -> None:
        write.write_json(content, folder / MARK)

    monkeypatch.setattr(write, "_fill", fill)


def made(code: str, commit: str = "c" * 40) -> Made:
    return Made("validate run cube", Commit(commit, dirty=False), None, code * 64)


def wrote(folder: Path, day: int, by: Made, **changes: Any) -> Path:
    result = replace(small_result(), **changes)
    return write_report(result, folder, created=DAYS[day], made=by).parent


def test_a_run_made_otherwise_leaves_its_line(tmp_path: Path) -> None:
    folder = wrote(tmp_path / "cube", 0, made("a"))
    assert not (folder / LINES).exists()
    wrote(folder, 1, made("a"))  # all that made it is equal
    assert not (folder / LINES).exists()
    assert replaced(folder, DAYS[1]) is None
    wrote(folder, 2, made("b"))  # other code
    old = replaced(folder, DAYS[2])
    assert old is not None
    assert (old["created"], old["made"]["code_sha256"]) == (DAYS[1], "a" * 64)
    wrote(folder, 3, made("b"), quick=True)  # another run in the same place
    wrote(folder, 4, made("b"), quick=True)
    assert replaced(folder, DAYS[4]) is None
    assert [r.created for r in history(tmp_path, "cube")] == [DAYS[1], DAYS[2], DAYS[4]]


def test_runs_whose_code_is_unknown_are_never_alike(tmp_path: Path) -> None:
    wrote(tmp_path / "cube", 0, Made())
    wrote(tmp_path / "cube", 1, Made())
    assert [r.created for r in history(tmp_path, "cube")] == DAYS[:2]


def test_the_line_of_a_table_is_that_of_the_document(tmp_path: Path) -> None:
    """Digit by digit, whichever of the two a version left."""
    folder = wrote(tmp_path / "cube", 0, made("a"))
    line = current(folder)
    assert line is not None
    checks = [(m.name, c) for m in small_result().methods for c in m.checks]
    assert [(c["method"], c["value"], c["u_num"], c["margin"], c["verdict"], c["raw"])
            for c in line["checks"]] == [
        (name, c.value, c.u_num, c.margin, c.verdict, c.raw) for name, c in checks
    ]  # fmt: skip
    assert current(without_table(folder)) == line


def test_a_report_of_before_has_a_history_too(tmp_path: Path) -> None:
    folder = without_table(wrote(tmp_path / "cube", 0, made("a")))
    content = json.loads((folder / MARK).read_text("utf-8"))
    del content["made"], content["changed"]
    (folder / MARK).write_text(json.dumps(sealed(content)), "utf-8")
    wrote(folder, 1, made("a"))
    first, second = history(tmp_path, "cube")
    assert (first.commit, second.commit) == ("unknown", "cccccccccc")
    assert since(first, second).code == ("unknown", "cccccccccc")


def test_only_the_experiments_own_folders_count(tmp_path: Path) -> None:
    wrote(tmp_path / "cube", 1, made("a"))
    wrote(tmp_path / "cube+quick-123456", 0, made("a"), quick=True)
    wrote(tmp_path / "cube+other", 2, made("a"), name="cube+other")
    wrote(tmp_path / "cubes", 3, made("a"), name="cubes")
    (tmp_path / "cube+empty").mkdir()
    (tmp_path / "cube+file").write_text("", "utf-8")
    found = [(r.folder, r.created) for r in history(tmp_path, "cube")]
    assert found == [("cube+quick-123456", DAYS[0]), ("cube", DAYS[1])]
    assert history(tmp_path, "ball") == ()
    assert history(tmp_path / "nowhere", "cube") == ()


def test_a_line_that_was_edited_or_damaged_is_told_and_left_out(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = wrote(tmp_path / "cube", 0, made("a"))
    wrote(folder, 1, made("b"))
    line = (folder / LINES).read_text("utf-8")
    assert len(history(tmp_path, "cube")) == 2
    edited = line.replace('"passed": true', '"passed": false')
    assert edited != line
    for damage in ("{", '{"experiment": "cube"}', "[]", edited):
        caplog.clear()
        (folder / LINES).write_text(damage, "utf-8")
        assert len(history(tmp_path, "cube")) == 1
        assert "cube/history.jsonl, line 1: ignored" in caplog.text


def without_table(folder: Path) -> Path:
    """The folder as a version before the long table left it."""
    (table,) = (f for f in folder.iterdir() if f.name in (PARQUET, CSV))
    table.unlink()
    return folder


def test_an_edited_result_is_told_and_no_run(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = wrote(tmp_path / "cube", 0, made("a"))
    table = next(f for f in folder.iterdir() if f.name in (PARQUET, CSV))
    table.write_bytes(table.read_bytes()[:-20])
    assert history(tmp_path, "cube") == ()
    assert f"cube/{table.name}: ignored (" in caplog.text
    without_table(folder)
    assert len(history(tmp_path, "cube")) == 1
    text = (folder / MARK).read_text("utf-8")
    (folder / MARK).write_text(text.replace('"quick": false', '"quick": true'), "utf-8")
    assert (folder / MARK).read_text("utf-8") != text
    assert history(tmp_path, "cube") == ()
    assert "cube/results.json: ignored (its content does not match its checksum" in caplog.text


def pair(tmp_path: Path, value: float, *, hashed: str | None = None, u_num: float = 0.01) -> Any:
    """Two runs of a check of E 0.01 N, then `value`, u_num .01 N and u_val .02 N each."""
    one = small_result()
    method = one.methods[0]
    check = replace(method.checks[0], value=value, u_num=u_num)
    recordings = one.recordings
    if hashed:
        first = replace(recordings[0], source=replace(recordings[0].source, sha256=hashed * 64))
        recordings = (first, *recordings[1:])
    wrote(tmp_path / "cube", 0, made("a"))
    methods = (replace(method, checks=(check,)), *one.methods[1:])
    wrote(tmp_path / "cube+x", 1, made("a"), methods=methods, recordings=recordings)
    return since(*history(tmp_path, "cube"))


@pytest.mark.parametrize(
    ("moved", "hashed", "beyond"),
    [
        (0.0, None, False),
        (2 * 2**0.5 * 0.01 - 1e-6, None, False),
        (2 * 2**0.5 * 0.01 + 1e-6, None, True),  # 2 u of both u_num: the noise is shared
        (2 * 2**0.5 * 0.02 - 1e-6, "f", False),  # another recording: all of u_val
        (2 * 2**0.5 * 0.02 + 1e-6, "f", True),
    ],
)
def test_a_check_moves_beyond_the_uncertainty_that_two_runs_do_not_share(
    tmp_path: Path, moved: float, hashed: str | None, *, beyond: bool
) -> None:
    found = pair(tmp_path, 0.01 + moved, hashed=hashed)
    assert len(found.moved) == beyond
    assert found.within == 1 - beyond
    ratio = found.moved[0].ratio if beyond else found.most
    assert ratio == pytest.approx(moved / (2**0.5 * (0.02 if hashed else 0.01)))
    assert bool(found.files) == bool(hashed)


def test_a_check_without_numerical_uncertainty_moved_and_has_no_ratio(tmp_path: Path) -> None:
    one = small_result()
    check = replace(one.methods[0].checks[0], u_num=0.0)
    for i, value in enumerate((0.01, 0.01, 0.0101)):
        methods = (
            replace(one.methods[0], checks=(replace(check, value=value),)), *one.methods[1:],
        )  # fmt: skip
        wrote(tmp_path / f"cube+{i}", i, made("a"), methods=methods)
    runs = history(tmp_path, "cube")
    assert (since(runs[0], runs[1]).within, since(runs[0], runs[1]).most) == (1, 0.0)
    (move,) = since(runs[1], runs[2]).moved
    assert (move.one, move.other, move.ratio) == (0.01, 0.0101, None)


def test_parameters_methods_and_verdict_that_changed(tmp_path: Path) -> None:
    one = small_result()
    wrote(tmp_path / "cube", 0, made("a"))
    e = replace(one.parameters[0], default=1.4e4)
    alone = replace(e, path="methods.stiff.tolerance", default=1e-3, unit="1")
    parameters = (e, *one.parameters[1:], alone)
    wrote(tmp_path / "cube+E", 1, made("a"), parameters=parameters)
    methods = (replace(one.methods[0], checks=()),)
    wrote(tmp_path / "cube+m", 2, made("a"), parameters=parameters[:-1], methods=methods)
    first, second, third = history(tmp_path, "cube")
    found = since(first, second)
    assert found.parameters == {
        "material.E": ("10000 Pa", "14000 Pa"), "methods.stiff.tolerance": ("-", "0.001"),
    }  # fmt: skip
    assert (found.code, found.verdict, found.files) == (None, None, {})
    found = since(second, third)
    assert (found.parameters, found.added, found.left_out) == ({}, (), ("stiff",))
    assert found.verdict is not None
    assert found.verdict[0].startswith("good enough; evidence: 1 of 1")
