"""Views: what a declaration over rows shows, by each drawer, and what it refuses."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from report_samples import section, small_result

from validate.checksums import read_sealed
from validate.commands.main import cli
from validate.compare.exhibit import Chart, Exhibit, NumberTable, Series
from validate.compare.row import LongRow, RowBlock
from validate.compare.view import View
from validate.errors import ComparisonError, UsageError
from validate.library.plots import ShownView, plots_of
from validate.report import StoredTables
from validate.report.export.table_file import stored_table
from validate.report.export.tables import shown
from validate.report.long_table import LongTable
from validate.report.stored.exhibit_rows import stored_exhibits
from validate.report.stored.json_values import write_json
from validate.report.stored.store import document
from validate.report.views.drawers import figures, page, save, terminal
from validate.report.views.standard import STANDARD, VIEWS, view_of
from validate.report.views.view_filling import explained, filled
from validate.report.write import table_of, write_report

# private: _added: plug-ins of the test are taken out again.

HEAD = {"methods": [{"name": "kf", "label": "Kalman filter", "accepted": True}]}
ONE = LongRow(part="score", method="kf", quantity="tip", statistic="rms", unit="m")


def table(*rows: LongRow) -> LongTable:
    return LongTable(HEAD, rows)


def whole() -> LongTable:
    return table_of(small_result(), document(small_result(), "2026-01-01"), "cube")


def read(view: View, of: LongTable) -> list[list[str]]:
    (found,) = filled(view, of).tables
    return [list(found.headings), *([shown(c) for c in row] for row in found.rows)]


# --- tables ---------------------------------------------------------------------------------------


def test_a_table_has_lines_columns_labels_and_one_unit_a_column() -> None:
    rows = [ONE._replace(condition=c, value=v, n=3) for c, v in (("2mm", 1e-3), ("4mm", 2e-3))]
    other = ONE._replace(method="fem", condition="4mm", value=5e-3, n=4)
    view = View("tip", "Tip", {"part": "score"}, x="label", by="condition", also=("n",))
    assert read(view, table(*rows, other)) == [
        ["method", "2 mm / mm", "4 mm / mm", "values"],
        ["Kalman filter", "1.00", "2.00", "3"],
        ["fem", "–", "5.00", "4"],
    ]


def test_units_that_differ_from_line_to_line_have_a_column_else_stand_beside_the_number() -> None:
    force = ONE._replace(quantity="force", unit="N", value=2.0)
    length = ONE._replace(value=1e-3)
    view = View("errors", "Errors", {"part": "score"}, x="quantity", by="statistic")
    assert read(view, table(force, length)) == [
        ["quantity", "unit", "rms"], ["force", "N", "2.00"], ["tip", "mm", "1.00"],
    ]  # fmt: skip
    both = table(force, length, force._replace(method="b", unit="m"), length._replace(method="b"))
    across = View("errors", "Errors", {"part": "score"}, x="method", by="quantity")
    assert read(across, both)[1] == ["kf", "2.00 N", "1.00 mm"]


def test_a_rate_is_one_over_a_time_and_a_wrong_unit_is_refused() -> None:
    step = ONE._replace(quantity="step", unit="s", value=0.004)
    asked = View("rate", "Rate", {"part": "score"}, x="method", by="quantity", unit="Hz")
    assert read(asked, table(step)) == [["method", "step / Hz"], ["kf", "250"]]
    with pytest.raises(ComparisonError, match="a number in m is not shown in Hz"):
        filled(asked, table(ONE._replace(value=1.0)))


def test_columns_are_named_and_a_star_takes_every_label() -> None:
    numbers = {"identified": 9.0, "identified.u.noise": 1.0, "identified.u.mesh": 2.0}
    rows = [ONE._replace(part=part, value=v) for part, v in numbers.items()]
    view = View("E", "E", {"part": "identified*"}, x="quantity", by="part",
                columns={"value": "identified", "u, *": "identified.u.*"})  # fmt: skip
    assert read(view, table(*rows))[0] == [
        "quantity", "value / mm", "u, noise / mm", "u, mesh / mm",
    ]  # fmt: skip


@pytest.mark.parametrize(("several", "value"), [("last", "2.00"), ("largest", "5.00")])
def test_several_rows_in_a_cell_need_a_rule(several: str, value: str) -> None:
    rows = table(*(ONE._replace(value=v) for v in (1e-3, -5e-3, 2e-3)))
    view = View("tip", "Tip", {"part": "score"}, x="method", by="quantity")
    with pytest.raises(ComparisonError, match="3 rows are in one cell"):
        filled(view, rows)
    ruled = View("tip", "Tip", {"part": "score"}, x="method", by="quantity", several=several)  # type: ignore[arg-type]
    assert read(ruled, rows)[1][1].lstrip("−") == value


def test_a_refused_label_stands_behind_an_exclamation_mark() -> None:
    rows = table(ONE._replace(value=1.0), ONE._replace(quantity="setup", value=2.0))
    assert [r.quantity for r in rows.where(quantity="!setup").rows] == ["tip"]
    assert [r.quantity for r in rows.where(quantity=("s*", "!setup")).rows] == []


# --- charts ---------------------------------------------------------------------------------------


def sampled() -> LongTable:
    t = np.array([0.0, 1.0, 2.0])
    of = LongRow(part="sample", recording="a", quantity="force", unit="N")
    blocks = (
        RowBlock(of._replace(quantity="stage", unit="m", role="drives", method="measured"),
                 1e-3 * t, t),
        RowBlock(of._replace(method="measured", sd=0.1), 2 * t, t),
        RowBlock(of._replace(method="kf"), 3 * t, t, 0.2 * t),
    )  # fmt: skip
    return table(*(row for block in blocks for row in block.rows()))


def test_a_chart_is_drawn_over_another_quantity_with_bands_and_measured_points() -> None:
    view = View("f", "Force", {"part": "sample", "role": ""}, "lines", x="drives", by="label",
                y=("value", "sd"))  # fmt: skip
    (chart,) = filled(view, sampled()).charts
    assert (chart.x, chart.y) == ("stage / mm", "force / N")
    points, line = (next(s for s in chart.series if s.style == k) for k in ("points", "line"))
    assert (points.label, line.label) == ("measured", "Kalman filter")
    assert points.x.tolist() == [0, 1, 2]
    bands = {s.label: s for s in chart.series if s.style == "band"}
    assert bands["Kalman filter"].upper.tolist() == pytest.approx([0, 3.4, 6.8])  # type: ignore[union-attr]
    assert (bands["measured"].y - points.y).tolist() == pytest.approx([-0.2] * 3)


def test_a_difference_is_taken_at_the_same_time() -> None:
    view = View("f", "Force", {"part": "sample", "role": ""}, "lines", x="at", by="label",
                less="measured")  # fmt: skip
    (chart,) = filled(view, sampled()).charts
    assert (chart.x, chart.y) == ("time / s", "force − measured / N")
    assert {s.label: s.y.tolist() for s in chart.series} == {
        "measured": [0, 0, 0], "Kalman filter": [0, 1, 2],
    }  # fmt: skip


def test_lines_that_coincide_are_named_once() -> None:
    rows = sampled().rows
    same = [r._replace(method="again") for r in rows if r.method == "kf"]
    view = View("f", "Force", {"part": "sample", "role": ""}, "lines", x="at", by="label")
    (chart,) = filled(view, table(*rows, *same)).charts
    assert [s.label for s in chart.series] == ["measured", "Kalman filter"]
    assert "again (on Kalman filter)" in chart.caption
    before = filled(view, table(*same, *rows)).charts[0]  # a checked method is the one that stays
    assert {s.label for s in before.series} == {"measured", "Kalman filter"}


def test_an_axis_has_one_unit_and_x_is_a_number() -> None:
    mixed = table(ONE._replace(at=1.0, value=1.0), ONE._replace(at=1.0, value=1.0, unit="N"))
    with pytest.raises(ComparisonError, match="units m and N on one axis"):
        filled(View("f", "F", {}, "lines", x="at"), mixed)
    with pytest.raises(UsageError, match="'kind' holds no numbers"):
        filled(View("f", "F", {}, "lines", x="kind"), table(ONE._replace(value=1.0)))
    with pytest.raises(UsageError, match="no quantity 'tap'; nearest: tip"):
        filled(View("f", "F", {}, "lines", x="tap"), table(ONE._replace(value=1.0)))


# --- drawers --------------------------------------------------------------------------------------


@pytest.mark.parametrize("view", STANDARD, ids=lambda v: v.name)
def test_every_standard_view_is_drawn_everywhere(view: View, tmp_path: Path) -> None:
    """On a page, on a terminal of any width, as a file; its JSON is the view again."""
    of = whole()
    assert View.from_json(view.to_json()) == view
    found = filled(view, of)
    text = page(found, of)
    assert text.count("<html") == text.count("</html>") == 1
    for width in (40, 120):
        lines = terminal(found, width)
        assert lines[0] == view.title[: len(lines[0])]
    if view.form == "table":
        for i in range(len(found.tables)):
            assert len(found.tables[i].headings) == len(found.tables[i].rows[0])
        if len(found.tables) == 1 and view.name == "checks":
            save(found, of, tmp_path / "x.csv")
            head, first, *_ = (tmp_path / "x.csv").read_text().splitlines()
            assert "E / N" in head
            at = dict(zip(head.split(","), first.split(","), strict=False))
            assert (at["E / N"], at["2 u_val / N"]) == ("0.010", "0.040")  # to the same decimal
        if len(found.tables) == 1:
            for suffix in (".csv", ".tex"):
                save(found, of, tmp_path / f"x{suffix}")
                assert len((tmp_path / f"x{suffix}").read_text().splitlines()) > 1
    else:
        for figure, name in zip(figures(found, of), "abc", strict=False):
            figure.savefig(tmp_path / f"{name}.svg")
            assert "</svg>" in (tmp_path / f"{name}.svg").read_text()


def test_sentences_are_told_of_each_row() -> None:
    view = View("said", "Said", {"part": "score"}, "sentences",
                text="{label} errs by {value} at {condition}.")  # fmt: skip
    rows = table(ONE._replace(condition="9mm", value=2e-3))
    assert filled(view, rows).words == ("Kalman filter errs by 2.00 mm at 9 mm.",)
    assert terminal(filled(view, rows), 80)[1] == "Kalman filter errs by 2.00 mm at 9 mm."


def test_numbers_over_two_labels_are_a_heat() -> None:
    rows = table(*(ONE._replace(method=m, variation=v, value=x) for m, v, x in
                   (("a", "1", 1e-3), ("a", "2", 2e-3), ("b", "2", 3e-3))))  # fmt: skip
    view = View("map", "Map", {"part": "score"}, "heat", x="variation", by="method")
    (heat,) = filled(view, rows).heats
    assert (heat.columns, heat.rows, heat.quantity) == (("1", "2"), ("a", "b"), "tip / mm")
    assert heat.values.tolist()[0] == [1, 2]
    assert np.isnan(heat.values[1, 0])
    assert len(figures(filled(view, rows), rows)) == 1


@pytest.mark.parametrize(
    ("wrong", "said"),
    [({"form": "tables"}, "nearest: table"), ({"rows": {"methud": "a"}}, "no column 'methud'"),
     ({"x": "methd"}, "nearest: method"), ({"x": ()}, "x is missing"),
     ({"columns": {"a": "b:vallue"}}, "nearest: value")],
)  # fmt: skip
def test_a_view_that_cannot_be_filled_is_refused_when_it_is_declared(
    wrong: dict[str, object], said: str
) -> None:
    with pytest.raises(UsageError, match=said):
        View(**{"name": "a", "title": "A", "rows": {}, "x": "method", **wrong})  # type: ignore[arg-type]


# --- ways in --------------------------------------------------------------------------------------


def test_a_script_adds_a_view_in_five_lines(request: pytest.FixtureRequest) -> None:
    request.addfinalizer(VIEWS._added.clear)
    VIEWS.add(View("largest", "Largest errors", {"part": "score", "quantity": "force*"},
                   x="label", by="quantity", several="largest"))  # fmt: skip
    names = [a.title for a in [section(small_result(), "largest")]]
    assert names == ["Largest errors"]
    with pytest.raises(UsageError, match="taken"):
        VIEWS.add(View("checks", "Checks", {}, x="method"))


def test_a_view_of_a_script_that_cannot_be_filled_costs_a_warning(
    request: pytest.FixtureRequest, caplog: pytest.LogCaptureFixture
) -> None:
    request.addfinalizer(VIEWS._added.clear)
    VIEWS.add(View("crowded", "Crowded", {"part": "score"}, x="part", by="kind"))
    assert section(small_result(), "checks").tables
    assert "'crowded' (views) is not asked further: ComparisonError" in caplog.text


def test_the_page_about_reports_adds_one(
    request: pytest.FixtureRequest, project_root: Path
) -> None:
    request.addfinalizer(VIEWS._added.clear)
    page_text = (project_root / "docs" / "reference" / "report.md").read_text("utf-8")
    code = next(b for b in re.findall(r"```python\n(.*?)```", page_text, re.DOTALL) if "View(" in b)
    exec(code, {})
    (added,) = VIEWS.further
    assert added.name == "late"


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_show_prints_and_writes_views_of_a_stored_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VALIDATE_NO_GL", "1")
    own = View("own", "Own numbers", {"part": "told"}, x="quantity", by="statistic")
    rows = (RowBlock(LongRow(part="told", quantity="gain", unit="1"), np.array([7.0])),)
    folder = write_report(replace(small_result(), views=(own,), rows=rows), tmp_path / "cube",
                          created="2026-01-01").parent  # fmt: skip
    run = CliRunner()
    listed = run.invoke(cli, ["show", str(folder)])
    assert {"checks", "limits", "own"} <= {line.split()[0] for line in listed.output.splitlines()}
    assert "gain" in run.invoke(cli, ["show", str(folder), "own"]).output
    assert "time / s" in run.invoke(cli, ["show", str(folder), "traces"]).output
    out = tmp_path / "checks.tex"
    assert run.invoke(cli, ["show", str(folder), "checks", "-o", str(out)]).exit_code == 0
    assert out.read_text().startswith("% ")
    for words, said in ((["chekcs"], "nearest: checks"), (["checks", "-o", "x.gif"], ".csv")):
        done = run.invoke(cli, ["show", str(folder), *words])
        assert isinstance(done.exception, UsageError)
        assert said in str(done.exception)


def test_rows_of_an_experiment_have_the_labels_of_its_run() -> None:
    block = RowBlock(LongRow(quantity="gain", unit="1"), np.array([1.0, np.nan]))
    result = replace(small_result(), rows=(block,))
    found = table_of(result, document(result, "2026"), "x").where(quantity="gain").rows
    assert [(r.run, r.part, r.value, r.point) for r in found] == [
        ("x", "sample", 1.0, 0), ("x", "sample", None, 1),
    ]  # fmt: skip


# --- tables and charts of an experiment or a study ------------------------------------------------


def shows() -> Exhibit:
    table = NumberTable(
        "steps", "Steps", ("method", "force / mN", "count", "why"),
        (("soft <cube>", 2.0, 3, "a"), ("none", None, 4, "b")),
    )  # fmt: skip
    lines = (Series("soft <cube>", np.array([0.0, 1.0]), np.array([2.0, 3.0])),)
    chart = Chart("force", "Force", "depth / mm", "force / mN", lines, (("limit", 5.0),))
    return Exhibit("own", "Own", ("Said.",), (table,), (chart,))


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_every_number_that_an_experiment_shows_can_be_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VALIDATE_NO_GL", "1")
    result = replace(small_result(), exhibits=(shows(),))
    folder = write_report(result, tmp_path / "cube", created="2026-01-01").parent
    assert stored_exhibits(read_sealed(folder / "results.json"))[0].tables == shows().tables
    rows = stored_table(folder, part="table").rows
    assert [(r.quantity, r.statistic, r.method, r.variation, r.point, r.value, r.unit)
            for r in rows] == [
        ("steps", "force", "soft", "soft <cube>; a", 0, 0.002, "N"),
        ("steps", "count", "soft", "soft <cube>; a", 0, 3, "1"),
        ("steps", "count", "", "none; b", 1, 4, "1"),
    ]  # fmt: skip
    drawn = stored_table(folder, part="chart").rows
    assert [(r.method, r.at, r.value, r.unit) for r in drawn] == [
        ("soft", 0.0, 0.002, "N"), ("soft", 0.001, 0.003, "N"), ("", None, 0.005, "N"),
    ]  # fmt: skip
    assert not {"table", "chart", "trace"} & {r.part for r in stored_table(folder).rows}
    run = CliRunner()
    assert "limit" in run.invoke(cli, ["show", str(folder), "force"]).output
    assert "soft <cube>" in run.invoke(cli, ["show", str(folder), "steps"]).output


def test_numbers_of_a_study_are_rows_of_the_store(tmp_path: Path) -> None:
    """A study compares nothing: it has tables, and no scores."""
    content = {**document(replace(small_result(), exhibits=(shows(),)), "2026"), "methods": []}
    (tmp_path / "study-a").mkdir()
    write_json(content, tmp_path / "study-a" / "results.json")
    found = StoredTables.open(tmp_path).where(part="table", statistic="force").rows()
    assert [(r.run, r.value) for r in found] == [("study-a", 0.002)]


def test_numbers_of_a_check_have_the_decimal_of_its_uncertainty(tmp_path: Path) -> None:
    """In the unit that is shown; terms of u_val have one more, a limit loses nothing."""
    one = ONE._replace(part="check", value=9.041e-5, sd=7.1e-5)
    parts = {"limit": 4.1e-4, "margin": 1.82169e-4, "u_num": 6.1775e-5, "raw": 1.74662e-4}
    others = [one._replace(part=f"check.{k}", value=v, sd=None) for k, v in parts.items()]
    of = table(one, *others)
    view = replace(view_of("checks"), below="")
    heads, line = read(view, of)
    at = dict(zip(heads, line, strict=True))
    wanted = {"E": "0.09", "2 u_val": "0.14", "limit": "0.41", "margin": "0.18", "raw rms": "0.17",
              "u_num": "0.062"}  # fmt: skip
    assert {k: at[f"{k} / mm"] for k in wanted} == wanted
    save(filled(view, of), of, tmp_path / "checks.csv")
    save(filled(view, of), of, tmp_path / "checks.tex")
    row = (tmp_path / "checks.csv").read_text().splitlines()[1].split(",")
    assert [row[heads.index(f"{k} / mm")] for k in wanted] == list(wanted.values())
    assert all(f"${v}$" in (tmp_path / "checks.tex").read_text() for v in wanted.values())
    micro = dict(zip(*read(replace(view, unit="µm"), of), strict=True))
    assert (micro["E / µm"], micro["2 u_val / µm"]) == ("90", "140")
    exact = table(one, one._replace(part="check.limit", value=4.15e-4, sd=None))
    assert "0.415" in read(view, exact)[1]


# --- a view that shows nothing, units of sentences, files of charts -------------------------------


@pytest.mark.parametrize("form", ["table", "lines", "points", "heat", "intervals", "sentences"])
@pytest.mark.parametrize("quantity", ["tap", "tip"])
def test_a_view_without_a_row_draws_nothing_and_names_the_condition(
    form: str, quantity: str, tmp_path: Path
) -> None:
    """Of another quantity, or without the numbers that it draws."""
    if form in ("table", "sentences") and quantity == "tip":
        return  # a row without a number is a line of these
    x = "at" if form in ("lines", "points") else "method"
    view = View("f", "F", {"part": "score", "quantity": quantity}, form, x=x, by="kind", text="a")  # type: ignore[arg-type]
    # Charts leave out rows without a number at once, and need one across, too
    one = ONE._replace(value=1.0 if x == "at" else None)
    rows = table(one, one, one._replace(quantity="side"))
    found = explained(view, rows)
    (why,) = found.words
    assert figures(found, rows) == []
    assert ("quantity = 'tap'; nearest: tip" in why) == (quantity == "tap")
    assert terminal(found, 200)[1:] == [why]
    with pytest.raises(UsageError, match=re.escape(why)):
        save(found, rows, tmp_path / "f.svg")


def test_sentences_and_intervals_are_in_the_unit_that_is_asked_for() -> None:
    rows = table(ONE._replace(value=2e-3, sd=1e-3, part="check"))
    said = View("s", "S", {}, "sentences", text="{value}, {expanded}", unit="µm")
    assert [w.replace("\u202f", "") for w in filled(said, rows).words] == ["2000 µm, 2000 µm"]
    (bars,) = filled(View("i", "I", {}, "intervals", x="method", unit="µm"), rows).intervals
    assert bars.texts[0].replace("\u202f", "").startswith("2000 µm ± 2000 µm")


def test_what_is_drawn_is_written_as_numbers(tmp_path: Path) -> None:
    """The points of a chart, the cells of a heat and the texts of intervals."""
    of = whole()
    out = tmp_path / "x.csv"
    chart = View("f", "Force", {"part": "sample", "role": ""}, "lines", x="drives", by="label")
    save(filled(chart, sampled()), sampled(), out)
    assert out.read_text().splitlines()[:2] == [
        "series,style,x: stage / mm,y: force / N,upper: force / N", "measured,points,0.0,0.0,",
    ]  # fmt: skip
    rows = table(*(ONE._replace(method=m, variation=v, value=x) for m, v, x in
                   (("a", "1", 1e-3), ("a", "2", 2e-3), ("b", "2", 3e-3))))  # fmt: skip
    save(filled(View("m", "M", {}, "heat", x="variation", by="method"), rows), rows, out)
    assert out.read_text().splitlines() == ["method,variation,tip / mm", "a,1,1.0", "a,2,2.0",
                                            "b,1,", "b,2,3.0"]  # fmt: skip
    save(explained(view_of("limits"), of), of, out)
    assert len(out.read_text().splitlines()) == 1 + len(of.where(part="check").rows)
    with pytest.raises(UsageError, match=r"\.svg, \.pdf, .* \.html \(a chart\)"):
        save(filled(chart, sampled()), sampled(), tmp_path / "x.tex")


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_script_finds_every_name_that_the_command_lists(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VALIDATE_NO_GL", "1")
    folder = write_report(replace(small_result(), exhibits=(shows(),)), tmp_path / "cube",
                          created="2026-01-01").parent  # fmt: skip
    plot = plots_of(folder)
    listed = CliRunner().invoke(cli, ["show", str(folder)]).output.splitlines()[1:]
    assert [line.split()[0] for line in listed] == list(plot)
    assert {"checks", "steps", "force", "limits"} <= set(plot)
    assert isinstance(plot.checks(), ShownView)
    parts = [name for name in plot if name.startswith("traces_")]
    assert len(plot.traces().figures()) == len(parts) == 3  # type: ignore[union-attr]
    assert {"difference", "difference_force_plate"} <= set(plot)
    assert all(getattr(plot, name)().axes for name in (*parts, "difference", "body"))
