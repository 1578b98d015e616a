"""Tables and sentences fit their width, and no word is cut."""

import fcntl
import io
import math
import os
import pty
import struct
import sys
import termios

import pytest
from command_line import here

from validate.commands.arguments import complain
from validate.commands.screen import check_passages
from validate.compare.verdict import Check
from validate.report.stored.store import check_members
from validate.report.views.layout import laid, width, wrapped

HEAD = ("name", "value", "why it is so")
ROWS = (
    ("contour.rms@9mm", "0.18 mm", "largest part: the mesh, of which there are three"),
    ("marker.vertical.rms@9mm", "12 mm", ""),
)


def words(lines: list[str]) -> list[str]:
    return " ".join(lines).split()


@pytest.mark.parametrize("columns", [100, 80, 60, 40, 20, 3])
def test_no_width_cuts_a_word_or_leaves_one_out(columns: int) -> None:
    found = {word.strip(";") for word in words(laid(HEAD, ROWS, columns))}
    assert set(words([" ".join(row) for row in ROWS])) - found == set()


@pytest.mark.parametrize("columns", [100, 80, 60, 40])
def test_no_line_is_longer_than_the_width_or_ends_in_blanks(columns: int) -> None:
    lines = laid(HEAD, ROWS, columns)
    assert max(map(len, lines)) <= columns
    assert [line for line in lines if line != line.rstrip()] == []


def test_a_row_is_one_line_and_its_sentence_goes_below_where_there_is_no_room() -> None:
    assert laid(HEAD[:2], [row[:2] for row in ROWS], 20) == [
        "contour.rms@9mm", "    value: 0.18 mm", "marker.vertical.rms@9mm", "    value: 12 mm",
    ]  # fmt: skip


def test_a_word_longer_than_the_width_stays_whole() -> None:
    assert wrapped("see reports/a_long_name/report.html now", 12, "  ") == [
        "see", "  reports/a_long_name/report.html", "  now",
    ]  # fmt: skip


def test_columns_are_those_of_the_environment_then_of_the_terminal_then_80(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("COLUMNS", raising=False)
    assert width(io.StringIO()) == 80
    parent, child = pty.openpty()
    try:
        fcntl.ioctl(child, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 57, 0, 0))
        with os.fdopen(os.dup(child), "w") as terminal:
            assert width(terminal) == 57
            monkeypatch.setenv("COLUMNS", "66")
            assert width(terminal) == 66
            monkeypatch.setenv("COLUMNS", "many")
            assert width(terminal) == 57
    finally:
        os.close(parent)
        os.close(child)


@pytest.mark.parametrize("columns", [60, 80, 120])
@pytest.mark.parametrize("command", [["list"], ["list", "fluid_phantom"], ["list", "kf_cube"]])
def test_lists_keep_to_the_columns(command: list[str], columns: int) -> None:
    code, out, _ = here(*command, COLUMNS=str(columns))
    assert code == 0
    long = [line for line in out.splitlines() if len(line) > columns and " " in line.strip()]
    assert long == []
    assert [line for line in out.splitlines() if line != line.rstrip()] == []


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_complaint_is_one_line_in_a_pipe_and_breaks_between_words_on_a_terminal(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("COLUMNS", "30")
    message = "unknown experiment 'fluid_phatom'; nearest: fluid_phantom"
    shown = []
    for stream in (io.StringIO(), Terminal()):
        monkeypatch.setattr(sys, "stderr", stream)
        complain(message)
        shown.append(stream.getvalue().splitlines())
    assert shown[0] == [f"validate: {message}"]
    assert shown[1] == [
        "validate: unknown experiment", "  'fluid_phatom'; nearest:", "  fluid_phantom",
    ]  # fmt: skip


def test_a_check_that_nothing_bounds_is_a_row_all_the_same() -> None:
    """Meshes that say nothing of convergence leave u_num, and with it u_val, infinite."""
    check = Check("force", 1.0, 2.0, math.inf, 0.1, math.inf, 0.1, "N", 3, "no answer",
                  "undecided", "why")  # fmt: skip
    members = {"method": "fem", **check_members(check)}
    (block,) = check_passages([members])
    assert block.lines == ("  force  █████░░░░░│░░░>  1.00 ± no bound of 2.00 N",)
    assert block.title.startswith("Checks: undecided (")
