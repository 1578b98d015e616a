"""`validate history`, as a user meets it: 80 columns, one document, one line where nothing is."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from command_line import here, refused
from report_samples import small_result

from validate.parameters import Changed
from validate.report.stored.environment import Commit, Made
from validate.report.stored.json_values import write_json
from validate.report.stored.store import document


@pytest.fixture
def reports(tmp_path: Path) -> Path:
    """Two runs of an experiment whose file is gone, in a folder that can only be read."""
    folder = tmp_path / "Meßwerte ü"
    result = small_result()
    moved = replace(result.methods[0].checks[0], value=0.3)
    changed = replace(
        result,
        changed=(Changed("material.E", 1e4, 1.4e4, "Pa"),),
        parameters=(replace(result.parameters[0], default=1.4e4), *result.parameters[1:]),
        methods=(replace(result.methods[0], checks=(moved,)), *result.methods[1:]),
    )
    for i, (name, run) in enumerate((("cube", result), ("cube+material.E-123456", changed))):
        (folder / name).mkdir(parents=True)
        by = Made("validate run cube", Commit("abcdef012345" * 3, dirty=bool(i)), None, "a" * 64)
        content = document(run, f"2026-11-2{i}T04:00:00+00:00", by)
        write_json(content, folder / name / "results.json")
    folder.chmod(0o555)
    return folder


def test_runs_and_what_changed_at_80_columns(reports: Path, tmp_path: Path) -> None:
    code, out, err = here("history", "cube", "--out", str(reports), cwd=tmp_path)
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert max(map(len, lines[1:])) <= 80
    text = " ".join(out.split())
    assert "1. 2026-11-20 04:00 UTC, cube: good enough; evidence: 1 of 1 checks" in text
    assert "differs: nothing; commit abcdef0123 figures:" in text
    assert "soft: force.plate@2mm 0.01000 N (2 u_val 0.04000 N)" in text
    assert "differs: material.E 10000 -> 14000 Pa; commit abcdef0123, with changes" in text
    since = text.partition("since 1:")[2]
    assert "parameter material.E: 10000 Pa -> 14000 Pa" in since
    assert "code: commit abcdef0123 -> abcdef0123, with changes" in since
    assert "moved: soft: force.plate@2mm 0.01000 N -> 0.3000 N (20.5 u)" in since


def test_a_run_with_fewer_methods_names_them(reports: Path, tmp_path: Path) -> None:
    (reports / "cube+material.E-123456").rename(reports / "cube+methods+material.E-123456")
    text = " ".join(here("history", "cube", "--out", str(reports), cwd=tmp_path)[1].split())
    assert "differs: methods soft, stiff, material.E 10000 -> 14000 Pa;" in text


def test_json_is_one_document(reports: Path, tmp_path: Path) -> None:
    code, out, err = here("history", "cube.py", "--out", str(reports), "--json", cwd=tmp_path)
    assert (code, err) == (0, "")
    found = json.loads(out)
    assert [r["folder"] for r in found["runs"]] == ["cube", "cube+material.E-123456"]
    (change,) = found["changes"]
    assert (change["from"], change["to"]) == (1, 2)
    assert change["moved"][0]["name"] == "force.plate@2mm"


def test_an_experiment_without_runs_is_one_line(tmp_path: Path) -> None:
    assert "nearest: kf_cube" in refused("history", "kf_cub", cwd=tmp_path)
    assert "start one with `validate run kf_cube`" in refused("history", "kf_cube", cwd=tmp_path)
