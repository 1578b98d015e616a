"""A finished study as its folder: results.json, tables, figures and a page; cells stay."""

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from validate.compare.exhibit import Exhibit
from validate.compare.result import Result
from validate.parameters import Parameter
from validate.replay.experiment import Experiment
from validate.report.study_page import Row, StudyPage, write_study_page
from validate.study.engine import CELLS

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


def write_study(experiment: Experiment, told: Findings, folder: Path) -> Path:
    """Replaces all of `folder` but its cells; returns the path of report.html."""
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
        kind="measured" if not twin else "same model" if experiment.same_model else "twin",
        seed=told.seed,
        twin_notice=experiment.twin_notice if twin else "",
        exhibits=told.exhibits,
    )
    created = datetime.now(UTC).isoformat(timespec="seconds")
    page = StudyPage(result, told.document, told.cells, (CELLS,), told.passed, told.band)
    return write_study_page(page, folder, created)
