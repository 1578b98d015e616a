"""A stored result as JUnit XML and LaTeX, read by others: junitparser, pylatexenc, LaTeX itself."""

import json
import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from junitparser import Error, Failure, JUnitXml, Skipped
from pylatexenc.latexwalker import LatexEnvironmentNode, LatexWalker, get_default_latex_context_db
from pylatexenc.macrospec import EnvironmentSpec

from validate.checksums import sealed
from validate.commands.export import checks_in_latex
from validate.commands.main import cli
from validate.report.export.junit_latex import junit
from validate.report.long_table import long_table


def check(name: str, verdict: str, value: float | None = 1.5e-5) -> dict[str, Any]:
    """A check with this answer to what decides; without a requirement where that is validation."""
    free = verdict in ("differs", "not distinguishable")
    return {
        "name": name, "verdict": verdict, "value": value, "u_val": 2.0, "unit": "m", "count": 7,
        "validation": verdict if free else "differs",
        "acceptance": "no requirement" if free else verdict, "limit": None if free else 9.0,
        "margin": None if free else 5.0, "requirement": "ours: a tenth",
        "why": "|E| < 2 u_val & more",
    }  # fmt: skip


def content(*checks: dict[str, Any], published: tuple[Any, ...] = ()) -> dict[str, Any]:
    differs = [c["name"] for c in checks if c["verdict"] == "differs" and c["name"] != "alone"]
    undecided = [c["name"] for c in checks if c["verdict"] in ("undecided", "not good enough")]
    ended = {"state": "finished", "step": 9, "why": ""}
    return {
        "experiment": "kf_cube", "created": "2026-01-01T00:00:00Z", "sentence": "it\nholds",
        "passed": bool(checks) and not differs and not undecided,
        "overall": {"verdict": "differs" if differs else "good enough", "evidence": 1,
                    "checks": len(checks), "differs": differs, "undecided": undecided},
        "methods": [
            {"name": "fem", "label": "FEM_1 & 50 %", "accepted": True, "checks": list(checks),
             "outcome": ended},
            {"name": "rival", "label": "rival", "accepted": False, "checks": list(checks),
             "outcome": ended},
        ],
        "published": list(published),
    }  # fmt: skip


def suites(given: dict[str, Any], tmp_path: Path) -> dict[str, Any]:
    """Suites by name, by a reader of others; its own counts are those in the file."""
    path = tmp_path / "checks.xml"
    path.write_text(junit(given), "utf-8")
    xml = JUnitXml.fromfile(str(path))
    told = [(s.name, s.tests, s.failures, s.errors, s.skipped) for s in xml]
    total = (xml.tests, xml.failures, xml.errors, xml.skipped)
    for suite in xml:
        suite.update_statistics()
    assert told == [(s.name, s.tests, s.failures, s.errors, s.skipped) for s in xml]
    xml.update_statistics()
    assert total == (xml.tests, xml.failures, xml.errors, xml.skipped)
    return {suite.name.removeprefix("kf_cube."): suite for suite in xml}


def results(suite: Any) -> dict[str, Any]:
    """What a reader says of each case: its result's class and words, none for one that passed."""
    return {c.name: [(type(r), r.message) for r in c.result] for c in suite}


def test_a_check_that_fails_is_a_failure_and_no_evidence_is_skipped(tmp_path: Path) -> None:
    given = content(check("a@1", "good enough"), check("b@1", "not good enough"),
                    check("c@1", "undecided"), check("d@1", "fitted"),
                    check("e@1", "same model", None))  # fmt: skip
    found = suites(given, tmp_path)
    fem = results(found["fem"])
    assert {name: [kind for kind, _ in said] for name, said in fem.items()} == {
        "a@1": [], "b@1": [Failure], "c@1": [Failure], "d@1": [Skipped], "e@1": [Skipped]
    }  # fmt: skip
    said = (
        "not good enough (differs): E 1.5e−5 m, u_val 2.00 m, limit 9.00 m, margin 5.00 m, 7 "
        "values; |E| < 2 u_val & more; limit: ours: a tenth"
    )
    assert fem["b@1"][0][1] == said
    assert "E none" in fem["e@1"][0][1]
    assert found["rival"].failures == 0  # rivals never decide
    assert found["verdict"].failures == 1


def test_it_fails_where_the_run_fails(tmp_path: Path) -> None:
    """A check that differs by itself, but not after the correction, does not fail alone."""
    found = suites(content(check("alone", "differs"), check("b", "not distinguishable")), tmp_path)
    assert [s.failures + s.errors for s in found.values()] == [0, 0, 0]
    (case, _) = found["fem"]
    assert "not after Holm's correction" in case.system_out


def test_an_accepted_method_that_ended_early_is_an_error(tmp_path: Path) -> None:
    given = content(check("a", "good enough"))
    for method in given["methods"]:
        method |= {"checks": [], "outcome": {"state": "diverged", "step": 12, "why": "u > 1e3 m"}}
    found = suites(given, tmp_path)
    assert results(found["fem"]) == {"finished": [(Error, "diverged at step 12: u > 1e3 m")]}
    assert [kind for kind, _ in results(found["rival"])["finished"]] == [Skipped]


def test_an_experiment_that_compared_nothing_fails(tmp_path: Path) -> None:
    found = suites(content(), tmp_path)
    assert list(found) == ["verdict"]
    assert "of 0 checks are evidence" in results(found["verdict"])["all checks"][0][1]


def test_a_printed_figure_that_fell_is_a_failure(tmp_path: Path) -> None:
    figure = {"name": "peak \x07", "verdict": "reproduced", "ours": 1.0, "theirs": 2.0,
              "reason": "", "source": "Table 1", "fault": "ours moved to 1.0"}  # fmt: skip
    found = suites(content(check("a", "good enough"), published=(figure,)), tmp_path)
    assert results(found["published"]) == {"peak ?": [(Failure, "ours moved to 1.0")]}
    assert [s.failures for s in found.values()] == [0, 0, 0, 1]


def latex(*checks: dict[str, Any]) -> str:
    return checks_in_latex(long_table(content(*checks), "run"))


def test_latex_escapes_and_is_a_whole_table() -> None:
    table = latex(check("a_b@1", "good enough"), check("c", "fitted", None))
    assert (
        r"FEM\_1 \& 50 \% & a\_b@1 & good enough & differs & $0$ & $4\,000$ & $9\,000$ & " in table
    )
    assert "& fitted & differs & -- & $4\\,000$" in table
    assert table.isascii()
    known = get_default_latex_context_db()
    known.add_context_category("own", environments=[EnvironmentSpec("tabular", "{")], prepend=True)
    nodes, _, _ = LatexWalker(table, known, tolerant_parsing=False).get_latex_nodes()
    (tabular,) = (n for n in nodes if isinstance(n, LatexEnvironmentNode))
    assert tabular.environmentname == "tabular"
    inside = tabular.latex_verbatim().splitlines()
    rows = [re.sub(r"(?<!\\)%.*|\\&", "", line) for line in inside]
    assert {row.count("&") for row in rows if "&" in row} == {9}


def test_latex_typesets_it(tmp_path: Path) -> None:
    if shutil.which("pdflatex") is None:
        assert os.environ.get("VALIDATE_REQUIRE_LATEX") != "1", "no pdflatex"
        pytest.skip("no pdflatex (VALIDATE_REQUIRE_LATEX=1 makes this a failure)")
    rows = (check("a_b@1 {x}~^", "good enough"), check("50 % \\ # $", "fitted", None))
    document = r"\documentclass{article}\begin{document}" + latex(*rows) + r"\end{document}"
    (tmp_path / "x.tex").write_text(document)
    said = subprocess.run(
        ["pdflatex", "-halt-on-error", "x.tex"], cwd=tmp_path, capture_output=True, text=True
    )
    assert said.returncode == 0, said.stdout[-800:]
    assert "Output written on x.pdf (1 page" in said.stdout


def test_the_command_writes_what_is_asked_for(tmp_path: Path) -> None:
    (tmp_path / "results.json").write_text(json.dumps(sealed(content(check("a", "good enough")))))
    run = CliRunner()
    nothing = run.invoke(cli, ["export", str(tmp_path)])
    assert "give --junit" in str(nothing.exception)
    files = ["--junit", str(tmp_path / "x.xml"), "--latex", str(tmp_path / "x.tex")]
    done = run.invoke(cli, ["export", str(tmp_path), *files])
    assert done.exit_code == 0, done.output
    assert JUnitXml.fromfile(str(tmp_path / "x.xml")).tests == 3
    assert (tmp_path / "x.tex").read_text().startswith("% kf_cube")


@pytest.mark.parametrize("broken", ["[]", "{}", "no json"])
def test_what_is_no_stored_run_is_one_line(broken: str, tmp_path: Path) -> None:
    (tmp_path / "results.json").write_text(broken)
    done = CliRunner().invoke(cli, ["export", str(tmp_path), "--junit", str(tmp_path / "x.xml")])
    assert re.search(r"results\.json: ignored \(.*\); run it again", str(done.exception))


def test_a_run_of_an_earlier_schema_says_so(tmp_path: Path) -> None:
    old = content(check("a", "good enough")) | {"schema_version": 1}
    (tmp_path / "results.json").write_text(json.dumps(sealed(old)))
    done = CliRunner().invoke(cli, ["export", str(tmp_path), "--junit", str(tmp_path / "x.xml")])
    words = "stored with schema version 1, today's is 2 (two answers a check); run it again"
    assert words in str(done.exception)
