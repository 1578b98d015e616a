"""What cannot end well ends before any solving: in one line, with exit code 2."""

from pathlib import Path

import pytest
from command_line import refused
from study_samples import experiment_file

from validate.commands import record as making
from validate.library import single_run, studies


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    folder = tmp_path / "mine"
    folder.mkdir()
    return experiment_file(folder)


@pytest.fixture
def nothing_is_solved(monkeypatch: pytest.MonkeyPatch) -> None:
    def solved(*_: object, **__: object) -> None:
        raise AssertionError("the place was to be tried first")

    for module, names in (
        (single_run, ("compare",)),
        (studies, ("study", "stability", "trade")),
        (making, ("stamped",)),
    ):
        for name in names:
            monkeypatch.setattr(module, name, solved)


@pytest.mark.usefixtures("nothing_is_solved")
@pytest.mark.parametrize(
    "command",
    [
        ["run"],
        ["study", "filters"],
        ["study", "stability"],
        ["study", "tradeoff"],
        ["study", "choose", "--error", "1mm", "--rate", "10Hz"],
    ],
)
@pytest.mark.parametrize("out", ["taken/below", "/proc"])
def test_a_report_that_could_not_be_written(
    tmp_path: Path, mine: Path, command: list[str], out: str
) -> None:
    (tmp_path / "taken").write_text("", "utf-8")
    assert "cannot write at " in refused(*command, str(mine), "--out", out, cwd=tmp_path)
    assert {p.name for p in tmp_path.iterdir()} == {"mine", "taken"}


@pytest.mark.parametrize(
    "command",
    [
        ["import", "missing.csv", "--as", "instron"],
        ["merge", "missing.mcap"],
        ["record", "kf_cube"],
        ["new", "my_gel", "--from", "missing.mcap"],
    ],
)
def test_a_file_that_could_not_be_written_is_told_before_one_is_read(
    tmp_path: Path, command: list[str]
) -> None:
    out = "/proc/my_gel.py" if command[0] == "new" else "/proc/x.mcap"
    assert f"cannot write at {out}" in refused(*command, "-o", out, cwd=tmp_path)
