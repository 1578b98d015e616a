"""A statement over stored runs: which count, which of their checks, and what they say together."""

import csv
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import here, refused

from validate.checksums import sealed, unsealed
from validate.errors import UsageError
from validate.report.export import parquet
from validate.report.export.table_file import stored_table, write_long_table
from validate.report.export.tables import shown
from validate.study.stored_runs.summary import (
    _ROWS,
    Summary,
    _against,
    _points,
    document,
    predictions,
    stored_runs,
    summary,
)

# private: _ROWS: a limit or list of the code, which the test must meet exactly.
# private: _against, _points: called alone, case by case.


def check(simulated: float, measured: float = 10.0, **more: Any) -> dict[str, Any]:
    found = {
        "name": "force@3mm", "value": simulated - measured, "u_val": 0.5, "u_D": 0.3,
        "u_num": 0.0, "u_input": 0.4, "unit": "N", "count": 1, "verdict": "good enough",
        "validation": "not distinguishable",
        "kind": "force", "size": {"measured": measured, "simulated": simulated, "u": 0.3},
    }  # fmt: skip
    return {**found, **more}


def stored(reports: Path, name: str, *checks: dict[str, Any], **more: Any) -> None:
    """A run of one recording, called as its folder, of one accepted method."""
    specimen = more.pop("specimen", name)
    content = {
        "experiment": "pressed", "kind": "measured", "created": "2026-11-01T12:00:00+00:00",
        "inputs": [{"path": f"{name}.csv", "sha256": name.ljust(64, "0")}],
        "methods": [{"name": "fem", "accepted": True, "checks": list(checks)}],
        "domain": [{"recording": name, "specimen": specimen, "strain": 0.1, "rate": 0.01,
                    "sides": [0.03, 0.05]}],
        **more,
    }  # fmt: skip
    (reports / name).mkdir(parents=True)
    (reports / name / "results.json").write_text(json.dumps(sealed(content)), encoding="utf-8")


def whys(reports: Path) -> dict[str, str]:
    return {run.folder: run.why for run in stored_runs(reports)}


def only(found: Summary) -> Any:
    (kind,) = found.kinds
    return kind


def test_three_specimens_say_what_their_ratios_say(tmp_path: Path) -> None:
    for name, by in (("a", 1.0), ("b", 1.1), ("c", 1.2)):
        stored(tmp_path, name, check(10 * by))
    kind = only(summary(tmp_path))
    logs = np.log([1.0, 1.1, 1.2])
    scatter = np.sqrt(logs.var(ddof=1) - 0.03**2)
    assert kind.stated.scatter.value == pytest.approx(scatter)
    assert kind.stated.bias.value == pytest.approx(
        np.exp(logs.mean() + scatter**2 / 2 - 0.03**2 / 2)
    )
    assert (kind.kind, kind.stated.points, kind.stated.specimens) == ("force", 3, 3)
    assert kind.covered.strain == (0.1, 0.1)
    assert kind.covered.sides == (0.03, 0.05)


def test_what_is_no_evidence_does_not_count_and_says_why(tmp_path: Path) -> None:
    stored(tmp_path, "good", check(11.0))
    stored(tmp_path, "quick", check(30.0), quick=True)
    stored(tmp_path, "doubtful", check(30.0), warnings=["E of 15 Pa: 15 kPa?"])
    stored(tmp_path, "same", check(30.0), kind="same model")
    stored(tmp_path, "forced", check(30.0), made={"command": "validate run pressed --anyway"})
    stored(tmp_path, "old", check(30.0))
    path = tmp_path / "old" / "results.json"
    content = json.loads(path.read_text())
    del content["domain"]
    path.write_text(json.dumps(sealed(content)))
    stored(tmp_path, "turned", check(30.0), kind="twin")
    path = tmp_path / "turned" / "results.json"
    path.write_text(path.read_text().replace('"kind": "twin"', '"kind": "measured"'))
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "results.json").write_text('{"kind": "meas')
    found = whys(tmp_path)
    assert found.pop("good") == ""
    assert {name: why.split(":")[0] for name, why in found.items()} == {
        "quick": "a quick run", "doubtful": "warning",
        "same": "recording and model are the same model",
        "forced": "predicted with parameters that are not identifiable (option --anyway)",
        "old": "stored by an older version, without sizes; run it again",
        "turned": "turned/results.json",
        "broken": "broken/results.json",
    }  # fmt: skip
    assert only(summary(tmp_path)).stated.bias.value == pytest.approx(1.1, rel=0.001)


def test_fitted_checks_never_enter(tmp_path: Path) -> None:
    stored(
        tmp_path, "a", check(11.0), check(10.0, verdict="fitted"),
        check(10.0, verdict="same model"), check(10.0, count=0), check(10.0, u_num=None),
        check(10.0, size=None), check(10.0, kind=""),
        check(0.9, 1.0, size={"measured": 1.0, "simulated": 0.9, "u": 0.3}),
        check(12.0, name="force@6mm", verdict="differs", validation="differs"),
        check(13.0, name="force@9mm", verdict="undecided"),
    )  # fmt: skip
    found, left = predictions(stored_runs(tmp_path))
    assert [p.check for p in found] == ["force@3mm", "force@6mm", "force@9mm"]
    assert sum(left.values()) == 7
    assert left["fitted"] == 1
    assert left["measured with an uncertainty above 25 %"] == 1


def test_the_first_accepted_method_counts(tmp_path: Path) -> None:
    methods = [
        {"name": "rival", "accepted": False, "checks": []},
        {"name": "slip", "accepted": True, "checks": [check(11.0)]},
        {"name": "bonded", "accepted": True, "checks": [check(15.0)]},
    ]
    stored(tmp_path, "a", methods=methods)
    (found,), left = predictions(stored_runs(tmp_path))
    assert found.method == "slip"
    assert left == {"from another method on the same data": 1}


def test_other_settings_on_the_same_recording_are_no_other_experiment(tmp_path: Path) -> None:
    changed = [{"path": "material.E", "value": 9e4}]
    inputs = [{"path": "log.csv", "sha256": "1" * 64}]
    new = "2026-11-09T12:00:00+00:00"
    stored(tmp_path, "pressed", check(11.0), inputs=inputs)
    stored(tmp_path, "pressed+E", check(19.0), inputs=inputs, changed=changed, created=new)
    stored(tmp_path, "pressed+copy", check(12.0), inputs=inputs, created=new,
           changed=[{"path": "recording", "value": "log.csv"}])  # fmt: skip
    assert whys(tmp_path) == {
        "pressed": "the same recordings as pressed+copy, which is used because it is newer",
        "pressed+E": "the same recordings as pressed+copy, which is used because it has fewer "
        "changed settings",
        "pressed+copy": "",
    }
    assert only(summary(tmp_path)).points[0].simulated == 12.0


def test_repeats_of_one_specimen_count_once(tmp_path: Path) -> None:
    for name, simulated in (("r1", 11.0), ("r2", 13.0)):
        stored(tmp_path, name, check(simulated), specimen="beam")
    heavier = [{"path": "load.mass", "value": 0.052}]
    stored(tmp_path, "r3", check(14.0), specimen="beam", changed=heavier)
    stored(tmp_path, "r4", check(10.0), specimen="another")
    kind = only(summary(tmp_path))
    found = {(p.specimen, p.simulated): p.folders for p in kind.points}
    assert found == {
        ("beam", 12.0): ("r1", "r2"), ("beam", 14.0): ("r3",), ("another", 10.0): ("r4",),
    }  # fmt: skip
    assert (kind.stated.points, kind.stated.specimens) == (3, 2)


def test_twins_and_units_stand_apart(tmp_path: Path) -> None:
    stored(tmp_path, "a", check(11.0), check(11.0, name="pull@3mm", unit="force unit"))
    stored(tmp_path, "t", check(30.0), kind="twin")
    found = summary(tmp_path)
    assert [(k.kind, k.covered.unit) for k in found.kinds] == [
        ("force", "N"), ("force", "force unit"),
    ]  # fmt: skip
    assert [p.simulated for k in found.kinds for p in k.points] == [11.0, 11.0]
    assert [p.simulated for k in found.twins for p in k.points] == [30.0]


def test_a_wrong_sign_is_said_and_has_no_ratio(tmp_path: Path) -> None:
    stored(tmp_path, "a", check(11.0))
    stored(tmp_path, "b", check(-2.0))
    kind = only(summary(tmp_path))
    assert kind.stated is None
    assert kind.why == (
        "1 of 2 predictions have the wrong sign (pressed: force@3mm): a ratio is not possible"
    )
    json.dumps(document(summary(tmp_path)), allow_nan=False)


def test_the_area_stands_beside_the_error(tmp_path: Path) -> None:
    stored(tmp_path, "a", check(11.0))
    (point,) = document(summary(tmp_path))["measured"][0]["predictions"]
    assert (point["error"], point["u_val"]) == (1.0, 0.5)
    assert point["area"] == pytest.approx(1.0, abs=1e-6)  # sd 0.4 and 0.3, 1.0 apart


def test_nothing_that_counts_is_refused_with_the_reason(tmp_path: Path) -> None:
    stored(tmp_path, "a", check(11.0), quick=True)
    line = refused("summary", "--out", str(tmp_path))
    assert "counts (a: a quick run); `validate run silicone_beam` makes one" in line
    with pytest.raises(UsageError, match="0 runs"):
        summary(tmp_path / "nowhere")


@pytest.mark.slow
def test_the_command_prints_and_draws_all_of_it(tmp_path: Path) -> None:
    for name, by in (("a", 1.0), ("b", 1.1), ("c", 1.2)):
        size = {"measured": 2e-3, "simulated": 2e-3 * by, "u": 1e-5}
        tip = check(2e-3 * by, 2e-3, name="tip@3mm", unit="m", kind="displacement", size=size)
        stored(tmp_path, name, check(10 * by), tip)
    stored(tmp_path, "q", check(10.0), quick=True)
    code, out, err = here("summary", "--out", str(tmp_path))
    assert code == 0, err
    assert "force +10 %, 8.6 % scatter beyond the measurements' (3 of 3)" in " ".join(out.split())
    assert "3 of 4 stored runs count" in out
    assert "q: a quick run" in out
    folder = tmp_path / "summary"
    page = (folder / "report.html").read_text("utf-8")
    assert all(f"{kind}: predicted against measured" in page for kind in ("displacement", "force"))
    figures = {"chart_against_1.png", "chart_against_2.png"}
    assert {p.name for p in (folder / "figures").iterdir()} == figures
    again = json.loads(here("summary", "--out", str(tmp_path), "--json")[1])
    with (folder / "tables" / "predictions.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    points = [p for kind in again["measured"] for p in kind.pop("predictions")]
    assert [float(r["E"]) for r in rows] == [p["error"] for p in points]
    assert again == unsealed(json.loads((folder / "results.json").read_text("utf-8")))
    assert [run["folder"] for run in again["runs"]] == ["a", "b", "c", "q"]


@pytest.mark.parametrize("form", [True, False], ids=["parquet", "csv"])
def test_a_stored_table_says_the_same_and_is_not_believed_where_it_is_edited(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, form: bool
) -> None:
    if form:
        pytest.importorskip("pyarrow")
    monkeypatch.setattr(parquet, "available", lambda: form)
    for name, by in (("a", 1.0), ("b", 1.1), ("c", 1.2)):
        stored(tmp_path, name, check(10 * by), check(10.0, verdict="fitted"))
    old = document(summary(tmp_path))
    for folder in tmp_path.iterdir():
        path = write_long_table(stored_table(folder), folder)
        (folder / "results.json").write_text("not read")
    assert document(summary(tmp_path)) == old
    path.write_bytes(path.read_bytes()[:-9])
    assert [bool(run.why) for run in stored_runs(tmp_path)].count(True) == 1


def test_a_chart_of_a_thousand_experiments_names_the_first(tmp_path: Path) -> None:
    stored(tmp_path, "a", check(11.0))
    (kind,) = summary(tmp_path).kinds
    (point,) = kind.points
    many = replace(kind, points=tuple(replace(point, experiment=f"e{i}") for i in range(1000)))
    labels = [s.label for s in _against(1, many).series if s.style == "points"]
    assert labels == [*(f"e{i}" for i in range(28)), "972 other experiments"]


def test_a_chart_shows_prediction_against_measurement_with_both_bands(tmp_path: Path) -> None:
    stored(tmp_path, "a", check(11.0))
    (kind,) = summary(tmp_path).kinds
    assert kind.stated is not None
    drawn = {(s.label, s.style): s for s in _against(1, kind).series}
    (point,) = kind.points
    points = drawn[point.experiment, "points"]
    by = 1e3 if kind.covered.unit == "m" else 1.0
    assert points.x.tolist() == pytest.approx([by * point.measured])
    assert points.y.tolist() == pytest.approx([by * point.simulated])
    models = drawn["bias of the models", "line"]
    assert models.y / models.x == pytest.approx(kind.stated.bias.value)
    band = drawn["measured = predicted, ± 2 sd", "band"]
    assert band.upper is not None
    assert band.upper / band.x == pytest.approx(np.exp(2 * kind.stated.own))


@pytest.mark.parametrize(("least", "log"), [(0.5, ""), (0.001, "xy")])
def test_a_chart_is_logarithmic_where_an_axis_has_two_powers_of_ten(
    tmp_path: Path, least: float, log: str
) -> None:
    stored(tmp_path, "a", check(11.0))
    (kind,) = summary(tmp_path).kinds
    (point,) = kind.points
    small = replace(point, measured=least * point.measured, simulated=least * point.simulated)
    assert _against(1, replace(kind, points=(point, small))).log == log


def test_a_page_shows_the_largest_errors_and_a_file_all(tmp_path: Path) -> None:
    points = [check(10.0 + i / 100, name=f"force@{i + 1}mm") for i in range(_ROWS + 5)]
    stored(tmp_path, "a", *points)
    page, data = _points("predictions", summary(tmp_path).kinds)
    assert (len(page.rows), len(data.rows)) == (_ROWS, _ROWS + 5)
    assert {row[1] for row in data.rows} - {row[1] for row in page.rows} == {
        f"force@{i}mm" for i in range(1, 6)
    }


def test_an_error_and_its_u_val_have_one_decimal(tmp_path: Path) -> None:
    stored(tmp_path, "a", check(10.123))
    page, _ = _points("predictions", summary(tmp_path).kinds)
    (row,) = page.rows
    texts = [shown(row[page.headings.index(name)]) for name in ("E", "u_val")]
    decimals = {len(text.partition(" ")[0].partition(".")[2]) for text in texts}
    assert len(decimals) == 1, texts


def test_a_summary_loads_no_solver_and_no_kernel(tmp_path: Path) -> None:
    """They take 110 MB, and nothing is run; pandas takes 42 MB."""
    stored(tmp_path, "a", check(11.0))
    write_long_table(stored_table(tmp_path / "a"), tmp_path / "a")
    code = (
        "import sys, validate.commands.summary, validate.report.exhibits\n"
        "from pathlib import Path\n"
        "from validate.study.stored_runs.summary import summary\n"
        "assert summary(Path(sys.argv[1])).kinds\n"
        "print([m for m in ('numba', 'skfem', 'shapely', 'pandas', 'dask') if m in sys.modules])"
    )
    command = [sys.executable, "-c", code, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
