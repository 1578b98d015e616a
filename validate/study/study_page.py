"""A finished study as its folder: results.json, tables, figures and a page; cells stay."""

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from validate.compare.exhibit import Exhibit
from validate.compare.result import Result
from validate.parameters import Parameter
from validate.replay.experiment import Experiment
from validate.report.folder import MARK, replace_folder
from validate.report.history import carried, write_lines
from validate.report.made import Made
from validate.report.plain import Json
from validate.report.store import document, write_json
from validate.report.tables import write_csv
from validate.study.engine import CELLS

Row = tuple[Any, ...]
CellsTable = tuple[tuple[str, ...], tuple[Row, ...]]


@dataclass(frozen=True)
class Findings:
    """What a study tells: `title`, one `sentence`, exhibits, its part of results.json (SI, nothing
    that is not finite), head and rows of tables/cells.csv.

    `passed`: whether its own claims hold (None: it makes none), in the words of `band`: a colour
    and a text. `seed` is the first of a filter study's.
    """

    title: str
    sentence: str
    exhibits: tuple[Exhibit, ...]
    document: dict[str, Any]
    cells: CellsTable
    quick: bool
    parameters: tuple[Parameter, ...] = ()
    passed: bool | None = None
    band: tuple[str, str] = ("open", "Study")
    seed: int | None = None


def write_study(
    experiment: Experiment, told: Findings, folder: Path, made: Made | None = None
) -> Path:
    """Replaces all of `folder` but its cells; returns the path of report.html.

    A study that was there leaves its line, unless all that made it is equal. Raises what
    `replace_folder` and `draw_all` do.
    """
    twin = told.seed is not None
    result = Result(
        name=experiment.name,
        title=told.title,
        source=experiment.source,
        sentence=told.sentence,
        parameters=told.parameters,
        methods=(),
        recordings=(),
        rest=(),
        effects=(),
        published=(),
        quick=told.quick,
        kind=experiment.declared_kind,
        seed=told.seed,
        twin_notice=experiment.twin_notice if twin else "",
        exhibits=told.exhibits,
    )
    by, created = made or Made(), datetime.now(UTC).isoformat(timespec="seconds")
    content = {**document(result, created, by), "study": told.document}
    if told.passed is not None:
        content["passed"] = told.passed
    lines = carried(folder, content)

    def fill(fresh: Path) -> None:
        write_lines(lines, fresh)
        _fill(told, result, content, by, fresh)

    return replace_folder(folder, fill, (CELLS,)) / "report.html"


def _fill(told: Findings, result: Result, content: Json, made: Made, folder: Path) -> None:
    # What draws is imported when something is drawn: matplotlib takes half a second.
    from validate.report.exhibits import draw_all, write_files
    from validate.report.html import page
    from validate.report.provenance import how, parameters

    for name in ("tables", "figures"):
        (folder / name).mkdir()
    write_json(content, folder / MARK)
    write_csv(folder / "tables" / "cells.csv", *told.cells)
    drawn = draw_all(result, (*result.exhibits, parameters(result), how(result, made)))
    for exhibit in drawn:
        write_files(exhibit, folder)
    text = page(result, drawn, content["created"], told.band)
    (folder / "report.html").write_text(text, encoding="utf-8")
