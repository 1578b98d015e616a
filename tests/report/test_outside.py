"""A stored result as JUnit XML and LaTeX, read by others."""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from click.testing import CliRunner

from validate.cli.main import cli
from validate.report.outside import junit, latex


def check(name: str, verdict: str, value: float | None = 1.5e-5) -> dict[str, Any]:
    return {
        "name": name, "verdict": verdict, "value": value, "u_val": 2.0, "unit": "m", "count": 7,
        "why": "|E| < 2 u_val & more",
    }  # fmt: skip


def content(*checks: dict[str, Any], published: tuple[Any, ...] = ()) -> dict[str, Any]:
    return {
        "experiment": "kf_cube", "created": "2026-01-01T00:00:00Z", "sentence": "it\nagrees",
        "methods": [
            {"name": "fem", "label": "FEM_1 & 50 %", "accepted": True, "checks": list(checks)},
            {"name": "rival", "label": "rival", "accepted": False, "checks": list(checks)},
        ],
        "published": list(published),
    }  # fmt: skip


def test_a_check_that_fails_is_a_failure_and_no_evidence_is_skipped() -> None:
    given = content(check("a@1", "agrees"), check("b@1", "differs"), check("c@1", "cannot decide"),
                    check("d@1", "fitted"), check("e@1", "repeats itself", None))  # fmt: skip
    root = ElementTree.fromstring(junit(given))
    (fem, rival) = root
    counts = {"name": "kf_cube.fem", "tests": "5", "failures": "2", "skipped": "2"}
    assert fem.attrib == counts
    assert rival.attrib["failures"] == "0"  # rivals never decide
    failed = [case.get("name") for case in fem if case.find("failure") is not None]
    assert failed == ["b@1", "c@1"]
    message = fem[1].find("failure")
    assert message is not None
    assert "differs: E 1.5e" in message.attrib["message"]
    assert "E none" in (fem[4].find("skipped") or fem[4])[0].attrib.get("message", "E none")


def test_an_experiment_that_compared_nothing_fails() -> None:
    root = ElementTree.fromstring(junit(content()))
    assert root[0].attrib["failures"] == "1"
    assert "0 checks" in junit(content())


def test_a_printed_figure_that_fell_is_a_failure() -> None:
    figure = {"name": "peak \x07", "verdict": "reproduced", "ours": 1.0, "theirs": 2.0,
              "reason": "", "source": "Table 1", "fault": "ours moved to 1.0"}  # fmt: skip
    root = ElementTree.fromstring(junit(content(check("a", "agrees"), published=(figure,))))
    assert [s.attrib["failures"] for s in root] == ["0", "0", "1"]


def test_latex_escapes_and_needs_no_package(tmp_path: Path) -> None:
    table = latex(content(check("a_b@1", "agrees"), check("c", "fitted", None)))
    assert r"FEM\_1 \& 50 \% & a\_b@1 & $1.5\times10^{-5}$ & $2$ & m & 7 & agrees \\" in table
    assert " -- & $2$" in table
    assert table.isascii()
    if shutil.which("pdflatex"):
        document = r"\documentclass{article}\begin{document}" + table + r"\end{document}"
        (tmp_path / "x.tex").write_text(document)
        subprocess.run(["pdflatex", "-halt-on-error", "x.tex"], cwd=tmp_path, check=True)


def test_the_command_writes_what_is_asked_for(tmp_path: Path) -> None:
    (tmp_path / "results.json").write_text(json.dumps(content(check("a", "agrees"))))
    run = CliRunner()
    nothing = run.invoke(cli, ["export", str(tmp_path)])
    assert "say what: --junit" in str(nothing.exception)
    files = ["--junit", str(tmp_path / "x.xml"), "--latex", str(tmp_path / "x.tex")]
    done = run.invoke(cli, ["export", str(tmp_path), *files])
    assert done.exit_code == 0, done.output
    assert ElementTree.parse(tmp_path / "x.xml").getroot().tag == "testsuites"
    assert (tmp_path / "x.tex").read_text().startswith("% kf_cube")


@pytest.mark.parametrize("broken", ["[]", "{}", "no json"])
def test_what_is_no_stored_run_is_one_line(broken: str, tmp_path: Path) -> None:
    (tmp_path / "results.json").write_text(broken)
    done = CliRunner().invoke(cli, ["export", str(tmp_path), "--junit", str(tmp_path / "x.xml")])
    assert "is no results.json of validate" in str(done.exception)
