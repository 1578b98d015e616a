"""Stored runs side by side: what is shared is compared, nothing shared is refused."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

from validate.checksums import sealed
from validate.commands.arguments import BAD_INPUT
from validate.commands.main import run
from validate.errors import ComparisonError, UsageError
from validate.report.export.table_file import stored_table, write_long_table
from validate.report.long_table import content_of
from validate.study.stored_runs.score_comparison import pairs, read_run, read_table, side_by_side


def stored(folder: Path, **changes: Any) -> Path:
    """A report folder with a results.json as runs write it."""
    scores = [_score("node_A.rmse", 2e-3), _score("nis.per_dof", 1.5, "1")]
    content: dict[str, Any] = {
        "experiment": "kf_cube",
        "created": "2026-01-02T03:04:05+00:00",
        "quick": False,
        "inputs": [{"path": "kf.mcap", "sha256": "a" * 64, "bytes": 3}],
        "parameters": {"material.E": {"value": 1e4, "unit": "Pa"}},
        "methods": [{"name": "kf", "scores": scores}],
    }
    folder.mkdir(parents=True)
    (folder / "results.json").write_text(
        json.dumps(sealed({**content, **changes})), encoding="utf-8"
    )
    return folder


def _score(name: str, value: float | None, unit: str = "m") -> dict[str, Any]:
    return {"name": name, "value": value, "unit": unit, "count": 9}


def method(name: str, *scores: dict[str, Any]) -> list[dict[str, Any]]:
    return [{"name": name, "scores": list(scores)}]


def test_shared_scores_with_differences_and_changed_parameters(tmp_path: Path) -> None:
    one = stored(tmp_path / "one")
    other = stored(
        tmp_path / "other",
        methods=method("kf", _score("node_A.rmse", 3e-3), _score("node_B.rmse", 1.0)),
        parameters={"material.E": {"value": 12e3, "unit": "Pa"}},
    )
    found = side_by_side([read_run(one), read_run(other / "results.json")])
    assert [(r.method, r.score, r.values) for r in found.rows] == [
        ("kf", "node_A.rmse", (2e-3, 3e-3))
    ]
    assert found.rows[0].differences == pytest.approx((0.0, 1e-3))
    assert found.rows[0].changes == pytest.approx((0.0, 0.5))
    assert found.parameters == {"material.E": ("10000 Pa", "12000 Pa")}
    assert found.warnings == ()


def test_other_recordings_units_and_experiments_are_said(tmp_path: Path) -> None:
    one = stored(tmp_path / "one")
    other = stored(
        tmp_path / "other",
        experiment="ekf_cube",
        inputs=[{"path": "x", "sha256": "b" * 64, "bytes": 1}],
        methods=method("kf", _score("node_A.rmse", 3.0, "mm"), _score("nis.per_dof", 1.0, "1")),
    )
    found = side_by_side([read_run(one), read_run(other)])
    assert [r.score for r in found.rows] == ["nis.per_dof"]
    said = " | ".join(found.warnings)
    for words in ("different experiments", "aaaaaaaaaaaa", "bbbbbbbbbbbb", "m and in mm"):
        assert words in said


def test_scores_are_matched_where_no_method_is(tmp_path: Path) -> None:
    one = stored(tmp_path / "one")
    other = stored(tmp_path / "other", methods=method("ekf", _score("node_A.rmse", 1e-3)))
    found = side_by_side([read_run(one), read_run(other)])
    assert found.columns == ("one: kf", "other: ekf")
    assert [(r.score, r.values) for r in found.rows] == [("node_A.rmse", (2e-3, 1e-3))]


def test_nothing_shared_is_no_comparison(tmp_path: Path) -> None:
    one = stored(tmp_path / "one")
    for i, other in enumerate((method("kf", _score("force", 1.0, "N")), [],
                               method("kf", _score("node_A.rmse", None)),
                               method("kf", _score("node_A.rmse", 1.0, "Pa")))):  # fmt: skip
        folder = stored(tmp_path / str(i), methods=other)
        with pytest.raises(ComparisonError, match="nothing compared"):
            side_by_side([read_run(one), read_run(folder)])
    with pytest.raises(UsageError, match="two or more"):
        side_by_side([read_run(one)])


def test_what_is_no_stored_run_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one = stored(tmp_path / "one")
    bad = tmp_path / "bad.json"
    bad.write_text("[1, 2", encoding="utf-8")
    for path in (tmp_path / "absent", bad, tmp_path):
        assert run(["compare", str(one), str(path)]) == BAD_INPUT
        assert capsys.readouterr().err.count("\n") == 1
    empty = stored(tmp_path / "empty", methods=[])
    assert run(["compare", str(one), str(empty)]) == BAD_INPUT
    assert "0 scores shared" in capsys.readouterr().err


def test_the_command_prints_a_table_or_one_document(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = [str(stored(tmp_path / name)) for name in ("one", "two")]
    assert run(["compare", *runs]) == 0
    text = capsys.readouterr().out
    assert "node_A.rmse" in text
    assert re.search(r"kf +node_A.rmse +2.00 +2.00 +0 +mm", text)
    assert "No parameter differs" in text
    assert run(["compare", *runs, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["columns"] == ["one", "two"]
    assert told["scores"][0]["differences"] == [0.0, 0.0]


def many(folder: Path, experiment: str, *names: str) -> Path:
    """A run of 14 methods, the last two accepted, with long score names and settings each."""
    scores = [_score("node_B.nees.per_dof@stiff_model_200Hz", 1.23456e-7, "1"),
              _score("corner.rmse@stiff_model_200Hz", 1.5e-3)]  # fmt: skip
    methods = [
        {"name": n, "accepted": n in names[-2:], "scores": scores if i else scores[:1]}
        for i, n in enumerate(names)
    ]
    settings = {f"methods.{n}.Q": {"value": 1e-9 * len(experiment), "unit": "m2"} for n in names}
    settings["material.E"] = {"value": 1e3 * len(experiment), "unit": "Pa"}
    return stored(folder, experiment=experiment, methods=methods, parameters=settings)


def printed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *runs: Path
) -> list[str]:
    """Lines of the command on a terminal of 100 columns."""
    monkeypatch.setenv("COLUMNS", "100")
    assert run(["compare", *map(str, runs)]) == 0
    return capsys.readouterr().out.splitlines()


def test_runs_without_a_shared_method_fit_a_terminal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    names = [[f"{kind}_filter_{i}" for i in range(14)] for kind in ("first", "second")]
    runs = many(tmp_path / "one", "kf", *names[0]), many(tmp_path / "other", "ekf", *names[1])
    lines = printed(monkeypatch, capsys, *runs)
    assert not [line for line in lines if len(line) > 100 and not line.endswith("/report.html")]
    heads = [line.strip() for line in lines if line.startswith("One:")]
    assert heads == [f"One: one: first_filter_{i}; other: other: second_filter_{i}"
                     for i in (12, 13)]  # fmt: skip
    for score in ("node_B.nees.per_dof@stiff_model_200Hz", "corner.rmse@stiff_model_200Hz"):
        assert sum(line.startswith(f"{score} ") for line in lines) == 2  # on one line each
    assert "left out: 194 pairs of methods; --all, --method, --score or --json show them" in lines
    text = "\n".join(lines)
    assert re.search(r"material.E +2000 Pa +3000 Pa", text)
    assert "methods." not in text


def test_runs_that_share_methods_fit_a_terminal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = [many(tmp_path / n, n, "shared_filter", f"of_{n}") for n in ("kf", "ekf", "other")]
    lines = printed(monkeypatch, capsys, *runs)
    assert not [line for line in lines if len(line) > 100 and not line.endswith("/report.html")]
    assert [x.strip() for x in lines if x.startswith("One:")] == [
        "One: kf; other: ekf", "One: kf; other: other",
    ]  # fmt: skip
    rows = [line.split()[:2] for line in lines if "nees" in line]
    assert rows == [["shared_filter", "node_B.nees.per_dof@stiff_model_200Hz"]] * 2
    text = "\n".join(lines)
    assert "methods.shared_filter.Q" in text
    assert "methods.of_" not in text


def test_scores_that_the_first_run_lacks_are_counted(tmp_path: Path) -> None:
    both = method("kf", _score("node_A.rmse", 3e-3), _score("node_B.rmse", 4e-3))
    folders = [stored(tmp_path / "a")] + [stored(tmp_path / n, methods=both) for n in "bc"]
    shown, more, unseen = pairs(side_by_side([read_run(f) for f in folders]))
    assert [(p.one, p.other, [r.values for r in p.rows]) for p in shown] == [
        ("a", "b", [(2e-3, 3e-3)]), ("a", "c", [(2e-3, 3e-3)]),
    ]  # fmt: skip
    assert (more, unseen) == (0, 1)


def test_a_run_reads_alike_from_its_table_and_from_its_results(tmp_path: Path) -> None:
    """A table beside results.json holds the scores; a run of an older version has none."""
    folder = stored(tmp_path / "one")
    old, content = read_run(folder), content_of(read_table(folder))
    assert content["methods"][0]["scores"][0]["value"] == 2e-3
    write_long_table(stored_table(folder), folder)
    (folder / "results.json").write_text("not read")
    assert read_run(folder) == read_run(folder / "results.json") == old
    assert content_of(read_table(folder)) == content
    copied = tmp_path / "copy.json"
    copied.write_text(json.dumps(sealed({"experiment": "x"})))
    with pytest.raises(UsageError, match=r"not a results\.json of validate"):
        read_run(copied)
