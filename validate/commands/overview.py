"""`validate report` and `validate open`: the page over all runs, and pages in the browser."""

import webbrowser
from pathlib import Path

from validate.catalogue import reports_of
from validate.commands.display import relative, say
from validate.errors import UsageError
from validate.report.stored.tables import stored_folder
from validate.study.stored_runs.overview import stored, write_overview

_PAGE = "report.html"


def show(out: Path | None) -> None:
    """Write the page over all stored runs, and print their verdicts."""
    reports = reports_of(None, out)
    page = write_overview(reports)
    for one in stored(reports):
        say(f"{one.folder}: {one.verdict}", indent="  ")
    say(f"page: {relative(page)}; validate open shows it")


def open_page(name: str, out: Path | None) -> None:
    """Open the report of a run, a folder of it, or without a name the page over all of them.

    Raises `UsageError` where there is no such page.
    """
    folder = stored_folder(name, out) if name else write_overview(reports_of(None, out)).parent
    page = folder / _PAGE
    if not page.is_file():
        raise UsageError(f"no {page}; `validate run {name}` makes it")
    say(f"page: {relative(page)}")
    if not webbrowser.open(page.resolve().as_uri()):
        say("no browser was found here; open the page in one")
