"""`validate list`: names and titles of all experiments, without running their files."""

import json
from dataclasses import asdict
from pathlib import Path

from validate.catalogue import card, experiment_files, name_of, shipped
from validate.commands.display import relative, say
from validate.commands.screen import rows
from validate.datasets.home import data_sets, searched, whole


def show(named: tuple[Path, ...], as_json: bool) -> None:
    """Print name, title and needs of every experiment; a line for each file that is none."""
    files = experiment_files(Path.cwd(), named)
    cards = [card(path) for path in files.values()]
    if as_json:
        print(json.dumps([asdict(c) for c in cards], ensure_ascii=False, indent=2))
        return
    here = {c.needs: _is_here(c.needs) for c in cards if c.needs}
    needs = {c.needs: c.needs if here.get(c.needs) else f"{c.needs} *" for c in cards if c.needs}
    cells = [[c.name, c.title, needs.get(c.needs, "-")] for c in cards if not c.note]
    for line in rows(["name", "what", "needs"], cells, soft=1):
        print(line)
    if not all(here.values()):
        print("*: not here yet; `validate data get NAME` fetches it")
    for c in cards:
        # What a file of the user's stands for, when the package has one of that name
        file = files[c.name]
        theirs = experiment_files(shipped())
        other = theirs.get(name_of(file), file).resolve() != file.resolve()
        hides = "this file replaces the shipped experiment of this name" if other else ""
        for text in filter(None, (c.note, hides)):
            say(f"{relative(file)}: {text}", indent="  ")


def _is_here(name: str) -> bool:
    """Whether the files of a data set are in a folder that experiments search."""
    found = next((s for s in data_sets() if s.name == name), None)
    if found is None:
        return False
    places = searched(Path.cwd() / "experiments")
    return any(all(whole(p / found.folder / f.name, f) for f in found.files) for p in places)
