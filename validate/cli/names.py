"""`validate list`: every experiment by name, without running its file."""

import json
from dataclasses import asdict
from pathlib import Path

from validate.catalogue import card, experiment_files
from validate.cli.display import console, table


def show(as_json: bool) -> None:
    """Prints name, title and source of every experiment."""
    cards = [card(path) for path in experiment_files(Path.cwd()).values()]
    if as_json:
        print(json.dumps([asdict(c) for c in cards], indent=2))
        return
    rows = [[c.name, c.title, c.source] for c in cards]
    console().print(table("Experiments", ["name", "what", "source"], rows))
