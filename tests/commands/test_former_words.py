"""Former words of the command line work for one version, with one warning line."""

from pathlib import Path

import pytest
from command_line import here

from validate.commands.help import FORMER_COMMANDS, every_command
from validate.commands.main import cli

OPTION = "validate: --guest is called --external now; the next version accepts --external only"
COMMAND = (
    "validate: 'validate guest' is called 'validate external' now; "
    "the next version accepts 'validate external' only"
)


@pytest.mark.usefixtures("shared_data")  # of hanging_bar
def test_the_former_option_works_with_one_warning_line(tmp_path: Path) -> None:
    for words in (("run", "hanging_bar"), ("study", "tradeoff", "hanging_bar")):
        both = [
            here(*words, "--quick", "--out", str(tmp_path), option, "no-such-program")
            for option in ("--guest", "--external")
        ]
        (code, out, err), now = both
        assert err.splitlines()[0] == OPTION
        assert (code, out, err.splitlines()[1:]) == (*now[:2], now[2].splitlines())
        assert "not installed: there is no program 'no-such-program'" in now[2]


@pytest.mark.usefixtures("shared_data")  # of hanging_bar
def test_both_options_name_simulators(tmp_path: Path) -> None:
    words = ("--external", "python", "--guest", "no-such-program")
    code, _, err = here("run", "hanging_bar", "--quick", "--out", str(tmp_path), *words)
    assert code == 2
    assert "no-such-program" in err.splitlines()[-1]


@pytest.mark.usefixtures("shared_data")  # of hanging_bar
def test_the_former_command_works_with_one_warning_line(tmp_path: Path) -> None:
    words = ("job", "hanging_bar", "--method", "hexahedra", "-o")
    code, out, err = here("guest", *words, str(tmp_path / "former"))
    assert (code, err) == (0, f"{COMMAND}\n")
    assert here("external", *words, str(tmp_path / "now"))[::2] == (0, "")
    former, now = ((tmp_path / n / "job.json").read_text("utf-8") for n in ("former", "now"))
    assert former == now
    assert "job.json and mesh.vtu of hexahedra" in " ".join(out.split())
    assert here("guest", "check", "no-such-program")[0] == 2


def test_no_help_page_names_a_former_word() -> None:
    pages = ["", "study", "external", *dict(every_command(cli))]
    for page in pages:
        code, out, err = here(*page.split(), "--help")
        assert (code, err) == (0, "")
        assert "guest" not in out.casefold(), page
    assert not FORMER_COMMANDS.keys() & cli.commands.keys()
    assert set(FORMER_COMMANDS.values()) <= cli.commands.keys()


def test_words_of_the_program_are_its_own(capfd: pytest.CaptureFixture[str]) -> None:
    code, _, err = here("external", "check", "no-such-program", "--guest", "x")
    assert code == 2
    assert "is called" not in err
