"""Folder of a finished study: results.json, tables, figures and a page; its cells stay."""

from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from validate.compare.exhibit import Exhibit, NumberTable
from validate.engine.execution import CELLS
from validate.parameters import Parameter
from validate.pipeline.experiment.experiment import Experiment
from validate.report.export.tables import write_csv
from validate.report.stored.environment import Made
from validate.report.stored.folder import replace_folder
from validate.report.stored.history import carried, write_lines
from validate.report.stored.store import document
from validate.study.loose_page import fill_page, without_runs


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
