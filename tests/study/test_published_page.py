"""The page of printed figures: rows of what was checked now and before, and their differences."""

import csv
import json
import re
from pathlib import Path
from typing import Any

import pytest

from validate.compare.published import Published
from validate.report.stored.store import figure_members
from validate.report.stored.tables import StoredTables
from validate.study.stored_runs.published_page import write_published
from validate.study.stored_runs.summary import stored_runs

Json = dict[str, Any]


def figure(name: str, ours: float | None, theirs: float | None, **more: Any) -> Json:
    tolerance = None if theirs is None else 0.05 * theirs
    claim = more.pop("claim", "reproduced")
    return figure_members(
        Published(name, ours, theirs, tolerance, "m", claim, "a reason", "Table 1", **more)
    )


def entry(name: str, *published: Json, holds: bool = True) -> Json:
    return {
        "experiment": name, "title": name.upper(), "source": f"paper of {name}", "holds": holds,
        "checked": "2026-11-28T09:00:00+00:00", "published": list(published),
    }  # fmt: skip


def rows(reports: Path, table: str) -> list[dict[str, str]]:
    with (reports / "published" / "tables" / f"{table}.csv").open() as file:
        return list(csv.DictReader(file))


def test_results_are_counted_and_settings_are_not(tmp_path: Path) -> None:
    near, far = figure("drop", 1.0, 1.01), figure("rise", 2.0, 1.0)
    mass = figure("mass", 1.0, 1.0, setting=True)
    page = write_published(tmp_path, [entry("bar", near, far, mass, holds=False)])
    assert page is not None
    document = json.loads((page.parent / "results.json").read_text("utf-8"))
    assert [e["experiment"] for e in document["experiments"]] == ["bar"]
    (row,) = rows(tmp_path, "experiments")
    assert row["printed results"] == "1 reproduced, 1 not reproduced"
    assert row["declared verdicts"] == "does not hold"
    text = page.read_text("utf-8")
    assert "2 printed results of 1 experiments" in text
    assert "1 no longer hold" in text
    assert "a reason" in text


def test_what_was_checked_before_stays_until_it_is_checked_again(tmp_path: Path) -> None:
    write_published(tmp_path, [entry("bar", figure("drop", 1.0, 1.01)), entry("none")])
    later = entry("cube", figure("side", 3.0, 3.0)) | {"checked": "2026-11-29T10:00:00+00:00"}
    write_published(tmp_path, [later])
    times = {r["experiment"]: r["checked, UTC"] for r in rows(tmp_path, "experiments")}
    assert times == {"bar": "2026-11-28 09:00", "cube": "2026-11-29 10:00"}
    write_published(tmp_path, [entry("bar", figure("drop", 2.0, 1.01))])
    found = {r["experiment"]: r["printed results"] for r in rows(tmp_path, "experiments")}
    assert found == {"bar": "1 not reproduced", "cube": "1 reproduced"}


def test_differences_are_shares_of_the_tolerance_with_their_side(tmp_path: Path) -> None:
    shown = [
        figure("near", 1.02, 1.0), figure("far", 0.5, 1.0, claim="not reproduced"),
        figure("alone", 1.0, None, claim="not comparable"), figure("mass", 1.0, 1.0, setting=True),
    ]  # fmt: skip
    page = write_published(tmp_path, [entry("bar", *shown)])
    assert page is not None
    text = page.read_text("utf-8")
    lines = text.partition('<table class="forest">')[2].partition("</table>")[0]
    assert lines.index(">far<") < lines.index(">near<")
    assert not {"alone", "mass"} & set(re.findall(r"[a-z]+", lines))
    assert lines.count('class="dot below"') == 1


def test_a_report_is_linked_where_it_is_stored(tmp_path: Path) -> None:
    (tmp_path / "bar").mkdir()
    (tmp_path / "bar" / "report.html").write_text("", "utf-8")
    shown = figure("drop", 1.0, 1.0)
    page = write_published(tmp_path, [entry("bar", shown), entry("cube", shown)])
    assert page is not None
    text = page.read_text("utf-8")
    assert 'href="../bar/report.html"' in text
    assert "../cube/report.html" not in text


def test_without_a_printed_figure_there_is_no_page(tmp_path: Path) -> None:
    assert write_published(tmp_path, [entry("bar")]) is None
    assert list(tmp_path.iterdir()) == []


def test_the_page_is_no_run(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    write_published(tmp_path, [entry("bar", figure("drop", 1.0, 1.0))])
    assert stored_runs(tmp_path) == ()
    assert list(StoredTables.open(tmp_path)) == []
    assert not caplog.messages


def test_a_damaged_page_is_told_and_written_anew(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write_published(tmp_path, [entry("bar", figure("drop", 1.0, 1.01))])
    file = tmp_path / "published" / "results.json"
    file.write_text(file.read_text("utf-8")[:40], "utf-8")
    write_published(tmp_path, [entry("cube", figure("side", 3.0, 3.0))])
    assert "left out" in caplog.messages[0]
    assert [r["experiment"] for r in rows(tmp_path, "experiments")] == ["cube"]
