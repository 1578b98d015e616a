"""Views, tables and charts of a stored run or study by name, for `validate show` and scripts."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from validate.checksums import read_sealed
from validate.compare.exhibit import Chart, Exhibit, Heat, Intervals
from validate.compare.view import View
from validate.errors import UsageError
from validate.parameters import nearest_names
from validate.report.long_table import LongTable
from validate.report.stored.exhibit_rows import stored_exhibits
from validate.report.stored.folder import MARK
from validate.report.views.drawers import drawable
from validate.report.views.standard import VIEWS
from validate.report.views.view_filling import explained, filled_views

PICTURE = "picture"  # the form of what is there as an image only
_DRAWN = re.compile("^(chart|intervals|heat)_")  # of files of what is drawn from numbers
Shown = Mapping[str, tuple[str, Exhibit]]  # form and content by name


def plain_name(text: str) -> str:
    """Return a name without signs that an attribute of Python cannot have."""
    return re.sub(r"\W", "_", text)


def stored_views(folder: Path, table: LongTable) -> Iterator[tuple[str, str, Exhibit]]:
    """Yield name, form and content of views that have rows, then of the run's own tables and
    charts; `folder` may be a results.json."""
    for view, found in filled_views(table, _own(table)):
        if found.words or found.tables or drawable(found):
            yield plain_name(view.name), view.form, found
    file = folder / MARK if folder.is_dir() else folder
    for exhibit in stored_exhibits(read_sealed(file)):
        names = set()
        for one in exhibit.tables:
            names.add(name := plain_name(one.name or exhibit.anchor))
            yield name, "table", Exhibit(one.name, one.title, tables=(one,))
        for chart in exhibit.charts:
            name = plain_name(chart.name)
            name = f"chart_{name}" if name in names else name
            yield name, "chart", Exhibit(chart.name, chart.title, charts=(chart,))


def shown_by_name(folder: Path, table: LongTable) -> Shown:
    """Return what `stored_views` yields, each chart of a view `each`, and pictures."""
    found: dict[str, tuple[str, Exhibit]] = {}
    for name, form, exhibit in stored_views(folder, table):
        found[name] = form, exhibit
        parts = ((plain_name(part.name), part) for part in drawable(exhibit))
        found |= {part: (form, _alone(one)) for part, one in parts if part != name}
    for name, file in pictures(folder).items():
        found.setdefault(name, (PICTURE, Exhibit(name, f"Picture {name}", (f"File: {file}",))))
    return found


def _alone(part: Chart | Heat | Intervals) -> Exhibit:
    one = Exhibit(part.name, part.title)
    match part:
        case Chart():
            return replace(one, charts=(part,))
        case Heat():
            return replace(one, heats=(part,))
        case Intervals():
            return replace(one, intervals=(part,))


def pictures(folder: Path) -> Mapping[str, Path]:
    """Return the files of a stored run's pictures, by their names."""
    files = sorted((folder / "figures").glob("*.png"))
    return {plain_name(_DRAWN.sub("", file.stem)): file for file in files}


def exhibit_of(name: str, folder: Path, table: LongTable) -> Exhibit:
    """Return what a stored run shows by that name; of a view without rows a sentence why.

    Raises `UsageError` with the nearest names for an unknown one.
    """
    views = {plain_name(view.name): view for view in (*VIEWS, *_own(table))}
    if (name := plain_name(name)) in views:
        return explained(views[name], table)
    found = shown_by_name(folder, table)
    if name not in found:
        raise UsageError(f"no view '{name}'; {nearest_names(name, {*views, *found})}")
    return found[name][1]


def _own(table: LongTable) -> list[View]:
    return [View.from_json(view) for view in table.head.get("views", ())]
