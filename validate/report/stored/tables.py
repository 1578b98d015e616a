"""Stored runs: their views by name, and queries over the tables of all, one run at a time.

from validate.report.stored.tables import StoredTables
StoredTables.open("reports").where(part="score", quantity="marker.*", statistic="rms").to_pandas()
"""

import logging
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Self

from validate.catalogue import experiment_files, name_of, reports_of
from validate.checksums import read_sealed
from validate.compare.exhibit import Chart, Exhibit, Heat, Intervals
from validate.compare.row import LongRow, Wanted, require_columns
from validate.compare.view import View
from validate.errors import RecordingError, UsageError
from validate.parameters import nearest_names
from validate.report.export.table_file import stored_table
from validate.report.long_table import LongTable, frame
from validate.report.stored.exhibit_rows import stored_exhibits
from validate.report.stored.folder import MARK
from validate.report.stored.history import current
from validate.report.views.drawers import drawable
from validate.report.views.standard import VIEWS
from validate.report.views.view_filling import explained, filled_views

if TYPE_CHECKING:
    from pandas import DataFrame


LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class StoredTables:
    """The stored runs below `reports`, and the conditions `labels` on their rows.

    Nothing is read before rows are asked for; then one run is in memory at a time.
    """

    reports: Path
    labels: Mapping[str, Wanted] = field(default_factory=dict)

    def where(self, **labels: Wanted) -> "StoredTables":
        """Return the same runs with more conditions (as `LongTable.where`)."""
        require_columns(labels, LongRow._fields)
        return replace(self, labels={**self.labels, **labels})

    def __iter__(self) -> Iterator[LongTable]:
        """Yield the table of every run by name; warn of one that cannot be read and pass it."""
        for folder in report_folders(self.reports):
            try:
                table = stored_table(folder, **self.labels)
            except RecordingError as error:
                LOG.warning(str(error))
                continue
            except (KeyError, TypeError, AttributeError) as error:
                LOG.warning(f"{folder.name}: its results cannot be read: {error!r:.60}")
                continue
            if table.of_run or table.rows:  # a study has tables only
                yield table

    def rows(self) -> Iterator[LongRow]:
        """Yield the rows of all runs, one run after the other."""
        for table in self:
            yield from table.rows

    def to_pandas(self) -> "DataFrame":
        """Return the rows of all runs as a DataFrame; raises `UsageError` without pandas."""
        return frame(self.rows())

    @classmethod
    def open(cls, folder: Path | str) -> Self:
        """Return the stored runs below a folder of reports, or the one run that it holds.

        Raises `UsageError` where there is no such folder.
        """
        reports = Path(folder)
        if not reports.is_dir():
            raise UsageError(
                f"no folder of stored runs at {reports}; `validate run NAME` makes one"
            )
        return cls(reports)


def report_folders(reports: Path) -> list[Path]:
    """Return the folders of results of a folder, by name; itself where it is one."""
    if (reports / MARK).is_file():
        return [reports]
    folders = (f for f in reports.iterdir() if f.is_dir() and not f.name.startswith("."))
    return sorted(f for f in folders if (f / MARK).is_file())


def stored_folder(run: str | Path, reports: Path | None = None) -> Path:
    """Return the folder of a stored run or study, or its results.json: a path, or a name below
    `reports` (default: where the experiment's runs are written).

    `NAME` is the run as declared, else the newest of its variations; `NAME+quick` the newest whose
    folder is called so but for its last words and its hash; `FILE.py` is the name of its
    experiment. Raises `UsageError` where nothing is stored by that name.
    """
    path, name = Path(run), str(run)
    if path.suffix == ".py":
        name = name_of(path)
    elif (path / MARK).is_file() or path.is_file():
        return path
    experiment = name.partition("/")[0].partition("+")[0]  # of `NAME/study-filters`, too
    reports = reports_of(experiment_files(Path.cwd()).get(experiment), reports)
    if (reports / name / MARK).is_file():
        return reports / name
    folders = report_folders(reports) if reports.is_dir() else []
    called = [folder for folder in folders if is_called(folder, name)]
    if not called:
        hint = nearest_names(name, {f.name for f in folders}) if folders else ""
        made = hint or f"`validate run {experiment}` makes one"
        raise UsageError(f"no stored run at {path}, and none of that name below {reports}; {made}")
    newest = max(called, key=lambda folder: str((current(folder) or {}).get("created")))
    if len(called) > 1:
        LOG.warning(f"{name}: {newest.name}, the newest of {len(called)} stored runs")
    return newest


def is_called(folder: Path, name: str) -> bool:
    """Whether a folder of results holds the run of that name, or a variation of it."""
    varied = (f"{name}+", f"{name}-") if "+" in name else (f"{name}+",)  # - is before the hash
    return folder.name == name or folder.name.startswith(varied)


# --- views, tables and charts of a stored run by name --------------------------------------------

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
