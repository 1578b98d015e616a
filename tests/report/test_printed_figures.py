"""Wherever a printed figure is shown, its verdict is the one that follows from today's value."""

from dataclasses import replace
from pathlib import Path

import jsonschema
import pytest
from report_samples import PRINTED, section, small_result

from validate.commands import check as checking
from validate.commands.run_screen import show_run
from validate.compare.exhibit import Entry, plain
from validate.compare.published import Published
from validate.compare.result import Result
from validate.report.exhibits import draw_all
from validate.report.page.html import page
from validate.report.sections.verdicts import band
from validate.report.stored.store import document, schema

# private: _content, _document, _show: called alone, case by case.

CREATED = "2026-11-21T04:00:00Z"
HELD = replace(PRINTED, expected=4.0, drift=0.01)
OTHER = "printed for A; not compared with this data (B)"
STATES = {
    "reproduced": HELD,
    "moved": replace(HELD, ours=4.05),
    "not reproduced": replace(PRINTED, ours=9.0),
    "not computed": replace(PRINTED, ours=None, missing="no score 'force'"),
    "other data": replace(HELD, ours=None, other=OTHER),
    "reproduced (within 0..5 s)": replace(HELD, window="0..5 s"),
}


def showing(figure: Published) -> Result:
    return replace(small_result(), published=(figure,))


def shown_rows(result: Result, anchor: str) -> tuple[list[dict[str, Entry]], str]:
    """The rows of a section's first table under its headings, and the page."""
    exhibit = section(result, anchor)
    first = exhibit.tables[0]
    rows = [dict(zip(first.headings, map(plain, row), strict=True)) for row in first.rows]
    return rows, page(result, draw_all(result, [exhibit]), CREATED, band(result))


@pytest.mark.parametrize("line", STATES)
def test_report_and_results_show_the_verdict_of_today(line: str) -> None:
    figure = STATES[line]
    (row,), text = shown_rows(showing(figure), "published")
    assert row["verdict"] == line
    (stored,) = document(showing(figure), CREATED)["published"]
    assert stored["verdict"] == figure.verdict == line.partition(" (")[0]
    assert stored["reason"] == row["reason"] == figure.why
    assert line in text


@pytest.mark.parametrize("line", STATES)
def test_terminals_of_run_and_check_show_the_verdict_of_today(
    line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    result = showing(STATES[line])
    content = checking._content(result)
    held = {**checking._document(content, declared=True), "motion": ()}
    checking._show(content, held, "full")
    checked = capsys.readouterr().out
    show_run(result, "small", Path("report.html"), 1.0, "full")
    for shown in (checked, capsys.readouterr().out):
        row = shown[shown.rindex("\nsoft: force") :]
        assert f"{line} " in " ".join(row.replace(";", " ").split())
    verdict = line.partition(" (")[0]
    show_run(result, "small", Path("report.html"), 1.0)
    assert f"Of 1 printed figures: 1 {verdict}" in capsys.readouterr().out


def test_settings_sketches_and_citations_are_no_figures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    photograph = replace(PRINTED, name="a photograph", ours=None, theirs=None,
                         claim="not comparable")  # fmt: skip
    density = replace(HELD, name="density", setting=True)
    result = replace(small_result(), published=(HELD, photograph, density))
    assert [p.result for p in result.published] == [True, False, False]
    exhibit = section(result, "published")
    results, settings = exhibit.tables
    assert ([plain(row[0]) for row in results.rows], settings.folded) == ([HELD.name], True)
    show_run(result, "small", Path("report.html"), 1.0)
    line = next(x for x in capsys.readouterr().out.splitlines() if "printed figures" in x)
    assert line == "Of 1 printed figures: 1 reproduced; validate check small"


@pytest.mark.parametrize(
    ("line", "stands"),
    [("reproduced", True), ("moved", False), ("not reproduced", False), ("not computed", False),
     ("other data", True)],
)  # fmt: skip
def test_a_figure_that_does_not_stand_fails_the_check_and_not_the_run(
    line: str, *, stands: bool
) -> None:
    result = showing(STATES[line])
    assert result.passed
    assert document(result, CREATED)["passed"]
    assert checking._document(checking._content(result), declared=False)["holds"] is stands


def test_figures_of_other_data_alone_hold_nothing() -> None:
    assert checking._document(checking._content(showing(HELD)), declared=True)["holds"]
    other = checking._content(showing(STATES["other data"]))
    assert not checking._document(other, declared=True)["holds"]


def test_both_json_documents_hold_what_the_verdicts_rest_on() -> None:
    run = document(showing(HELD), CREATED)
    jsonschema.Draft202012Validator(schema()).validate(run)
    check = checking._document(checking._content(showing(HELD)), declared=True)
    for found in (run, check):
        (figure,) = found["published"]
        assert [figure[k] for k in ("ours", "theirs", "tolerance", "expected", "drift")] == [
            4.0, 4.1, 0.2, 4.0, 0.01,
        ]  # fmt: skip
    for judged in (run["methods"][0]["checks"][0], check["checks"][0]):
        parts = [judged[k] for k in ("u_val", "u_D", "u_num", "u_input")]
        assert parts == [0.02, 0.015, 0.01, 0.005]
    assert check["checks"][0]["method"] == "soft"


def test_what_was_chosen_on_the_judging_twin_stands_beside_the_verdict(
    capsys: pytest.CaptureFixture[str],
) -> None:
    chosen = "process noise chosen on this twin"
    soft, stiff = small_result().methods
    result = replace(small_result(), methods=(replace(soft, chosen=chosen), stiff))
    assert chosen in section(result, "checks").words[0]
    assert [row["chosen"] for row in shown_rows(result, "methods")[0]] == [chosen, None]
    assert [m["chosen"] for m in document(result, CREATED)["methods"]] == [chosen, ""]
    show_run(result, "small", Path("report.html"), 1.0)
    assert chosen in " ".join(capsys.readouterr().out.split())
