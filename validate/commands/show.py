"""`validate show`: tables and charts of a stored run, on the terminal or as a file."""

from collections.abc import Iterator
from pathlib import Path

from validate.checksums import read_sealed
from validate.commands.display import console, relative, say
from validate.commands.screen import rows
from validate.compare.exhibit import Exhibit
from validate.compare.view import View
from validate.errors import UsageError
from validate.parameters import nearest_names
from validate.report.long_table import LongTable
from validate.report.stored.exhibit_rows import NOT_SHOWN, stored_exhibits
from validate.report.stored.folder import MARK
from validate.report.stored.tables import stored_folder
from validate.report.views.drawers import drawable, save, terminal
from validate.report.views.view_filling import filled_views
from validate.study.stored_runs.score_comparison import read_table


def show(run: str, names: tuple[str, ...], reports: Path | None, out: Path | None) -> None:
    """Print what a run or a study shows by these names, or the list; write one to `out`.

    Raises `UsageError` for a run or a name that is not there.
    """
    folder = stored_folder(run, reports)
    table = read_table(folder, *NOT_SHOWN)
    found = {name: (form, exhibit) for name, form, exhibit in shown_of(folder, table)}
    for name in names:
        if name not in found:
            raise UsageError(f"{folder.name} shows no '{name}'; {nearest_names(name, set(found))}")
    if out is not None:
        if len(names) != 1:
            raise UsageError(f"-o takes one view, not {len(names)}; name one of {', '.join(found)}")
        save(found[names[0]][1], table, out)
        say(f"{relative(out)}: {out.stat().st_size / 1e3:.1f} kB")
        return
    screen = console()
    if not names:
        cells = [[name, form, exhibit.title] for name, (form, exhibit) in found.items()]
        for line in rows(["view", "form", "title"], cells, soft=2):
            screen.print(line, markup=False, soft_wrap=True)
    for i, name in enumerate(names):
        for line in (*([""] if i else []), *terminal(found[name][1], screen.width)):
            screen.print(line, markup=False, soft_wrap=True)


def shown_of(folder: Path, table: LongTable) -> Iterator[tuple[str, str, Exhibit]]:
    """Name, form and content of views that have rows, then of the run's own tables and charts."""
    own = (View.from_json(v) for v in table.head.get("views", ()))
    for view, found in filled_views(table, own):
        if found.words or found.tables or drawable(found):
            yield view.name, view.form, found
    file = folder / MARK if folder.is_dir() else folder
    for exhibit in stored_exhibits(read_sealed(file)):
        for one in exhibit.tables:
            yield one.name or exhibit.anchor, "table", Exhibit(one.name, one.title, tables=(one,))
        for chart in exhibit.charts:
            yield f"chart_{chart.name}", "chart", Exhibit(chart.name, chart.title, charts=(chart,))
