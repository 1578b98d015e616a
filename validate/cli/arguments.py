"""What the commands share: exit codes, kinds of options, and texts of the form PATH=VALUE."""

import sys
from pathlib import Path

import click

from validate.cli.layout import width, wrapped
from validate.errors import UsageError

FOLDER = click.Path(file_okay=False, path_type=Path)
FILE = click.Path(dir_okay=False, path_type=Path)
EXPERIMENTS = click.option(
    "--experiments", "named", multiple=True, type=FOLDER, metavar="DIR",
    help="A folder of experiment files to look at too.",
)  # fmt: skip
OK, FAILED, BAD_INPUT, BUG, INTERRUPTED = 0, 1, 2, 70, 130


def command_line() -> tuple[str, ...]:
    """The arguments of the running command; empty where there is none."""
    context = click.get_current_context(silent=True)
    return tuple(context.find_root().obj or ()) if context else ()


def complain(message: str) -> None:
    """One line on standard error; on a terminal broken between words, not where it ends."""
    line = "validate: " + " ".join(message.split())
    seen = wrapped(line, width(sys.stderr), "  ") if sys.stderr.isatty() else [line]
    click.echo("\n".join(seen), err=True)


def pairs(texts: tuple[str, ...], option: str) -> dict[str, str]:
    """`a=b` texts as a mapping; raises `UsageError` for a text without '='."""
    found = {}
    for text in texts:
        key, sign, value = text.partition("=")
        if not (sign and key.strip()):
            raise UsageError(f"{option} {text}: expected PATH=VALUE")
        found[key.strip()] = value.strip()
    return found
