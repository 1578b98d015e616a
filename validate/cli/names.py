"""`validate list`: every experiment by name, without running its file."""

import json
from dataclasses import asdict
from pathlib import Path

from validate.catalogue import card, experiment_files, shipped
from validate.cli.display import relative, say, table


def show(named: tuple[Path, ...], as_json: bool) -> None:
    """Prints name, title and source of every experiment; a line for each file that is none."""
    files = experiment_files(Path.cwd(), named)
    cards = [card(path) for path in files.values()]
    if as_json:
        print(json.dumps([asdict(c) for c in cards], indent=2))
        return
    rows = [[c.name, c.title, c.source] for c in cards if not c.note]
    table("", ["name", "what", "source"], rows)
    for c in cards:
        for line in (c.note, _hides(files[c.name])):
            if line:
                say(f"{relative(files[c.name])}: {line}", indent="  ")


def _hides(file: Path) -> str:
    """What a file of the user's stands for, when the package has one of that name."""
    theirs = shipped() / file.name
    other = file.resolve() != theirs.resolve() and theirs.is_file()
    return "is meant by this name, not the shipped one" if other else ""
