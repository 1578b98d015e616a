"""The long table: written and read back exactly in both forms, queried lazily, never edited."""

import gzip
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from report_samples import small_result

from validate.compare.residual import Residual
from validate.compare.row import POINT, LongRow
from validate.compare.score import Score
from validate.errors import ComparisonError, RecordingError, UsageError
from validate.report import StoredTables
from validate.report.export import parquet
from validate.report.export.parquet import column_types
from validate.report.export.table_file import CSV, PARQUET, stored_table, write_long_table
from validate.report.long_table import (
    LongTable,
    checks_of,
    content_of,
    frame,
    long_table,
)
from validate.report.stored import tables as stored_tables
from validate.report.stored.json_values import write_json
from validate.report.stored.store import document

CREATED = "2026-11-21T04:00:00Z"
FORMS = [True, False]  # with and without pyarrow


@pytest.fixture(params=FORMS, ids=["parquet", "csv"])
def form(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    if request.param:
        pytest.importorskip("pyarrow")
    monkeypatch.setattr(parquet, "available", lambda: request.param)
    return PARQUET if request.param else CSV


def sample() -> LongTable:
    result = small_result()
    points = {m.name: m.residuals for m in result.methods}
    return long_table(document(result, CREATED), "cube", points)


def kept(folder: Path, table: LongTable) -> Path:
    """A report folder with results.json and the table."""
    folder.mkdir(parents=True)
    write_json(document(small_result(), CREATED), folder / "results.json")
    return write_long_table(table, folder)


TEXT = st.text(st.characters(codec="utf-8", exclude_characters="\x00"), max_size=8)
VALUES = {
    str: TEXT,
    float: st.none() | st.floats(allow_nan=False),
    int: st.none() | st.integers(-(2**63), 2**63 - 1),
}
ROWS = st.tuples(*(VALUES[kind] for kind in column_types().values())).map(LongRow._make)


@given(st.lists(ROWS, max_size=6))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_what_is_written_is_read_back_exactly(
    form: str, tmp_path_factory: pytest.TempPathFactory, rows: list[LongRow]
) -> None:
    folder = tmp_path_factory.mktemp("run")
    head = {"kind": "measured", "methods": [{"name": "é\n"}], "sha256 of": "0" * 64}
    ordered = sorted(rows, key=lambda r: r.part == POINT)
    assert write_long_table(LongTable(head, tuple(rows)), folder).name == form
    found = stored_table(folder)
    assert found.head == head
    assert [r._replace(run="") for r in found.rows] == [r._replace(run="") for r in ordered]
    assert {r.run for r in found.rows} <= {folder.name}


def test_a_run_is_read_back_with_its_points(form: str, tmp_path: Path) -> None:
    table = sample()
    assert kept(tmp_path / "cube", table).name == form
    found = stored_table(tmp_path / "cube")
    assert found == table
    result = small_result()
    for method in result.methods:
        for residual in method.residuals.values():
            points = found.where(part=POINT, method=method.name, quantity=residual.quantity)
            values = np.array([r.value for r in points.rows]).reshape(residual.values.shape)
            assert values.tolist() == residual.values.tolist()
            assert {(r.sd, r.unit, r.role) for r in points.rows} == {
                (residual.sd, residual.unit, residual.role)
            }


def test_points_over_time_have_their_times_and_axes() -> None:
    """Those of a hold keep its load, and components without a name their number."""
    values = np.array([[1.0, 2.0], [3.0, 4.0]])
    over_time = Residual("tip", "all", values, 0.0, 0.0, "m", "", t=np.array([0.5, 0.7]),
                         axes=("x", "z"))  # fmt: skip
    at_hold = Residual("tip", "2s", values, 0.0, 0.0, "m", "")
    both = {r.name: r for r in (over_time, at_hold)}
    content = {"experiment": "one", "methods": [{"name": "fem"}]}
    rows = long_table(content, "one", {"fem": both}).where(part=POINT).rows
    assert [(r.at, r.axis, r.value) for r in rows] == [
        (0.5, "x", 1.0), (0.5, "z", 2.0), (0.7, "x", 3.0), (0.7, "z", 4.0),
        (2.0, "1", 1.0), (2.0, "2", 2.0), (2.0, "1", 3.0), (2.0, "2", 4.0),
    ]  # fmt: skip
    with pytest.raises(ComparisonError, match=r"tip@all: \(3,\) times of 2 values"):
        replace(over_time, t=np.zeros(3))


def test_names_units_and_answers_are_columns() -> None:
    table = sample()
    (score,) = table.where(part="score", method="soft", quantity="force.plate",
                           statistic="simulated").rows  # fmt: skip
    assert score.name == "force.plate.simulated@2mm"
    assert (score.at, score.unit, score.kind, score.role) == (0.002, "N", "force", "validates")
    names = {s.name for m in small_result().methods for s in m.scores}
    assert {r.name for r in table.where(part="score").rows} == names
    checks = [c for m in small_result().methods for c in m.checks]
    found = list(checks_of(table.rows))
    assert [(c["name"], c["value"], c["u_val"], c["u_D"], c["limit"], c["verdict"], c["margin"])
            for c in found] == [
        (c.name, c.value, c.u_val, c.u_D, c.limit, c.verdict, c.margin) for c in checks
    ]  # fmt: skip


def test_recordings_and_changed_parameters_are_labels() -> None:
    content = document(small_result(), CREATED)
    changed = [{"path": "material.E", "value": 9e4}, {"path": "body.cells", "value": 6}]
    (row, *_) = long_table(content | {"changed": changed}, "cube").rows
    assert row.variation == "material.E=90000.0; body.cells=6"
    one, two = ({"recording": name} for name in ("a", "b"))
    found = [long_table(content | {"domain": d}, "x").rows[0].recording
             for d in ([], [one, one], [one, two])]  # fmt: skip
    assert found == ["", "a", "all"]


def test_results_json_follows_from_the_rows() -> None:
    """Scores, checks and printed figures, digit by digit."""
    result = small_result()
    odd = Score("force.rms@2mm", float("inf"), "N", 3, "none", "x")
    soft, stiff = result.methods
    check = soft.checks[0]
    open_limit = replace(check, limit=None, requirement="none declared", u_num=float("inf"),
                         acceptance="no requirement")  # fmt: skip
    methods = (replace(soft, scores=(*soft.scores, odd), checks=(check, open_limit)), stiff)
    content = document(replace(result, methods=methods), CREATED)
    again = content_of(long_table(content, "cube"))
    assert again["published"] == content["published"]
    for key in ("scores", "checks", "outcome", "accepted"):
        assert [m[key] for m in again["methods"]] == [m[key] for m in content["methods"]]
    assert {k: content[k] for k in again if k not in ("methods",)} == {
        k: v for k, v in again.items() if k not in ("methods",)
    }


def test_each_printed_figure_has_its_own_numbers() -> None:
    one = small_result().published[0]
    figures = (one, replace(one, name="second", ours=7.0, theirs=None),
               replace(one, name="a setting", ours=None, setting=True))  # fmt: skip
    content = document(replace(small_result(), published=figures), CREATED)
    assert content_of(long_table(content, "cube"))["published"] == content["published"]


def test_a_run_without_a_table_has_the_rows_of_its_results(form: str, tmp_path: Path) -> None:
    kept(tmp_path / "cube", sample())
    new = stored_table(tmp_path / "cube")
    (tmp_path / "cube" / form).unlink()
    old = stored_table(tmp_path / "cube")
    assert old.head == new.head
    assert old.rows == tuple(
        r._replace(role="") if r.part in ("score", "effect") else r
        for r in new.rows
        if r.part != POINT
    )


def test_an_edited_or_damaged_table_is_not_believed(form: str, tmp_path: Path) -> None:
    path = kept(tmp_path / "cube", sample())
    data = path.read_bytes()
    plain = gzip.decompress(data) if form == CSV else data
    at = plain.index(b"measured recording" if form == CSV else b'"experiment"') + 3
    edited = plain[:at] + bytes([plain[at] ^ 1]) + plain[at + 1 :]
    for bad in (
        gzip.compress(edited) if form == CSV else edited,
        data[: len(data) // 2],
        b"",
        b"x",
    ):
        path.write_bytes(bad)
        with pytest.raises(RecordingError, match=rf"cube/{form}: ignored \("):
            stored_table(tmp_path / "cube")


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_one_expression_asks_every_stored_run(
    form: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """The rms of every marker of every method of every stored run."""
    for run, size in (("a", 1.0), ("b", 2.0)):
        marker = LongRow(run, "cube", method="fem", part="score", quantity="marker.inplane",
                         statistic="rms", condition="9mm", at=0.009, value=size * 1e-3,
                         unit="m")  # fmt: skip
        rows = (marker, marker._replace(statistic="max"), marker._replace(quantity="force"),
                marker._replace(part="check"), marker._replace(method="kf"))  # fmt: skip
        kept(tmp_path / run, LongTable({"kind": "twin", "methods": [{"name": "fem"}]}, rows))
    (kept(tmp_path / "damaged", sample())).write_bytes(b"x")
    pytest.importorskip("pandas")
    store = StoredTables.open(tmp_path)
    found = store.where(part="score", quantity="marker.*", statistic="rms").to_pandas()
    assert found[["run", "method", "value"]].values.tolist() == [
        ["a", "fem", 1e-3], ["a", "kf", 1e-3], ["b", "fem", 2e-3], ["b", "kf", 2e-3],
    ]  # fmt: skip
    assert f"damaged/{form}: ignored" in caplog.text
    assert len(list(StoredTables.open(tmp_path / "a").rows())) == 5
    one = StoredTables.open(tmp_path).where(run="b", method=("fem", "none"), at=0.009, part="score")
    assert [r.quantity for r in one.where(statistic="m*").rows()] == ["marker.inplane"]


def test_nothing_is_read_before_rows_are_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And then one run at a time."""
    read: list[str] = []
    for run in ("a", "b"):
        kept(tmp_path / run, sample())

    def noted(folder: Path, **labels: Any) -> LongTable:
        read.append(folder.name)
        return stored_table(folder, **labels)

    monkeypatch.setattr(stored_tables, "stored_table", noted)
    query = StoredTables.open(tmp_path).where(statistic="rms")
    assert read == []
    next(iter(query))
    assert read == ["a"]


def test_an_unknown_column_and_folder_are_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no column 'statstic'; nearest: statistic"):
        StoredTables.open(tmp_path).where(statstic="rms")
    with pytest.raises(UsageError, match="no folder of stored runs"):
        StoredTables.open(tmp_path / "none")


def test_names_with_brackets_are_texts() -> None:
    rows = (LongRow(quantity="field[1]"), LongRow(quantity="field1"))
    assert LongTable({}, rows).where(quantity="field[1]").rows == rows[:1]


def test_a_missing_library_is_one_line_with_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import sys

    pytest.importorskip("pyarrow")
    kept(tmp_path / "cube", sample())
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(UsageError, match=r"results.parquet.*install.*tables"):
        stored_table(tmp_path / "cube")
    with pytest.raises(UsageError, match=r"needs pandas.*install.*tables"):
        frame(())


def test_a_folder_of_something_else_has_no_rows(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    kept(tmp_path / "cube", sample())
    others: dict[str, dict[str, Any]] = {
        "summary": {"sentence": ""}, "study": {"experiment": "x", "methods": []},
        "odd": {"kind": "twin"},
    }  # fmt: skip
    for name, content in others.items():
        (tmp_path / name).mkdir()
        write_json(content, tmp_path / name / "results.json")
    assert [t.rows[0].run for t in StoredTables.open(tmp_path)] == ["cube"]
    assert caplog.messages == ["odd: its results cannot be read: KeyError('experiment')"]
