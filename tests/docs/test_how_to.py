"""Every command has a how-to: a section with the command as a user types it."""

import re
import shlex
from collections import Counter
from pathlib import Path

import pytest

from validate.commands.help import SECTIONS, command_at, every_command
from validate.commands.main import cli

HOW_TO = sorted((Path(__file__).resolve().parents[2] / "docs" / "how-to").glob("*.md"))
NAMES = dict(every_command(cli))


def typed(page: Path) -> list[str]:
    """Commands behind a prompt, without their first word."""
    blocks = re.findall(r"```console\n(.*?)```", page.read_text("utf-8"), re.DOTALL)
    return [line for b in blocks for line in re.findall(r"^\$ validate (.+)$", b, re.MULTILINE)]


def name_of(line: str) -> str:
    words = line.split()
    whole = " ".join(words[:2])
    return whole if whole in NAMES else words[0]


def test_every_command_has_its_own() -> None:
    pages = [page for page in HOW_TO if page.stem != "troubleshooting"]
    count = Counter(name_of(line) for page in pages for line in typed(page))
    assert NAMES.keys() - count.keys() == set()
    assert {name for names in SECTIONS.values() for name in names} <= NAMES.keys()


@pytest.mark.parametrize("page", HOW_TO, ids=lambda page: page.stem)
def test_its_options_exist(page: Path) -> None:
    for line in typed(page):
        name = name_of(line)
        options = [w for w in shlex.split(line, comments=True) if re.match(r"--?[a-z]", w)]
        known = {option for p in command_at(cli, name).params for option in p.opts}
        assert {option.partition("=")[0] for option in options} <= known, line
