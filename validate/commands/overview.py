"""`validate report` and `validate open`: the page over all runs, and pages in the browser."""

import webbrowser
from pathlib import Path

from validate.catalogue import experiment_files, reports_of
from validate.commands.display import relative, say
from validate.errors import UsageError
from validate.parameters import nearest_names
from validate.report.stored.tables import report_folders
from validate.study.stored_runs.overview import FOLDER, stored, write_overview

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
    reports = reports_of(experiment_files(Path.cwd()).get(name), out)
    folder = Path(name) if name and (Path(name) / _PAGE).is_file() else reports / (name or FOLDER)
    if not name:
        write_overview(reports)
    page = folder / _PAGE
    if not page.is_file():
        known = {f.name for f in report_folders(reports)} if reports.is_dir() else set[str]()
        told = f"; {nearest_names(name, known)}" if known else f"; `validate run {name}` makes it"
        raise UsageError(f"no report of '{name}' below {reports}{told}")
    say(f"page: {relative(page)}")
    if not webbrowser.open(page.resolve().as_uri()):
        say("no browser was found here; open the page in one")
