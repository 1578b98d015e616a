"""The commands on programs of others that solve our scenes."""

from pathlib import Path
from typing import Any

import click

from validate.cli.arguments import EXPERIMENTS, FOLDER, FORCE


@click.group("guest")
def guest() -> None:
    """Programs of others that solve our scenes (docs/guests.md)."""


@guest.command("check", context_settings={"ignore_unknown_options": True})
@click.option("--seconds", type=float, default=60.0, show_default=True, help="Limit of a scene.")
@click.option("--memory", type=float, default=8192.0, show_default=True, help="Limit in MB.")
@click.option("--json", "as_json", is_flag=True, help="One JSON document, nothing else.")
@click.argument("command", nargs=-1, required=True, type=click.UNPROCESSED)
def check(command: tuple[str, ...], **options: Any) -> int:
    """Small scenes with exact answers: what COMMAND can do, and how far off it is."""
    from shlex import join

    from validate.cli import guesting

    text = command[0] if len(command) == 1 else join(command)
    return guesting.check(text, **options)


@guest.command("job")
@click.argument("name", metavar="NAME|FILE.py")
@EXPERIMENTS
@click.option("-o", "folder", required=True, type=FOLDER, help="The folder to write, new or empty.")
@FORCE
@click.option("--method", metavar="NAME", help="Whose scene (default: the first judged one's).")
@click.option("--times", type=click.IntRange(min=1), default=10, show_default=True,
              help="Of a static one, evenly spaced.")  # fmt: skip
@click.option("--inertia", is_flag=True, help="Masses count, at every step of the experiment.")
def job(name: str, named: tuple[Path, ...], **given: Any) -> None:
    """What a guest is given of an experiment, to keep: job.json and mesh.vtu."""
    from validate.cli import guesting

    guesting.job(name, experiments=named, **given)
