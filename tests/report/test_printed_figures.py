"""Wherever a printed figure is shown, its verdict is the one that follows from today's value."""

import csv
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import jsonschema
import pytest
from report_samples import PRINTED, small_result

from validate.cli import checking
from validate.cli.run_screen import show_run
from validate.compare.exhibit import Exhibit
from validate.compare.published import Published
from validate.compare.result import Result
from validate.report.exhibits import draw_all
from validate.report.html import page
from validate.report.score_tables import methods, published
from validate.report.store import document, schema
from validate.report.tables import write_table
from validate.report.verdicts import band, checks

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


def written(
    result: Result, section: Callable[[Result], Exhibit | None], folder: Path
) -> tuple[list[dict[str, str]], str]:
    """The rows of a section's first named table as its CSV file has them, and the page."""
    exhibit = section(result)
    assert exhibit is not None
    for table in exhibit.tables:
        write_table(table, folder)
    texts = [file.read_text("utf-8").splitlines() for file in folder.glob("*.csv")]
    rows = list(csv.DictReader(texts[0]))
    return rows, page(result, draw_all(result, [exhibit]), CREATED, band(result))


@pytest.mark.parametrize("line", STATES)
def test_report_and_results_show_the_verdict_of_today(line: str, tmp_path: Path) -> None:
    figure = STATES[line]
    (row,), text = written(showing(figure), published, tmp_path)
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
        *_, row = (r for r in shown.splitlines() if r.startswith("soft: force"))
        assert f"  {line}  " in row
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
    exhibit = published(result)
    assert exhibit is not None
    results, settings = exhibit.tables
    assert ([row[0] for row in results.rows], settings.folded) == ([HELD.name], True)
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
    assert checking._holds(checking._content(result), declared=False) is stands


def test_figures_of_other_data_alone_hold_nothing() -> None:
    assert checking._holds(checking._content(showing(HELD)), declared=True)
    other = checking._content(showing(STATES["other data"]))
    assert not checking._holds(other, declared=True)


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
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    chosen = "process noise chosen on this twin"
    soft, stiff = small_result().methods
    result = replace(small_result(), methods=(replace(soft, chosen=chosen), stiff))
    (row,), checked = written(result, checks, tmp_path)
    assert row["why"] == f"|E| is 0.5 u_val; {chosen}. Limit: ours: a half."
    assert checked.count(chosen) == 2  # the sentence above and the row
    assert chosen in written(result, methods, tmp_path)[1]
    assert [m["chosen"] for m in document(result, CREATED)["methods"]] == [chosen, ""]
    show_run(result, "small", Path("report.html"), 1.0)
    assert chosen in " ".join(capsys.readouterr().out.split())
