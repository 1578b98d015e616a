"""A study's folder says what the experiment declares its recordings to be, present or not."""

import json
from pathlib import Path

import pytest

from validate.compare.exhibit import NumberTable
from validate.pipeline.experiment.find import find
from validate.study.study_page import Findings, write_study

KINDS = {
    "hanging_bar": "reference",
    "fluid_phantom": "same law, finer mesh",
    "ecoflex_cylinder": "measured",
}


@pytest.mark.parametrize("present", [True, False])
@pytest.mark.parametrize("name", KINDS)
def test_the_kind_is_the_declared_one(
    name: str,
    present: bool,
    project_root: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if not present:
        monkeypatch.setenv("VALIDATE_SHARED_DATA", str(tmp_path / "absent"))
    experiment = find(name, project_root)
    cells = NumberTable("cells", "", ("a",), ((1.0,),))
    told = Findings("Trade: a title", "One cell.", (), {"kind": "tradeoff"}, cells, True)
    page = write_study(experiment, told, tmp_path / "study")
    assert json.loads((page.parent / "results.json").read_text("utf-8"))["kind"] == KINDS[name]
