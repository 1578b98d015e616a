"""Exit codes of `validate new`: 0 written, 2 bad input in one line, 70 a bug, 130 interrupted."""

from pathlib import Path
from typing import NoReturn

import click
import numpy as np
import pytest
from command_line import here, refused

from validate.commands.questions import new
from validate.commands.questions import plates as new_plates
from validate.recording.mcap.write import write_recording
from validate.recording.types import Recording, Signal, Source

ANSWERS = 'experiment = "plates"\ntest = "compression"\naccept.force = "0.1N"\n'


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    t = np.arange(50) / 10
    signals = {
        "displacement": Signal(t, 1e-4 * t[:, None], "m", 0.0, "machine"),
        "force": Signal(t, 0.1 * t[:, None], "N", 5e-3, "machine"),
    }
    log = Recording("gel", Source("x", "", 0, "x"), 0, signals=signals)
    write_recording(log, tmp_path / "log.mcap")
    (tmp_path / "a.toml").write_text(ANSWERS, "utf-8")
    whole = (tmp_path / "log.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) // 3])
    (tmp_path / "noise.mcap").write_bytes(b"\x89noise" * 100)
    (tmp_path / "wrong.toml").write_text(ANSWERS.replace("0.1N", "0.1m"), "utf-8")
    (tmp_path / "odd.toml").write_text(ANSWERS + 'colour = "red"\n', "utf-8")
    (tmp_path / "broken.toml").write_text("a = [", "utf-8")
    return tmp_path


def arguments(*more: str, source: str = "log.mcap") -> tuple[str, ...]:
    return ("new", "mine", "--from", source, *more)


def test_success_is_0(folder: Path) -> None:
    assert here(*arguments("--answers", "a.toml", "--questions"))[0] == 0
    assert not (folder / "experiments").exists()
    assert here(*arguments("--answers", "a.toml"))[0] == 0
    assert here(*arguments("--answers", "a.toml", "--force"))[0] == 0


@pytest.mark.parametrize(("command", "words"), [
    (arguments(source="absent.mcap"), "absent.mcap"),
    (arguments(source="cut.mcap"), "cut.mcap"),
    (arguments(source="noise.mcap"), "noise.mcap"),
    (arguments(), "open: "),
    (arguments("--answers", "absent.toml"), "absent.toml"),
    (arguments("--answers", "wrong.toml"), "accept.force = 0.1m: expected"),
    (arguments("--answers", "odd.toml"), "no question has the key colour"),
    (arguments("--answers", "broken.toml"), "not TOML"),
    (("new", "Mine", "--from", "log.mcap"), "expected a name"),
    (("new", "mine"), "--from"),
])  # fmt: skip
def test_bad_input_is_2_in_one_line(
    folder: Path, command: tuple[str, ...], words: str
) -> None:  # fmt: skip
    assert words in refused(*command)
    assert not (folder / "experiments").exists()


def test_an_existing_file_is_2_and_stays(folder: Path) -> None:
    here(*arguments("--answers", "a.toml"))
    (folder / "experiments" / "mine.py").write_text("x = 1", "utf-8")
    assert "exists" in refused(*arguments("--answers", "a.toml"))
    assert (folder / "experiments" / "mine.py").read_text("utf-8") == "x = 1"


@pytest.mark.parametrize("error", [KeyboardInterrupt, EOFError])
def test_an_interrupted_question_is_130(
    folder: Path, monkeypatch: pytest.MonkeyPatch, error: type[BaseException]
) -> None:
    """Ctrl-C and Ctrl-D at a prompt."""

    def interrupted(prompt: str = "") -> NoReturn:
        raise error

    monkeypatch.setattr(new, "on_a_terminal", lambda: True)
    monkeypatch.setattr(click.termui, "visible_prompt_func", interrupted)
    code, _, err = here(*arguments())
    assert (code, err.splitlines()[-1]) == (130, "validate: interrupted")
    assert not (folder / "experiments").exists()


def test_a_bug_is_70_with_its_traceback(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:  # fmt: skip
    def broken(*arguments: object) -> NoReturn:
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr(new_plates, "mesh_questions", broken)
    code, _, err = here(*arguments("--answers", "a.toml"))
    assert code == 70
    assert "Traceback" in err
