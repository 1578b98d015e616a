"""`validate compare` of many scores: filtered, sorted, drawn, in 40 lines of 80 columns."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from command_line import here, refused
from PIL import Image
from test_stored import method, stored

from validate.errors import UsageError
from validate.study.stored_runs.score_comparison import (
    SORTS,
    Row,
    narrowed,
    ordered,
    read_run,
    side_by_side,
)


def score(name: str, value: float, unit: str = "m") -> dict[str, Any]:
    return {"name": name, "value": value, "unit": unit, "count": 9}


def two(folder: Path, count: int = 60) -> tuple[str, str]:
    """Runs of two methods with so many scores; score i of the other run is i per cent larger."""
    made = []
    for name, per_cent in (("one", 0.0), ("other", 0.01)):
        scores = [
            score(f"node_{i}.rmse@stiff_model_200Hz", 1e-3 * (1 + per_cent * i))
            for i in range(count)
        ]
        scores.append(score("step.p50", 1e-5 * (1 + 1e3 * per_cent), "s"))
        methods = method("kf_printed", *scores) + method("fem", *scores[:3])
        parameters = {f"p{i}": {"value": i + per_cent, "unit": "m"} for i in range(30)}
        made.append(stored(folder / name, methods=methods, parameters=parameters))
    return str(made[0]), str(made[1])


def test_one_screen_of_80_columns_and_the_largest_change_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = "validate.commands.compare.write_comparison"  # has a test of its own
    monkeypatch.setattr(page, lambda found, document, folder: folder / "report.html")
    runs = two(tmp_path / "Läufe hier")
    code, out, err = here("compare", *runs, cwd=tmp_path, COLUMNS="80")
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert len(lines) <= 26
    assert "largest change: kf_printed: node_59.rmse@stiff_model_200Hz, +59 %" in " ".join(
        out.split()
    )
    assert max(len(line) for line in lines if "report.html" not in line) <= 80
    rows = [line for line in lines if line.startswith("kf_printed") and "node_" in line]
    assert rows[0].split()[:2] == ["kf_printed", "node_59.rmse@stiff_model_200Hz"]
    assert "+59 %" in rows[0].replace(".0", "")
    shown = [int(row.split("node_")[1].split(".")[0]) for row in rows]
    assert shown == sorted(shown, reverse=True)
    assert f"left out: {64 - len(rows)} scores; --all" in out
    assert "22 more: see --all" in out
    whole = here("compare", *runs, "--all", cwd=tmp_path, COLUMNS="80")[1]
    assert whole.count("node_") == 64
    assert "step.p50" in whole
    assert "left out" not in whole


@pytest.mark.slow
def test_the_page_lies_beside_the_first_run_and_has_its_picture(tmp_path: Path) -> None:
    runs = two(tmp_path / "runs", 3)
    out = here("compare", *runs, cwd=tmp_path)[1]
    (folder,) = (tmp_path / "runs").glob("compare-one-*")
    assert f"runs/{folder.name}/report.html" in out
    with Image.open(folder / "figures" / "changes_1.png") as image:
        assert image.width > 800
    assert "kf_printed" in (folder / "tables" / "scores.csv").read_text("utf-8")
    assert json.loads((folder / "results.json").read_text("utf-8"))["columns"] == ["one", "other"]
    here("compare", *runs, "--score", "node*", cwd=tmp_path)
    here("compare", *runs, cwd=tmp_path)
    assert len(list((tmp_path / "runs").glob("compare-one-*"))) == 2


def test_a_closed_place_costs_the_pictures_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def closed(*_: object) -> None:
        raise UsageError("cannot write there")

    runs = two(tmp_path, 2)
    monkeypatch.setattr("validate.commands.compare.try_results", closed)
    code, out, err = here("compare", *runs, cwd=tmp_path)
    assert (code, err) == (0, "validate: no charts: cannot write there\n")
    assert "node_1.rmse" in out
    assert "report.html" not in out
    assert here("compare", *runs, "--out", str(tmp_path / "x"), cwd=tmp_path)[0] == 2


def test_a_change_of_rounding_is_none(tmp_path: Path) -> None:
    runs = [
        str(stored(tmp_path / n, methods=method("kf", score("a", v), score("b", w))))
        for n, v, w in (("one", 1.0, 1.0), ("other", 1.0 + 5e-10, 1.0 + 2e-9))
    ]
    rows = {line.split()[1]: line for line in here("compare", *runs)[1].splitlines()
            if line.startswith("kf ")}  # fmt: skip
    assert "rounding" in rows["a"]
    assert "+2" in rows["b"]


def test_json_is_one_document_and_writes_nothing_unasked(tmp_path: Path) -> None:
    runs = two(tmp_path, 2)
    options = ("--method", "kf*", "--score", "node_*", "--sort", "score", "--json")
    code, out, err = here("compare", *runs, *options, cwd=tmp_path)
    assert (code, err) == (0, "")
    assert [(s["method"], s["score"]) for s in json.loads(out)["scores"]] == [
        ("kf_printed", "node_0.rmse@stiff_model_200Hz"),
        ("kf_printed", "node_1.rmse@stiff_model_200Hz"),
    ]
    assert {p.name for p in tmp_path.iterdir()} == {"one", "other"}
    assert "nearest: kf_printed" in refused("compare", *runs, "--method", "kf_print", cwd=tmp_path)
    assert "--score x* matches none of 3" in refused(
        "compare", *runs, "--score", "x*", cwd=tmp_path
    )


def test_patterns_cut_runs_down(tmp_path: Path) -> None:
    one, _ = narrowed([read_run(Path(p)) for p in two(tmp_path, 4)], ["f*"], ["*.rmse*"])
    assert one.methods == ("fem",)
    assert set(one.scores) == {("fem", f"node_{i}.rmse@stiff_model_200Hz") for i in range(3)}


def test_orders_by_hand(tmp_path: Path) -> None:
    found = side_by_side([read_run(Path(p)) for p in two(tmp_path, 2)])
    rows = (
        Row("b", "x.rmse", "m", (1.0, 1.5)),
        Row("a", "step.p50", "s", (1.0, 9.0)),
        Row("a", "x.rmse", "m", (2.0, 1.4)),
        Row("a", "y.rmse", "m", (0.0, 0.1)),
        Row("c", "z.rmse", "m", (None, 4.0)),
    )

    def order(sort: str) -> list[int]:
        return [rows.index(r) for r in ordered(replace(found, rows=rows), sort).rows]

    assert order("change") == [3, 0, 2, 4, 1]
    assert order("difference") == [2, 0, 3, 4, 1]
    assert order("score") == [1, 2, 0, 3, 4]
    assert order("method") == [1, 2, 3, 0, 4]
    assert order("stored") == [0, 1, 2, 3, 4]
    assert set(SORTS) == {"change", "difference", "score", "method", "stored"}
