"""`validate external`: commands on external simulators."""

from pathlib import Path
from typing import Any

import click

from validate.commands.arguments import EXPERIMENTS, FOLDER, FORCE


@click.group("external")
def external() -> None:
    """Use an external simulator as one more method (docs/how-to/external-simulators.md).

    \b
    Example:
      validate external job hanging_bar --method felupe -o felupe_job
    """


@external.command("check", context_settings={"ignore_unknown_options": True})
@click.option(
    "--seconds", type=float, default=60.0, show_default=True, help="Time limit of a scene."
)
@click.option("--memory", type=float, default=8192.0, show_default=True, help="Memory limit in MB.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document only.")
@click.argument("command", nargs=-1, required=True, type=click.UNPROCESSED)
def check(command: tuple[str, ...], **options: Any) -> int:
    """Test what an external simulator can do, and how accurately.

    \b
    Example:
      validate external check "python my_simulator.py"
    """
    from shlex import join

    from validate.commands import external_check

    text = command[0] if len(command) == 1 else join(command)
    return external_check.check(text, **options)


@external.command("job")
@click.argument("name", metavar="NAME|FILE.py")
@EXPERIMENTS
@click.option("-o", "folder", required=True, type=FOLDER, help="Folder to write; new or empty.")
@FORCE
@click.option(
    "--method", metavar="NAME", help="Method whose scene is written (default: the accepted one)."
)
@click.option("--times", type=click.IntRange(min=1), default=10, show_default=True,
              help="Number of evenly spaced load steps of a static scene.")  # fmt: skip
@click.option(
    "--inertia", is_flag=True, help="Include inertia; write every step of the experiment."
)
def job(name: str, named: tuple[Path, ...], **given: Any) -> None:
    """Write the files that an external simulator gets.

    \b
    Example:
      validate external job hanging_bar --method felupe -o job
    """
    from validate.commands import external_check

    external_check.job(name, experiments=named, **given)
