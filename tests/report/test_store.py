"""results.json: valid against its schema, SI, no NaN, no places; runs readable without pickle."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from report_samples import CHECK, bare_result, small_result

from validate.compare.exhibit import TableCell
from validate.compare.residual import Residual
from validate.compare.result import Result
from validate.compare.score import Score
from validate.errors import UsageError
from validate.report.export.fields import open_fields, write_fields
from validate.report.sections.discrimination import noise_rows
from validate.report.sections.registration import registration
from validate.report.stored.environment import without_folder
from validate.report.stored.json_values import write_json
from validate.report.stored.store import Json, document, schema

CREATED = "2026-11-21T04:00:00Z"


def checked(result: Result) -> Json:
    content = document(result, CREATED)
    jsonschema.Draft202012Validator(schema()).validate(content)
    return content


def test_schema_is_a_schema() -> None:
    jsonschema.Draft202012Validator.check_schema(schema())


def test_content() -> None:
    content = checked(small_result())
    soft = content["methods"][0]
    assert soft["outcome"] == {"state": "finished", "step": 21, "why": ""}
    assert soft["rate_hz"] == pytest.approx(1 / 2e-5)
    assert soft["checks"][0]["u_val"] == 0.02
    assert soft["traces"]["stage.force"]["y"][-1] == pytest.approx(4.0)
    assert soft["traces"]["stage.force"]["unit"] == "N"
    assert soft["published"][0]["ours"] == 4.0
    assert content["methods"][1]["published"] == []
    assert [r["recording"] for r in soft["further_runs"]] == ["cube_b"]
    assert content["parameters"]["material.E"] == {
        "value": 1e4, "unit": "Pa", "origin": "default",
    }  # fmt: skip


def test_every_table_shows_the_root_mean_square() -> None:
    """Three points by hand, each of two components: in the file, at rest, and over the noise."""
    values = np.array([[3.0, 4.0], [0.0, 0.0], [0.0, -5.0]])
    seen = Residual("force.plate", "2mm", values, 0.3, 0.4, "N", "plate force")
    rms = np.sqrt(50 / 3)
    method = replace(small_result().methods[0], residuals={seen.name: seen})
    result = replace(small_result(), methods=(method,), rest=(seen,))
    assert document(result, CREATED)["rest"][0]["rms"] == pytest.approx(rms)
    shown = registration(result)
    assert shown is not None
    (row,) = next(t for t in shown.tables if "noise" in str(t.headings)).rows
    sizes = [cell.value for cell in row if isinstance(cell, TableCell)]
    assert sizes == pytest.approx([rms, 5.0, np.sqrt(2) * 0.3])
    ((_, ratio),) = noise_rows(result)[0].ratios
    assert ratio == pytest.approx(rms / np.sqrt(2 * (0.3**2 + 0.4**2)))


def test_unfinished_method_is_valid() -> None:
    method = checked(bare_result())["methods"][0]
    assert method["outcome"]["state"] == "not_converged"
    assert method["step_s"] is None
    assert method["rate_hz"] is None


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_values_that_are_not_finite_become_null_with_a_reason(bad: float, tmp_path: Path) -> None:
    result = small_result()
    score = Score("x.rms@2mm", bad, "m", 3, "none", "made up")
    method = replace(result.methods[0], scores=(score,))
    content = checked(replace(result, methods=(method,)))
    found = content["methods"][0]["scores"][0]
    assert found["value"] is None
    assert "not finite" in found["why"]
    write_json(content, tmp_path / "r.json")
    assert "NaN" not in (tmp_path / "r.json").read_text()
    assert "Infinity" not in (tmp_path / "r.json").read_text()


def test_check_that_compared_nothing_has_no_numbers() -> None:
    nothing = replace(CHECK, count=0, validation="nothing compared",
                      acceptance="nothing compared", why="compared nothing: diverged")  # fmt: skip
    result = small_result()
    method = replace(result.methods[0], checks=(nothing,))
    found = checked(replace(result, methods=(method,)))["methods"][0]["checks"][0]
    assert found["value"] is None
    assert found["u_val"] is None
    assert found["count"] == 0


def test_no_folders() -> None:
    text = json.dumps(document(small_result(), CREATED))
    assert "private" not in text
    assert "cube_a.mcap" in text


@pytest.mark.parametrize(
    ("value", "shown"),
    [("/a/b/log.csv", "log.csv"), (r"C:\a\log.csv", "log.csv"), ("a/log.csv", "a/log.csv"),
     ("", ""), (3, 3)],
)  # fmt: skip
def test_places_of_either_system_are_not_told(value: object, shown: object) -> None:
    assert without_folder(value) == shown


def test_schema_refuses_a_wrong_verdict() -> None:
    content = document(small_result(), CREATED)
    content["methods"][0]["checks"][0]["verdict"] = "passed"
    with pytest.raises(jsonschema.ValidationError, match="passed"):
        jsonschema.validate(content, schema())


def test_fields_are_arrays_with_dimensions_and_units(tmp_path: Path) -> None:
    pytest.importorskip("h5netcdf")
    result = small_result()
    (tmp_path / "runs").mkdir()
    write_fields(result, tmp_path / "runs")
    names = {"soft.nc", "soft_2.nc", "stiff.nc", "stiff_2.nc"}
    assert {f.name for f in (tmp_path / "runs").iterdir()} == names
    first, second = result.methods[0].runs
    with open_fields(tmp_path, "soft") as stored:
        assert stored.u.dims == ("frame", "node", "axis")
        np.testing.assert_array_equal(stored.u, first.u)
        np.testing.assert_array_equal(stored.time, first.t)
        np.testing.assert_array_equal(stored.frame, first.t[first.at])
        np.testing.assert_array_equal(stored["at"], first.at)
        np.testing.assert_array_equal(stored.nodes, result.methods[0].scene.mesh.nodes)
        np.testing.assert_array_equal(stored.cells, result.methods[0].scene.mesh.cells)
        force = stored["trace:stage.force"]
        np.testing.assert_array_equal(force, first.traces["stage.force"].y)
        assert (force.dims, force.units, stored.u.units) == (("time",), "N", "m")
        assert stored.attrs == {"experiment": "cube", "method": "soft"}
    with open_fields(tmp_path, "soft", 2) as stored:
        np.testing.assert_array_equal(stored.u, second.u)


def test_fields_that_are_not_there_or_not_readable_are_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "runs").mkdir()
    write_fields(small_result(), tmp_path / "runs")
    with pytest.raises(UsageError, match=r"no fields of sfot in .*; nearest: soft"):
        open_fields(tmp_path, "sfot")
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(UsageError, match=r"need xarray and h5netcdf: .*tables"):
        open_fields(tmp_path, "soft")
