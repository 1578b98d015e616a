"""Every example of docs/how-to/python.md runs as it is printed, one after the other."""

import re
from pathlib import Path
from typing import Any

import pytest

from validate.library.run_result import RunResult
from validate.recording.types import Recording


@pytest.mark.slow
def test_the_examples_run(
    project_root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    page = (project_root / "docs" / "how-to" / "python.md").read_text("utf-8")
    blocks = re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL)
    assert len(blocks) == 6
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"__name__": "__main__"}
    for block in blocks:
        exec(compile(block, "docs/how-to/python.md", "exec"), names)
    result, stiffer, recording = names["result"], names["stiffer"], names["recording"]
    assert isinstance(result, RunResult)
    assert (result.parameters["material.E"], stiffer.parameters["material.E"]) == (10e3, 12e3)
    assert names["u"].attrs["units"] == "m"
    assert set(names["frame"]["method"]) == {"fem", "kf_reduced"}
    assert isinstance(recording, Recording)
    assert recording.signal("force", "N").y[-1, 0] == 2.0
    scores = names["mine"].to_pandas(part="score", quantity="node_B", statistic="rmse")
    values = dict(zip(scores["method"], scores["value"], strict=True))
    assert values["mine"] == values["fem"]  # the same formulas
    assert "node_B.rms@all" in capsys.readouterr().out
