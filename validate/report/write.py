"""Writer of the report folder, which replaces the former one when complete."""

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from validate.arrays import Floats
from validate.checksums import read_sealed
from validate.compare.result import Result
from validate.compare.row import MEASURED, SAMPLE, LongRow, RowBlock
from validate.engine.execution import CELLS
from validate.errors import RecordingError
from validate.files import json_value
from validate.report.export.fields import write_fields
from validate.report.export.table_file import write_long_table
from validate.report.long_table import LongTable, long_table, traces_of
from validate.report.sections.observations import signals
from validate.report.sections.verdicts import band
from validate.report.stored.environment import Made
from validate.report.stored.folder import MARK, STUDIES, replace_folder
from validate.report.stored.history import carried, write_lines
from validate.report.stored.json_values import Json, write_json
from validate.report.stored.store import document

if TYPE_CHECKING:  # what draws is imported when something is drawn
    from validate.report.exhibits import Beside

Progress = Callable[[str], None]


def write_report(
    result: Result,
    folder: Path,
    *,
    created: str,
    made: Made | None = None,
    progress: Progress | None = None,
    vtu: bool = False,
    beside: "Beside | None" = None,
) -> Path:
    """Replace `folder` by the report of `result`; returns the path of its report.html.

    `created` is a UTC time, ISO-8601; `made` says what made the result; `vtu` adds `paraview/`;
    `beside` draws parts side by side. The old folder stays until the new one is complete; after
    any failure nothing of the new one is left; folders of studies in it are kept, and a line of the
    run that was there, unless all that made it is equal. Raises
    `UsageError` when `folder` holds something other than a report, or cannot be written;
    `ComparisonError` when two parts of the exhibits share a name.
    """
    told, by = progress or _silent, made or Made()
    content = document(result, created, by)
    lines = carried(folder, content)

    def fill(fresh: Path) -> None:
        write_lines(lines, fresh)
        table = cache(lambda: table_of(result, content, folder.name))
        _fill(result, table, fresh, content, by, told, beside)
        write_long_table(table(), fresh)
        if vtu:
            from validate.report.export.paraview import write_series

            write_series(result, fresh / "paraview", told)

    folder = replace_folder(folder, fill, (STUDIES, CELLS))
    return folder / "report.html"


def table_of(result: Result, content: Json, run: str) -> LongTable:
    """Return the long table of a result and the content of its results.json."""
    points = {m.name: m.residuals for m in result.methods}
    table = long_table(content, run, points, (*samples(result), *result.rows))
    return replace(table, rows=(*table.rows, *traces_of(content, run)))


def kept_report(result: Result, folder: Path, made: Made, *, vtu: bool = False) -> str:
    """When the report in `folder` was created, where writing it again would change nothing; ""
    where it would, or where none is there."""
    try:
        stored = read_sealed(folder / MARK)
    except RecordingError:
        return ""
    if not (folder / "report.html").is_file() or (vtu and not (folder / "paraview").is_dir()):
        return ""
    created = str(stored.get("created", ""))
    now = json_value(json.dumps(document(result, created, made), allow_nan=False))
    return created if {**now, "made": _by(now)} == {**stored, "made": _by(stored)} else ""


def _by(content: Json) -> Json:
    """What made a run, without the words of the command."""
    return {k: v for k, v in content["made"].items() if k != "command"}


def _silent(_: str) -> None:
    pass


def _fill(
    result: Result,
    table: Callable[[], LongTable],
    folder: Path,
    content: Json,
    made: Made,
    progress: Progress,
    beside: "Beside | None",
) -> None:
    # What draws is imported when something is drawn: matplotlib takes half a second.
    from validate.report.exhibits import drawing, in_turn, write_files
    from validate.report.page.html import body_view, page
    from validate.report.replay.mcap import write_replay
    from validate.report.sections.provenance import how
    from validate.report.sections.sections import SECTIONS, parts

    for name in ("tables", "figures", "runs"):
        (folder / name).mkdir()
    last = (len(SECTIONS), how(result, made))
    shown = drawing(result, chain(parts(result, table), [last]), beside or in_turn)
    progress("runs")
    write_json(content, folder / MARK)
    write_fields(result, folder / "runs")
    progress("replay")
    write_replay(result, folder / "replay.mcap")
    view = body_view(result)
    progress("figures")
    drawn = shown()
    for exhibit in drawn:
        write_files(exhibit, folder)
    progress("page")
    text = page(result, drawn, content["created"], band(result), view)
    (folder / "report.html").write_text(text, "utf-8")


# --- Recorded samples and each method's values there, as rows of the long table.

_VOLUME = ".volume_ratio"


def samples(result: Result) -> Iterator[RowBlock]:
    """Of every recording its drives, its signals, and every method's values at their times.

    A drive has the role `drives`: what lies across in curves. Cavities' volumes are sampled, too.
    """
    for i, registered in enumerate(result.registered):
        name = result.recordings[i].name if i < len(result.recordings) else str(i + 1)
        one = LongRow(recording=name, part=SAMPLE, method=MEASURED)
        times = {tuple(s.t.tolist()): s.t for s in signals(registered)}
        for t in times.values():
            for drive, values in zip(registered.drives, registered.inputs.T, strict=False):
                q = np.interp(t, registered.t, values)
                yield RowBlock(one._replace(quantity=drive.name, unit=drive.unit, role="drives"),
                               q, t)  # fmt: skip
        for s in signals(registered):
            of = one._replace(quantity=s.quantity, unit=s.unit, role=s.role)
            yield RowBlock(of._replace(sd=float(s.sd)), s.y[:, 0], s.t)
            for method in result.methods:
                run = method.runs[i]
                if run.finished and s.trace in run.traces:
                    y = np.interp(s.t, run.t, run.traces[s.trace].y)
                    sd: Floats | None = method.band * np.abs(y) if method.band else None
                    yield RowBlock(of._replace(method=method.name), y, s.t, sd)
        t = next(iter(times.values()), registered.t)
        for method in result.methods:
            run = method.runs[i]
            for trace, found in run.traces.items() if run.finished else ():
                if trace.endswith(_VOLUME):
                    row = one._replace(method=method.name, quantity=trace, unit=found.unit)
                    yield RowBlock(row, np.interp(t, run.t, found.y), t)
