"""The answer of a command on one screen: what fits, bars, one line for scripts, closed pipes."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import here, refused
from hypothesis import given
from hypothesis import strategies as st
from report_samples import CHECK, small_result

from validate.commands.display import say
from validate.commands.inspect import _passages
from validate.commands.recordings import _besides
from validate.commands.run_screen import show_run
from validate.commands.screen import (
    LINES,
    Passage,
    check_passages,
    fitted,
    rows,
    sentences,
    show,
    worst_first,
)
from validate.compare.exhibit import Exhibit, NumberTable
from validate.compare.score import Score
from validate.recording.preflight import Inspection, Topic
from validate.recording.types import Recording, Source
from validate.report.stored.store import check_members
from validate.report.views.bars import bar

# private: _besides, _passages: called alone, case by case.

PAGE = Path("report.html")


@given(st.lists(st.tuples(st.integers(0, 40), st.integers(0, 4)), max_size=6))
def test_blocks_share_a_screen_and_count_what_is_left_out(sizes: list[tuple[int, int]]) -> None:
    blocks = [
        Passage(f"block {i}", tuple(f"{i}.{k}" for k in range(n)), keep=keep)
        for i, (n, keep) in enumerate(sizes)
    ]
    found = fitted(blocks, LINES)
    least = sum(min(n, keep) + 2 for n, keep in sizes if n)
    assert sum(1 + len(b.lines) for b in found) <= max(LINES, least)
    for block in found:
        whole = next(b for b in blocks if b.title == block.title)
        *shown, last = block.lines
        if block.lines != whole.lines:
            assert last.split()[0] == str(len(whole.lines) - len(shown))
            assert tuple(shown) == whole.lines[: len(shown)]


@pytest.mark.parametrize(
    ("error", "doubt", "drawn"),
    [
        (0.0, 0.0, "          │    "),
        (5.0, 0.0, "█████     │    "),
        (-5.0, 3.0, "█████░░░  │    "),
        (10.0, 4.0, "██████████│░░░░"),
        (10.0, 5.0, "██████████│░░░>"),
        (float("nan"), 1.0, "██████████│███>"),
        (3.0, float("inf"), "███░░░░░░░│░░░>"),
    ],
)
def test_a_bar_has_its_limit_always_at_the_same_place(
    error: float, doubt: float, drawn: str
) -> None:
    assert bar(error, doubt, 10.0) == drawn


@pytest.mark.parametrize("columns", [60, 80, 120])
def test_rows_are_one_line_each_and_only_the_soft_column_is_cut(
    columns: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    cells = [["a name of many words " * 4, "12.5 mm", "good enough"], ["b", "3 mm", "undecided"]]
    lines = rows(["", "error", "verdict"], cells)
    assert len(lines) == 3
    assert max(map(len, lines)) <= columns
    assert "12.5 mm" in lines[1]
    assert "good enough" in lines[1]


@pytest.mark.parametrize("count", [1, 4, 40, 500])
def test_a_run_ends_in_a_screen_with_the_worst_check_first(
    count: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    soft, stiff = small_result().methods
    checks = [
        replace(CHECK, name=f"force.plate{i}@2mm", value=0.01 * i / count) for i in range(count)
    ]
    bad = replace(CHECK, name="worst@2mm", value=0.9, acceptance="not good enough",
                  validation="differs", ratio=9.0)  # fmt: skip
    warnings = tuple(f"a doubt of many words, number {i}, " * 5 for i in range(20))
    result = replace(
        small_result(), methods=(replace(soft, checks=(*checks, bad)), stiff), warnings=warnings
    )
    show_run(result, "cube", PAGE, 1.0)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) <= LINES
    first = lines.index(next(x for x in lines if x.startswith("Checks: not good enough"))) + 1
    assert "worst@2mm" in lines[first]
    assert lines[0].startswith("cube: not good enough; ")
    assert lines[-1].endswith("report: report.html")
    show_run(result, "cube", PAGE, 1.0, "full")
    whole = " ".join(capsys.readouterr().out.split())
    assert all(c.name in whole for c in checks)
    assert all(" ".join(w.split()) in whole for w in warnings[:1])


def test_likely_causes_stand_on_the_screen(capsys: pytest.CaptureFixture[str]) -> None:
    row = ("slip", "tip", 1, "modulus or density", 61.7, "the motion is too fast", "weigh the body")
    table = NumberTable("likely_causes", "", ("",) * 7, (row,))
    exhibit = Exhibit("likely-causes", "Likely causes", (), tables=(table,))
    show_run(replace(small_result(), exhibits=(exhibit,)), "cube", PAGE, 1.0)
    assert "  1. modulus or density  62 %  weigh the body\n" in capsys.readouterr().out


def test_a_check_that_compared_nothing_has_its_reason(capsys: pytest.CaptureFixture[str]) -> None:
    soft, stiff = small_result().methods
    none = replace(CHECK, count=0, acceptance="nothing compared", why="compared nothing: at all")
    methods = (replace(soft, checks=(none,)), stiff)
    show_run(replace(small_result(), methods=methods), "cube", PAGE, 1.0)
    assert "compared nothing: at all\n" in capsys.readouterr().out


def test_quiet_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    show([Passage("", ("one: good", "  enough")), Passage("more", ("x",))], "short")
    assert capsys.readouterr().out == "one: good enough\n"


def test_text_is_printed_as_it_is_meant(capsys: pytest.CaptureFixture[str]) -> None:
    say("a unit :m: and [bold] 1\u202f000")
    assert capsys.readouterr().out == "a unit :m: and [bold] 1\u202f000\n"


@pytest.mark.parametrize("arguments", [("list",), ("run", "--help")])
def test_a_reader_that_ends_early_is_no_failure(
    arguments: tuple[str, ...], project_root: Path
) -> None:
    command = [sys.executable, "-P", "-m", "validate", *arguments]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=project_root
    ) as running:
        assert running.stdout is not None
        assert running.stderr is not None
        running.stdout.close()
        said = running.stderr.read()
    assert (running.returncode, said) == (0, b"")


@pytest.mark.parametrize(
    ("content", "name", "says"),
    [
        (b"", "empty.csv", "the file is empty (0 bytes); record or copy it again"),
        (b"", "empty", "the file is empty"),
        (np.random.default_rng(0).bytes(3000), "noise.csv", "unknown format (binary data, 3000"),
    ],
    ids=["empty.csv", "empty", "noise"],
)
@pytest.mark.parametrize("command", [("inspect",), ("import", "-o", "x.mcap")])
def test_empty_and_unknown_files_are_called_so(
    command: tuple[str, ...], content: bytes, name: str, says: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_bytes(content)
    assert says in refused(*command, name, cwd=tmp_path)


def test_many_columns_are_named_by_a_dozen(tmp_path: Path) -> None:
    head = ",".join(["time (s)", *(f"c{i}" for i in range(150))])
    lines = [",".join([f"{k / 10}", *["1"] * 150]) for k in range(20)]
    (tmp_path / "wide.csv").write_text("\n".join([head, *lines]), "utf-8")
    said = refused("import", "wide.csv", "-o", "x.mcap", cwd=tmp_path)
    assert "'c10' and 139 more; name it with --map displacement=COLUMN" in said
    assert "c11" not in said


def test_an_unknown_experiment_says_where_it_was_searched(tmp_path: Path) -> None:
    said = refused("run", "gel", cwd=tmp_path)
    assert said.startswith("validate: unknown experiment 'gel'; ")
    assert str(tmp_path / "experiments") in said


def test_a_file_is_not_aligned_with_itself(tmp_path: Path, project_root: Path) -> None:
    file = str(project_root / "recordings" / "kf_cube.mcap")
    said = refused("align", file, file, "--by", "pull.force=pull.force", "-o", str(tmp_path / "x"))
    assert f"align: {file} is given twice" in said


def test_the_list_is_one_screen_and_says_what_experiments_need() -> None:
    code, out, _ = here("list", COLUMNS="80")
    lines = out.splitlines()
    assert code == 0
    assert len(lines) <= LINES
    assert max(map(len, lines)) <= 80
    needs = {line.split()[0]: line.split("  ")[-1] for line in lines}
    assert needs["kf_cube"].strip() == "-"
    assert "silicone-beam" in needs["silicone_beam"]


def test_parameters_that_matter_come_first() -> None:
    lines = here("list", "silicone_beam", COLUMNS="80")[1].splitlines()
    assert len(lines) <= LINES
    start = lines.index("Parameters (--set PATH=VALUE)") + 1
    paths = [line.split()[0] for line in lines[start : start + 10]]
    assert paths[:2] == ["material.E", "relaxation.fast"]  # both are identified
    assert all(p.startswith(("material.", "relaxation.")) for p in paths)
    assert "more: --all" in lines[start + 10]
    assert "methods.mixed" in here("list", "silicone_beam", "--all")[1]


def test_many_unread_fields_are_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    source = Source("x.mat", "", 0, "text")
    unread = {f"field{i}": "a table of text" for i in range(150)}
    (line,) = _besides(Recording("x", source, 0, unread=unread))
    assert line.startswith("not read: 150 fields; the first: field0: a table of text")
    topics = [Topic(n, f"not read: {w}", "", "", "", 0, None, None, "", "", None)
              for n, w in unread.items()]  # fmt: skip
    found = Inspection(
        source=source, profile="", library="", compressions=(), chunks=0, messages=0, attachments=0,
        metadata=(), topics=tuple(topics), defects=(), facts=(), read_as="matlab",
    )  # fmt: skip
    show(_passages(found, (), "screen"))
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) <= 5
    assert "150 fields are not read; the first: field0: not read: a table of text" in lines
    show(_passages(found, (), "full"), "full")
    assert capsys.readouterr().out.count("not read: a table of text") == 150


def test_sentences_are_cut_on_a_screen_and_whole_with_verbose(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    text = " ".join(f"word{i}" for i in range(60))
    show([sentences([text])])
    cut_short = capsys.readouterr().out
    assert len(cut_short.splitlines()) == 2
    assert cut_short.endswith(" …\n")
    show([sentences([text])], "full")
    assert capsys.readouterr().out.split() == text.split()


def test_checks_stand_by_verdict_and_then_by_the_room_that_is_left() -> None:
    def check(name: str, value: float, verdict: str) -> dict[str, object]:
        found = replace(CHECK, name=name, value=value, acceptance=verdict, validation="differs")
        return {"method": "soft", **check_members(found)}

    checks = [check("wide", 0.01, "good enough"), check("narrow", 0.4, "good enough"),
              check("open", 0.5, "undecided"), check("bad", 0.7, "not good enough"),
              check("worse", 0.9, "not good enough")]  # fmt: skip
    names = [c["name"] for c in worst_first(checks)]
    assert names == ["worse", "bad", "open", "narrow", "wide"]
    titles = [p.title.partition(" (")[0] for p in check_passages(checks)]
    assert titles == ["Checks: not good enough, worst first", "Checks: undecided",
                      "Checks: good enough, worst first"]  # fmt: skip


def test_methods_are_ranked_by_the_score_that_they_share(
    capsys: pytest.CaptureFixture[str],
) -> None:
    soft, stiff = small_result().methods
    error = Score("force.plate@2mm", -0.4, "N", 1, "recording", "")
    methods = (replace(soft, scores=(error,)), replace(stiff, scores=(replace(error, value=0.1),)))
    show_run(replace(small_result(), methods=methods), "cube", PAGE, 1.0)
    lines = capsys.readouterr().out.splitlines()
    at = next(
        i for i, line in enumerate(lines) if line.startswith("Methods by force.plate at 2 mm")
    )
    assert lines[at + 2].split()[:2] == ["1.", stiff.name]
    assert lines[at + 3].split()[:2] == ["2.", soft.name]


def test_data_that_are_not_here_are_marked(tmp_path: Path) -> None:
    places = dict.fromkeys(("VALIDATE_SHARED_DATA", "XDG_CACHE_HOME"), str(tmp_path))
    lines = here("list", cwd=tmp_path, COLUMNS="60", **places)[1].splitlines()
    assert len(lines) <= LINES
    assert max(map(len, lines)) <= 60
    assert lines[-1] == "*: not here yet; `validate data get NAME` fetches it"
    assert any(line.endswith("silicone-beam *") for line in lines)
    assert any(line.startswith("  kf_cube ") and line.endswith(" -") for line in lines)
