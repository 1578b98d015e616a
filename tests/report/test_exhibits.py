"""Exhibits: sections, legible charts, honest tables and files; results over time in every place."""

import csv
import json
import pickle
from collections.abc import Callable, Sequence
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any

import cloudpickle
import jsonschema
import numpy as np
import pandas as pd
import pytest
from report_samples import no_gl, parts_of, sections_of, small_result
from tracking_samples import AT, STEPS, WHY, T, failed_result, swing, tracking_result

from validate.checksums import unsealed
from validate.compare.exhibit import Chart, NodeMap, NumberTable, Series, plain
from validate.compare.result import Result
from validate.errors import ComparisonError
from validate.recording.mcap.read import read_recording
from validate.report.charts.style import encoded
from validate.report.exhibits import DrawnExhibit, draw_all, drawing, in_turn
from validate.report.export.fields import open_fields, write_fields
from validate.report.export.tables import caption, sheet, word_columns
from validate.report.export.tables import shown as read
from validate.report.page.html import page
from validate.report.scenes import gl
from validate.report.scenes.body_scene import at_times, held
from validate.report.scenes.maps import TOWARD_EYE, facing, ranges, screen, values
from validate.report.sections.observations import holds
from validate.report.sections.verdicts import band
from validate.report.stored.exhibit_rows import rounded, thinned
from validate.report.stored.json_values import write_json
from validate.report.stored.store import document, schema
from validate.report.write import write_report
from validate.scene.geometries.box import box

CREATED = "2026-11-21T04:00:00Z"


@pytest.fixture(scope="module")
def result() -> Result:
    return tracking_result()


@pytest.fixture(scope="module")
def folder(result: Result, tmp_path_factory: pytest.TempPathFactory) -> Path:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("VALIDATE_NO_GL", "1")
        path = write_report(result, tmp_path_factory.mktemp("track") / "box", created=CREATED)
    return path.parent


def sections(result: Result) -> dict[str, DrawnExhibit]:
    drawn = draw_all(result, sections_of(result))
    return {d.exhibit.anchor: d for d in drawn if d.shown}


def elsewhere(
    function: Callable[[Any, Any], Any], shared: Any, items: Sequence[Any]
) -> Callable[[], list[Any]]:
    """As workers do: all that is given and that comes back is sent."""

    def sent(*objects: Any) -> Any:
        return pickle.loads(cloudpickle.dumps(objects))

    return lambda: [sent(function(*sent(shared, item)))[0] for item in items]


@pytest.mark.usefixtures("drawn_figures")
def test_parts_drawn_by_workers_are_those_drawn_here(
    result: Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VALIDATE_NO_GL", "1")
    few = ("checks", "maps", "registration")
    parts = [at for at in parts_of(result) if at[1].anchor in few]
    there, here_ = (drawing(result, parts, beside)() for beside in (elsewhere, in_turn))
    assert [d.exhibit.anchor for d in there] == [d.exhibit.anchor for d in here_]
    assert sum(len(d.exhibit.maps) for d in there) > 0
    for one, same in zip(here_, there, strict=True):
        for here, other in zip(one.pictures, same.pictures, strict=True):
            a, b = encoded(here), encoded(other)
            assert (a.name, a.caption, a.file, a.uri) == (b.name, b.caption, b.file, b.uri)


@pytest.fixture(scope="module")
def made(result: Result) -> dict[str, DrawnExhibit]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("VALIDATE_NO_GL", "1")
        return sections(result)


def table(section: DrawnExhibit, begins: str) -> NumberTable:
    return next(t for t in section.exhibit.tables if caption(t).startswith(begins))


# --- sections ------------------------------------------------------------------------------------


def test_exhibits_follow_the_checks(made: dict[str, DrawnExhibit]) -> None:
    assert list(made)[:3] == ["checks", "displacements", "maps"]
    assert len(made["displacements"].pictures) == 3


def test_sections_that_need_loads_are_absent(made: dict[str, DrawnExhibit]) -> None:
    assert set(made) >= {"body", "methods", "scores", "registration", "recording"}
    assert not {"markers", "outlines", "curves"} & set(made)


def test_results_without_exhibits_have_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VALIDATE_NO_GL", "1")
    assert list(sections(small_result()))[:2] == ["checks", "curves"]


@pytest.mark.slow
def test_a_failed_result_still_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VALIDATE_NO_GL", "1")
    failed = failed_result()
    text = unescape(page(failed, sections(failed).values(), CREATED, band(failed)))
    assert f"refused at step 0: {WHY}" in text
    assert "diverged at step 12: u beyond 1e3 m" in text


def test_side_by_side_has_units_and_no_rate_of_a_refusal(made: dict[str, DrawnExhibit]) -> None:
    rows = table(made["methods"], "How each method ended").rows
    assert [[read(c) for c in (row[1], row[4], row[5])] for row in rows] == [
        ["kf", "166\u202f667", "0.00900"], ["loop", "2.38", "500"], ["euler", "–", "–"],
        ["large", "100\u202f000", "0.0200"],
    ]  # fmt: skip
    heads = table(made["methods"], "How each method ended").headings
    assert heads[4:6] == ("rate / Hz", "p99 of a step / ms")


def test_errors_over_time_stand_beside_those_of_the_recording(
    made: dict[str, DrawnExhibit],
) -> None:
    measured = table(made["methods"], "Errors against the recording")
    assert measured.headings == ("method", "node_B rms / mm")
    truth = table(made["methods"], "Errors against the truth over the whole time")
    assert truth.headings[:2] == ("method", "quantity")
    expected = 1e3 * 0.02 * np.sqrt((swing(T) ** 2).mean())
    at = [h.partition(" / ")[0] for h in truth.headings].index("rmse")
    first = next(row for row in truth.rows if plain(row[1]) == "node_A")
    assert plain(first[at]) == pytest.approx(expected, rel=0.01)
    assert "explicit Euler" not in {plain(row[0]) for row in truth.rows}  # it was refused


def test_scores_without_a_load_are_listed(made: dict[str, DrawnExhibit]) -> None:
    found = table(made["scores"], "Scores over the whole run")
    assert found.headings[:3] == ("quantity", "statistic", "unit")
    names = {".".join(str(plain(c)) for c in row[:2]) for row in found.rows}
    assert {"node_A.mae", "node_D.max"} <= names
    assert not any(str(row[0]).startswith(("step", "setup")) for row in found.rows)


def test_body_at_its_largest_displacement(made: dict[str, DrawnExhibit]) -> None:
    (picture,) = made["body"].pictures
    largest = T[AT][np.abs(swing(T[AT])).argmax()]
    assert f"t = {largest:.4f} s: displacement" in picture.caption


def test_number_table_rounds_and_names_what_is_missing(made: dict[str, DrawnExhibit]) -> None:
    found = table(made["displacements"], "Errors against the twin's truth. explicit Euler")
    assert word_columns(found) == (0, 1)
    assert [read(c) for c in found.rows[0][2:]] == ["0.0123", "166\u202f667", "1\u202f200"]
    assert [read(c) for c in found.rows[1][2:]] == ["–", "–", "0"]


def test_long_texts_stand_below_their_row() -> None:
    long = "the largest displacement there, rms over all of the time"
    rows = (("first of all, a name that is longer than others", 1.0, long, "near"),
            ("b", 2.0, None, "far"))  # fmt: skip
    found = NumberTable("t", "T", ("name", "E / mm", "limit from", "why"), rows, below="why")
    read_as = sheet(found)
    assert read_as.columns == (0, 1, 2)
    assert read_as.texts[0][2] == "the largest displacement ther…"
    assert read_as.below == (f"near; limit from: {long}", "far")
    both = sheet(replace(found, rows=(rows[0], (*rows[1][:2], long, None))))
    assert both.columns == (0, 1)  # a column of long texts goes altogether
    assert both.below[1] == f"limit from: {long}"
    assert sheet(replace(found, below="")).columns == (0, 1, 2, 3)
    assert sheet(replace(found, below="")).below == ()
    assert sheet(replace(found, rows=())).columns == (0, 1, 2)


def test_frames_are_told_from_loads(result: Result) -> None:
    follows, soft = result.methods[0], small_result().methods[0]
    assert not holds(follows.registered[0])
    assert [i.hold.label for i in held(soft.registered[0], soft.run) if i.hold] == ["0mm", "2mm"]
    few = at_times(follows.registered[0], follows.run, np.array([0.0, 0.5, 1.2]))
    assert [i.t for i in few] == pytest.approx([0.001, 0.5, 1.2], abs=0.005)
    assert all(i.computed and i.hold is None for i in few)


# --- maps ----------------------------------------------------------------------------------------


def test_maps_of_one_scale_share_their_colours_in_the_unit_shown() -> None:
    mesh = box((0.1, 0.1, 0.1), (1, 1, 1))
    ramp = mesh.nodes[:, 0]
    maps = [
        NodeMap("b", "b", mesh, 3 * ramp, "m", "s"), NodeMap("a", "a", mesh, ramp, "m", "s"),
        NodeMap("c", "c", mesh, ramp - 0.02, "m"), NodeMap("d", "d", mesh, 0 * ramp, "mm"),
    ]  # fmt: skip
    found = ranges(maps)
    assert found["s"] == pytest.approx((0.0, 300.0))
    assert found["c"] == pytest.approx((-80.0, 80.0))
    assert found["d"] == (0.0, 1.0)
    assert values(maps[1]).max() == pytest.approx(100.0)


def test_captions_of_maps_have_units(made: dict[str, DrawnExhibit]) -> None:
    one, other = made["maps"].pictures
    assert one.caption.startswith("Kalman filter: rms error, mm: 0 to 0.01 at 64 nodes")
    assert "Mean error along x, mm: −0.01 to 0.01" in other.caption


@pytest.mark.slow
@pytest.mark.usefixtures("drawn_figures")
def test_maps_are_rendered_where_gl_is(result: Result, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("VALIDATE_NO_GL", raising=False)
    if not gl.available():
        no_gl()
    from validate.report.scenes.panels import rendered

    shown_map = result.exhibits[1].maps[0]
    low = rendered(shown_map, (0.0, 0.01)).pixels
    high = rendered(replace(shown_map, values=shown_map.values / 2), (0.0, 0.01)).pixels
    assert low.shape == high.shape
    assert (low != high).any()
    white = (low == 255).all(axis=2)
    moved = white[:, :700] != (high == 255).all(axis=2)[:, :700]
    assert moved.mean() < 1e-3  # smoothed edges only: the camera does not follow the numbers


# --- files ---------------------------------------------------------------------------------------


def test_files(folder: Path) -> None:
    names = {p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()}
    assert names >= {
        "figures/chart_displacement_node_A.png", "figures/map_error_kf.png",
        "tables/errors_by_node.csv", "tables/chart_nis.csv", "replay.mcap",
    }  # fmt: skip


def test_tables_and_charts_as_csv(folder: Path) -> None:
    with (folder / "tables" / "errors_by_node.csv").open(newline="", encoding="utf-8") as lines:
        head, first, second = csv.reader(lines)
    assert head == ["method", "node", "RMSE / mm", "rate / Hz", "times"]
    assert float(first[2]) == 0.0123456
    assert second[2:] == ["", "", "0"]
    path = folder / "tables" / "chart_displacement_node_A.csv"
    with path.open(newline="", encoding="utf-8") as lines:
        rows = list(csv.DictReader(lines))
    assert list(rows[0]) == ["series", "style", "x: time / s", "y: u_x / mm", "upper: u_x / mm"]
    reference = [float(r["y: u_x / mm"]) for r in rows if r["series"] == "reference (twin)"]
    np.testing.assert_array_equal(reference, 1e3 * swing(T))


def test_every_table_and_curve_opens_in_pandas(folder: Path, made: dict[str, DrawnExhibit]) -> None:
    """Columns have names, numbers are numbers; every chart of the page has its curves."""
    files = {path.stem: pd.read_csv(path) for path in (folder / "tables").glob("*.csv")}
    assert len(files) > 4
    for name, frame in files.items():
        assert len(frame.columns) > 1, name
        assert not any("Unnamed" in str(c) for c in frame.columns), name
        numbers = frame.select_dtypes("number").to_numpy()
        assert not np.isinf(numbers).any(), name
    charts = {chart.name: chart for d in made.values() for chart in d.exhibit.charts}
    assert charts
    assert {f"chart_{name}" for name in charts} <= set(files)
    for name, chart in charts.items():
        frame = files[f"chart_{name}"]
        curves = {series.label: len(series.x) for series in chart.series}
        levels = {label: 1 for label, _ in chart.levels}
        assert frame.groupby("series", sort=False).size().to_dict() == curves | levels, name


def test_names_must_differ(result: Result, tmp_path: Path) -> None:
    first, *others = result.exhibits
    curves = NumberTable("streams", "mine", ("a",), ())
    bare = replace(first, charts=(), tables=(curves,))
    with pytest.raises(ComparisonError, match="2 tables 'streams'"):
        write_report(replace(result, exhibits=(bare, *others)), tmp_path / "box", created=CREATED)
    twice = (first, replace(first, anchor="again", tables=()))
    with pytest.raises(ComparisonError, match="2 charts 'displacement_node_A'"):
        draw_all(result, twice)


def test_document_is_valid_and_small(result: Result, tmp_path: Path) -> None:
    content = document(result, CREATED)
    jsonschema.Draft202012Validator(schema()).validate(content)
    kf, _, euler, large = content["methods"]
    assert (kf["traces_at"], len(kf["t"]), len(kf["traces"]["nis"]["y"])) == (
        "output frames", len(AT), len(AT),
    )  # fmt: skip
    assert kf["traces"]["node_A.x"]["y"][7] == pytest.approx(0.98 * swing(T)[AT[7]], rel=1e-6)
    assert (euler["rate_hz"], euler["step_s"], euler["t"]) == (None, None, [])
    assert (large["traces_at"], len(large["t"])) == ("every step", 12)
    first = content["exhibits"][0]
    assert [c["name"] for c in first["charts"]] == ["displacement_node_A", "rate_error", "nis"]
    assert first["tables"][0]["rows"][1] == ["explicit Euler", "node_A", None, None, 0]
    write_json(content, tmp_path / "r.json")
    text = (tmp_path / "r.json").read_text(encoding="utf-8")
    assert unsealed(json.loads(text)) == content
    assert len(text) < 250_000
    assert max(text.count("\n"), 1) < 3_000


def test_long_and_many_series_stay_below_two_megabytes(result: Result, tmp_path: Path) -> None:
    t = np.linspace(0, 10, 20_000)
    line = tuple(Series(f"s{i}", t, np.sin(t + i)) for i in range(8))
    many = tuple(Chart(f"c{i}", "c", "t / s", "u / mm", line) for i in range(20))
    exhibit = replace(result.exhibits[0], charts=many)
    write_json(document(replace(result, exhibits=(exhibit,)), CREATED), tmp_path / "r.json")
    assert (tmp_path / "r.json").stat().st_size < 1_200_000


def test_many_methods_share_the_traces(result: Result) -> None:
    kf = result.methods[0]
    many = tuple(replace(kf, name=f"m{i}", accepted=False) for i in range(60))
    content = document(replace(result, methods=many), CREATED)
    found = [m for m in content["methods"] if m["traces_at"] == "output frames"]
    assert len(found) == 60
    values_kept = sum(len(trace["y"]) for m in found for trace in m["traces"].values())
    assert 20_000 < values_kept <= 62_000


def test_thinning_keeps_the_extremes() -> None:
    y = np.random.default_rng(0).standard_normal(5003)
    at = thinned(y, 400)
    assert len(at) <= 400
    assert (np.diff(at) > 0).all()
    assert y[at].min() == y.min()
    assert y[at].max() == y.max()
    assert rounded(np.array([1 / 3])) == [0.3333333]
    assert thinned(np.zeros(6), 6).tolist() == [0, 1, 2, 3, 4, 5]  # none too many


def test_fields_hold_every_step_and_the_sd(result: Result, tmp_path: Path) -> None:
    pytest.importorskip("h5netcdf")
    (tmp_path / "runs").mkdir()
    write_fields(result, tmp_path / "runs")
    with open_fields(tmp_path, "kf") as stored:
        assert stored.sd.shape == stored.u.shape == (len(AT), 64, 3)
        np.testing.assert_array_equal(stored["trace:node_A.x"], 0.98 * swing(T))
        assert len(stored["trace:nis"]) == len(stored.time) == STEPS
    with open_fields(tmp_path, "euler") as stored:
        assert stored.u.shape == (0, 64, 3)
        assert "sd" not in stored


def test_replay_shows_frames_at_their_own_times(folder: Path) -> None:
    path = folder / "replay.mcap"
    assert path.stat().st_size < 1_500_000
    replay = read_recording(path)
    simulated = replay.markers["/markers/simulated"]
    np.testing.assert_allclose(np.diff(simulated.t), np.diff(T[AT]), atol=1e-9)
    moved = simulated.x[:, 0, 0] - 0.1
    np.testing.assert_allclose(moved, 0.98 * swing(T[AT]), atol=1e-9)
    assert np.isnan(replay.markers["/markers/measured"].x).any()
    assert replay.signals["/push/measured"].unit == "N"
    told = replay.metadata["validate.pipeline"]
    assert told["interpolated"] == "nothing: output frames keep their times"
    assert f"of {len(AT)} output frames" in told["thinned"]


def test_page_is_small(folder: Path) -> None:
    assert (folder / "report.html").stat().st_size < 1_500_000


def test_facets_that_face_the_eye_are_half_of_a_box() -> None:
    mesh = box((0.1, 0.1, 0.1), (2, 2, 2))
    _, facets = facing(mesh, TOWARD_EYE)
    assert len(facets) == len(mesh.surface) // 2
    right, upward = screen(TOWARD_EYE)
    frame = np.stack([right, upward, TOWARD_EYE])
    assert frame @ frame.T == pytest.approx(np.eye(3), abs=1e-12)
