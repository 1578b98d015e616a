"""`validate show`: tables and charts of a stored run, on the terminal or as a file."""

from pathlib import Path

from validate.commands.display import console, relative, say
from validate.commands.screen import rows
from validate.errors import UsageError
from validate.report.stored.exhibit_rows import NOT_SHOWN
from validate.report.stored.tables import exhibit_of, pictures, shown_by_name, stored_folder
from validate.report.views.drawers import save, terminal
from validate.study.stored_runs.score_comparison import read_table


def picture(file: Path, out: Path) -> None:
    """Write a stored picture as .svg, .pdf or .png; raises `UsageError` for another suffix."""
    if out.suffix not in (".svg", ".pdf", ".png"):
        raise UsageError(f"{out}: a picture is written as .svg, .pdf or .png")
    from validate.report.stored.figures import figure_of_file

    figure_of_file(file).savefig(out)


def show(run: str, names: tuple[str, ...], reports: Path | None, out: Path | None) -> None:
    """Print what a run or a study shows by these names, or the list; write one to `out`.

    Raises `UsageError` for a run or a name that is not there.
    """
    folder = stored_folder(run, reports)
    table = read_table(folder, *NOT_SHOWN)
    views = [exhibit_of(name, folder, table) for name in names]
    if out is not None:
        if len(names) != 1:
            known = ", ".join(shown_by_name(folder, table))
            raise UsageError(f"-o takes one view, not {len(names)}; name one of {known}")
        file = pictures(folder).get(names[0]) if folder.is_dir() else None
        if file is not None and not (views[0].charts or views[0].tables or views[0].intervals):
            picture(file, out)
        else:
            save(views[0], table, out)
        say(f"{relative(out)}: {out.stat().st_size / 1e3:.1f} kB")
        return
    screen = console()
    if not names:
        found = shown_by_name(folder, table)
        cells = [[name, form, exhibit.title] for name, (form, exhibit) in found.items()]
        for line in rows(["view", "form", "title"], cells, soft=2):
            screen.print(line, markup=False, soft_wrap=True)
    for i, view in enumerate(views):
        for line in (*([""] if i else []), *terminal(view, screen.width)):
            screen.print(line, markup=False, soft_wrap=True)
