"""Folder and page of a finished study, or of several stored runs; its cells stay."""

from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from validate.compare.exhibit import Exhibit, NumberTable
from validate.compare.result import Result
from validate.engine.execution import CELLS
from validate.parameters import Parameter
from validate.pipeline.experiment.experiment import Experiment
from validate.report.export.tables import write_csv
from validate.report.stored.environment import Made
from validate.report.stored.folder import MARK, Json, replace_folder, write_json
from validate.report.stored.history import carried, write_lines
from validate.report.stored.store import document


@dataclass(frozen=True)
class Findings:
    """What a study tells: `title`, one `sentence`, exhibits, its part of results.json (SI, nothing
    that is not finite), and every cell: tables/cells.csv.

    `passed`: whether its own claims hold (None: it makes none), in the words of `band`: a colour
    and a text. `seed` is the first of a filter study's.
    """

    title: str
    sentence: str
    exhibits: tuple[Exhibit, ...]
    document: dict[str, Any]
    cells: NumberTable
    quick: bool
    parameters: tuple[Parameter, ...] = ()
    passed: bool | None = None
    band: tuple[str, str] = ("open", "Study")
    seed: int | None = None


def write_study(
    experiment: Experiment, told: Findings, folder: Path, made: Made | None = None
) -> Path:
    """Replace all of `folder` but its cells; returns the path of report.html.

    A study that was there leaves its line, unless all that made it is equal. Raises what
    `replace_folder` and `draw_all` do.
    """
    twin = told.seed is not None
    result = replace(
        without_runs(experiment.name, told.title, experiment.source, told.sentence),
        parameters=told.parameters, quick=told.quick, kind=experiment.declared_kind,
        seed=told.seed, twin_notice=experiment.twin_notice if twin else "",
        exhibits=told.exhibits,
    )  # fmt: skip
    by, created = made or Made(), datetime.now(UTC).isoformat(timespec="seconds")
    content = {**document(result, created, by), "study": told.document}
    if told.passed is not None:
        content["passed"] = told.passed
    lines = carried(folder, content)

    def fill(fresh: Path) -> None:
        from validate.report.sections.provenance import how, parameters

        write_lines(lines, fresh)
        shown = (*result.exhibits, parameters(result), how(result, by))
        fill_page(replace(result, exhibits=shown), content, created, told.band, fresh)
        write_csv(fresh / "tables" / "cells.csv", told.cells.headings, told.cells.rows)

    return replace_folder(folder, fill, (CELLS,)) / "report.html"


# --- page of a study or of several stored runs, without methods and recordings of its own --------


def write_loose(
    told: tuple[str, str, str, str], exhibits: tuple[Exhibit, ...], document: dict[str, Any],
    folder: Path, band: str, warnings: tuple[str, ...] = (),
) -> Path:  # fmt: skip
    """Replace `folder` by a page over stored runs, where nothing was run: page, tables, figures and
    `document` as its results.json; returns the path of report.html.

    `told` are name, title, source and sentence, `band` a word before the sentence. Raises what
    `replace_folder` does.
    """
    result = replace(without_runs(*told), warnings=warnings, exhibits=exhibits)
    created = datetime.now(UTC).isoformat(timespec="seconds")

    def fill(fresh: Path) -> None:
        fill_page(result, document, created, ("plain", band), fresh)

    return replace_folder(folder, fill, ()) / "report.html"


def without_runs(name: str, title: str, source: str, sentence: str) -> Result:
    """Return what a page says that has neither methods nor recordings of its own."""
    return Result(name, title, source, sentence, (), (), (), (), (), ())


def fill_page(
    result: Result, content: Json, created: str, band: tuple[str, str], folder: Path
) -> None:
    # What draws is imported when something is drawn: matplotlib takes half a second.
    from validate.report.exhibits import draw_all, write_files
    from validate.report.page.html import page

    for name in ("tables", "figures"):
        (folder / name).mkdir()
    write_json(content, folder / MARK)
    drawn = draw_all(result, result.exhibits)
    for exhibit in drawn:
        write_files(exhibit, folder)
    (folder / "report.html").write_text(page(result, drawn, created, band), encoding="utf-8")
