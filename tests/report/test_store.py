"""results.json: valid against its schema, SI, no NaN, no places; runs readable without pickle."""

import json
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from report_samples import CHECK, bare_result, small_result

from validate.compare.residual import Residual
from validate.compare.result import Result
from validate.compare.score import Score
from validate.report.environment import without_folder
from validate.report.over_noise import _row
from validate.report.registration import _statistics
from validate.report.store import Json, _rest, document, schema, write_json, write_runs

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
    assert _rest(seen)["rms"] == pytest.approx(rms)
    assert _statistics(seen) == pytest.approx((rms, 5.0, np.sqrt(2) * 0.3))
    method = replace(small_result().methods[0], residuals={seen.name: seen})
    ((_, ratio),) = _row([method], "force.plate").ratios
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


def test_runs_without_pickle(tmp_path: Path) -> None:
    result = small_result()
    write_runs(result, tmp_path)
    with np.load(tmp_path / "soft.npz", allow_pickle=False) as stored:
        first = result.methods[0].run
        np.testing.assert_array_equal(stored["u"], first.u)
        np.testing.assert_array_equal(stored["t"], first.t)
        np.testing.assert_array_equal(stored["at"], first.at)
        np.testing.assert_array_equal(stored["nodes"], result.methods[0].scene.mesh.nodes)
        assert stored["cells"].shape[1] == 4
        assert {"t_2", "u_2", "at_2"} <= set(stored.files)
        assert not {"allow_pickle"} & set(stored.files)
