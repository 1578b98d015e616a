"""`validate export`: a stored run as JUnit XML, LaTeX, or vector figures."""

import itertools
import json
from dataclasses import replace
from pathlib import Path

from validate.commands.display import relative, say
from validate.commands.progress import progress
from validate.errors import UsageError
from validate.files import json_value, safe_name
from validate.places import try_file, try_folder, write_whole
from validate.report.export.junit_latex import junit, tabular
from validate.report.long_table import LongTable, content_of
from validate.report.stored.exhibit_rows import NOT_SHOWN
from validate.report.stored.tables import pictures, plain_name, stored_folder, stored_views
from validate.report.views.drawers import drawable, figure_of, save
from validate.report.views.standard import view_of
from validate.report.views.view_filling import filled
from validate.study.stored_runs.score_comparison import read_table

_LIST = "figures.json"  # what an export wrote into a folder of figures, and of which run


def export(
    name: str, junit_file: Path | None, latex_file: Path | None, figures: Path | None = None
) -> None:
    """Write the requested exports of a report folder or a run's name.

    Raises `UsageError` where none is requested, or no such run is stored.
    """
    run = stored_folder(name)
    makers = ((junit_file, lambda t: junit(content_of(t))), (latex_file, checks_in_latex))
    wanted = [(file, make) for file, make in makers if file is not None]
    if not wanted and figures is None:
        raise UsageError(
            "export: no output is named; give --junit checks.xml, --latex checks.tex or "
            "--figures FOLDER"
        )
    table = read_table(run, "score*", "check*", "published*", "outcome")
    for file, make in wanted:
        try_file(file)
        write_whole(file, make(table))
        say(f"{file}: {file.stat().st_size / 1e3:.1f} kB", indent="  ")

    if figures is not None:
        _figures(run, figures)


def _figures(run: Path, folder: Path) -> None:
    """Every view, chart and table of a stored run by its name: charts as SVG and PDF for one column
    (85 mm) and two (175 mm), tables as CSV and LaTeX, pictures as they are and in SVG and PDF.
    """
    from validate.report.charts.style import COLUMNS  # matplotlib takes half a second
    from validate.report.stored.figures import figure_of_file

    table = read_table(run, *NOT_SHOWN)
    try_folder(folder)
    folder.mkdir(parents=True, exist_ok=True)
    found = tuple(stored_views(run, table))
    drawn = {plain_name(part.name) for _, _, exhibit in found for part in drawable(exhibit)}
    others = pictures(run).items() if run.is_dir() else ()
    images = [file for name, file in others if name not in drawn]
    count = len(images) + len(COLUMNS) * sum(len(drawable(exhibit)) for _, _, exhibit in found)
    written: list[Path] = []
    with progress(f"{table.head['experiment']}: figures") as report:
        numbers = itertools.count(1)
        for name, _, exhibit in found:
            for part, column in itertools.product(drawable(exhibit), COLUMNS):
                number = next(numbers)
                report(number - 1, count, f"{part.name}, {column}: {number} of {count}")
                figure = figure_of(part, table, column)
                for suffix in (".svg", ".pdf"):
                    written.append(folder / f"{safe_name(part.name)}_{column}{suffix}")
                    figure.savefig(written[-1])
            for suffix in (".csv", ".tex") if len(exhibit.tables) == 1 else ():
                written.append(folder / f"{safe_name(name)}{suffix}")
                save(replace(exhibit, charts=(), heats=(), intervals=()), table, written[-1])
        for file in images:
            report(next(numbers) - 1, count, f"{file.stem}, as it is")
            written.append(folder / file.name)
            written[-1].write_bytes(file.read_bytes())
            for suffix in (".svg", ".pdf"):
                written.append(folder / f"{file.stem}{suffix}")
                figure_of_file(file).savefig(written[-1])
    names = {file.name for file in written}
    # Files that an earlier export wrote are removed
    try:
        listed = json_value((folder / _LIST).read_bytes())["files"]
        earlier = {str(name) for name in listed if Path(str(name)).name == name}
    except (OSError, ValueError, KeyError, TypeError):
        earlier = set()
    gone = {name for name in earlier if (folder / name).is_file()} - names
    for name in gone:
        (folder / name).unlink()
    document = {"run": str(run), "created": table.head["created"], "files": sorted(names)}
    write_whole(folder / _LIST, json.dumps(document, indent=1) + "\n")
    replaced = f", {len(gone)} of an earlier export removed" if gone else ""
    say(f"{relative(folder)}: {len(names)} files{replaced}", indent="  ")


def checks_in_latex(table: LongTable) -> str:
    """Return the checks of all methods as a `tabular`."""
    head = table.head
    (checks,) = filled(view_of("checks"), table).tables
    return tabular(checks, f"{head['experiment']}, {head['created']}: {head['sentence']}")
