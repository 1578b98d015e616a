"""Names of streams, markers and specimens may be any text: a run ends with a whole report."""

import json
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest
from command_line import here as command
from test_new_body import PRESSED, log, markers, recording

from validate.commands.main import run
from validate.recording.mcap.read import read_recording
from validate.recording.mcap.write import write_recording

HOSTILE = (
    ("../../up", "/etc/passwd", "a/b", ".."),
    ("<script>alert(1)</script>", 'x" onload="y', "100 % & $x_y^2 #1 ~ {z}", "l" * 300),
)


@pytest.mark.slow
@pytest.mark.parametrize("names", HOSTILE)
def test_a_run_with_them_ends_with_a_report(
    names: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("VALIDATE_NO_GL", "1")
    (markers_m,) = markers().values()
    named = replace(markers_m, names=names)
    whole = recording(
        signals={**log(), **dict.fromkeys(names, log()["force"])}, markers={"m": named}
    )
    write_recording(
        replace(whole, name=names[0], metadata={"specimen": {"name": names[0]}}),
        tmp_path / "all.mcap",
    )
    (tmp_path / "a.toml").write_text(PRESSED)
    assert run(["new", "mine", "--from", "all.mcap", "--answers", "a.toml"]) == 0
    code, out, err = command("run", "mine", "--vtu")
    assert code in (0, 1), (out, err)
    report = tmp_path / "reports" / "mine"
    page = (report / "report.html").read_text("utf-8")
    assert "<script>alert(1)" not in page
    assert 'x" onload="y' not in page
    stored = json.loads((report / "results.json").read_text("utf-8"))
    assert stored["methods"][0]["outcome"]["state"] == "finished"
    assert read_recording(report / "replay.mcap").name
    given = ("--junit", "x.xml", "--latex", "x.tex")
    assert run(["export", "reports/mine", *given]) == 0
    ElementTree.parse(tmp_path / "x.xml")
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "a.toml", "all.mcap", "experiments", "reports", "x.tex", "x.xml",
    ]  # fmt: skip
