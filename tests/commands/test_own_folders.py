"""Experiment files of a user's own: listed unrun, run one at a time, a broken one in one line."""

import json
from pathlib import Path

import pytest
from command_line import here, refused

from validate.commands import check as checking
from validate.errors import RecordingError
from validate.library import single_run
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.options import Options

RUNS = """from pathlib import Path
Path(__file__).with_suffix(".ran").touch()
{then}
EXPERIMENT = None
"""


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """A folder experiments/ of files that say when they are executed, some of them broken."""
    folder = tmp_path / "experiments"
    folder.mkdir()
    texts = {
        "fine": RUNS.format(then=""),
        "falls": RUNS.format(then="undefined_name"),
        "leaves": RUNS.format(then="raise SystemExit"),
        "unread": "EXPERIMENT = (",
        "helper": RUNS.format(then="").replace("EXPERIMENT", "OTHER"),
        "dotless": RUNS.format(then="from helper import OTHER"),
    }
    for name, text in texts.items():
        (folder / f"{name}.py").write_text(text, "utf-8")
    return tmp_path


def executed(folder: Path) -> set[str]:
    return {path.stem for path in folder.rglob("*.ran")}


def test_the_list_runs_no_file_and_a_broken_one_hides_no_other(own: Path) -> None:
    code, shown, err = here("list", cwd=own)
    assert (code, err, executed(own)) == (0, "", set())
    assert {"fine", "falls", "fluid_phantom"} <= {line.split()[0] for line in shown.splitlines()}
    notes = [line for line in shown.splitlines() if line.startswith("experiments/")]
    assert notes == [
        "experiments/helper.py: defines no EXPERIMENT",
        "experiments/unread.py: cannot be read: '(' was never closed (unread.py, line 1)",
    ]
    cards = json.loads(here("list", "--json", cwd=own)[1])
    assert {c["name"] for c in cards if c["note"]} == {"helper", "unread"}


def test_one_of_the_users_hiding_a_shipped_one_is_said(own: Path) -> None:
    (own / "experiments" / "kf_cube.py").write_text("EXPERIMENT = None", "utf-8")
    shown = here("list", cwd=own)[1]
    assert "experiments/kf_cube.py: this file replaces the shipped experiment of this name" in shown


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("falls", "falls.py, line 3: NameError: name 'undefined_name' is not defined"),
        ("leaves", "leaves.py, line 3: SystemExit"),
        ("unread", "'(' was never closed (unread.py, line 1)"),
        ("helper", "defines no EXPERIMENT"),
        ("dotless", "is imported with a dot: `from .helper import ...`"),
    ],
)
@pytest.mark.parametrize("command", [["list"], ["run"], ["check"], ["study", "stability"]])
def test_a_broken_file_is_one_line_where_it_is_asked_for(
    own: Path, command: list[str], name: str, says: str
) -> None:
    assert says in refused(*command, name, cwd=own)
    assert executed(own) == {name} - {"unread", "helper"}


@pytest.mark.parametrize(
    "command",
    [["list"], ["run"], ["check"], ["record", "-o", "x.mcap"], ["study", "filters"],
     ["study", "stability"], ["study", "tradeoff"],
     ["study", "choose", "--error", "1mm", "--rate", "1Hz"]],
)  # fmt: skip
def test_a_folder_that_is_named_is_looked_at(
    own: Path, tmp_path_factory: pytest.TempPathFactory, command: list[str]
) -> None:
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    assert "unknown experiment 'fine'" in refused(*command, "fine", cwd=elsewhere)
    named = ["--experiments", str(own / "experiments")]
    assert "of type Experiment" in refused(*command, "fine", *named, cwd=elsewhere)


@pytest.mark.slow
def test_of_all_each_ends_for_itself(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compared: list[str] = []

    def without_data(experiment: Experiment, options: Options, *_: object, **__: object) -> None:
        compared.append(experiment.name)
        raise RecordingError("no logs")

    for command in (single_run, checking):
        monkeypatch.setattr(command, "compare", without_data)
    for arguments in (["run", "--all"], ["check"]):
        compared.clear()
        code, _, err = here(*arguments, cwd=own)
        assert code == 2, err
        assert {"fluid_phantom", "kf_cube"} <= set(compared)
        broken = ("fine", "falls", "leaves", "unread", "helper", "dotless")
        assert len(err.splitlines()) == len(compared) + len(broken)
        assert all(f"experiments/{name}.py" in err for name in broken)
    assert "helper" not in executed(own)


def test_the_command_that_shows_a_broken_file_takes_spaces(tmp_path: Path) -> None:
    file = tmp_path / "my folder" / "experiments" / "falls.py"
    file.parent.mkdir(parents=True)
    file.write_text(RUNS.format(then="undefined_name"), "utf-8")
    assert f"`python '{file}'`" in refused("run", "falls", cwd=file.parent.parent)
