"""Overview of stored runs: verdict, date and change of each, with links to their reports."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from validate.compare.exhibit import Chart, Exhibit, NumberTable, Series, TableCell
from validate.compare.verdict import NO_EVIDENCE
from validate.errors import UsageError
from validate.report.stored.run_changes import PastRun, Since, history, since
from validate.report.stored.tables import report_folders
from validate.report.views.view_filling import WORDS
from validate.study.loose_page import write_loose

FOLDER = "overview"
_OVER = {
    "summary": "summary: bias and scatter over all runs",
    "published": "printed figures, and ours",
}
_NAMED = 3  # changed parameters and moved checks that are named


@dataclass(frozen=True)
class StoredRun:
    """All runs of a report folder, the oldest first; the last one is what the folder holds.

    `base` is the last run of the experiment as it is declared, of whose parameters these are
    changes; None where it is not stored or is this one.
    """

    runs: tuple[PastRun, ...]
    base: PastRun | None = None

    @property
    def folder(self) -> str:
        return self.runs[-1].folder

    @property
    def verdict(self) -> str:
        """The word over all checks, and whether the run was a quick one."""
        quick = " (quick run)" if self.runs[-1].line.get("quick") else ""
        return f"{self.runs[-1].verdict.partition(';')[0]}{quick}"

    @property
    def changed(self) -> str:
        """What changed since the run before, in words; of a first run, against `base`."""
        if len(self.runs) > 1:
            return change(since(*self.runs[-2:]))
        if self.base is None:
            return "first run"
        return f"first run; against {self.base.folder}: {change(since(self.base, self.runs[-1]))}"


def stored(reports: Path) -> tuple[StoredRun, ...]:
    """Return the runs of every report folder, the newest first.

    Raises `UsageError` where there is none, and for a damaged line.
    """
    folders = [f.name for f in report_folders(reports)] if reports.is_dir() else []
    by_folder: dict[str, list[PastRun]] = {}
    for name in dict.fromkeys(folder.partition("+")[0] for folder in folders):
        for run in history(reports, name):
            by_folder.setdefault(run.folder, []).append(run)
    if not by_folder:
        raise UsageError(f"no stored run below {reports}; `validate run fluid_phantom` makes one")
    last = {folder: runs[-1] for folder, runs in by_folder.items()}
    found = [
        StoredRun(tuple(runs), last.get(folder.partition("+")[0]) if "+" in folder else None)
        for folder, runs in by_folder.items()
    ]
    return tuple(sorted(found, key=lambda s: s.runs[-1].created, reverse=True))


def share(run: PastRun) -> float | None:
    """Return the largest |E| over its limit of a run's checks that are evidence; None where none
    has a limit."""
    judged = (c for c in run.checks if c.verdict not in NO_EVIDENCE)
    shares = [abs(c.value) / c.limit for c in judged if c.value is not None and c.limit]
    return max(shares, default=None)


def change(found: Since) -> str:
    """Return what a run changed, in words."""
    parts = [f"verdict: {found.verdict[0].partition(';')[0]} before"] if found.verdict else []
    parts += [
        f"{name}: {before} -> {after}"
        for name, (before, after) in list(found.parameters.items())[:_NAMED]
    ]
    parts += [f"{m.method} {m.name} moved" for m in found.moved[:_NAMED]]
    parts += [f"method {m} added" for m in found.added] + [f"no {m}" for m in found.left_out]
    parts += ["code"] if found.code else []
    parts += ["files"] if found.files else []
    return "; ".join(parts) or "nothing"


def write_overview(reports: Path) -> Path:
    """Write the overview beside the reports; returns the path of its page.

    Raises what `stored` and `replace_folder` raise.
    """
    found = stored(reports)
    verdicts = [s.verdict for s in found]
    counted = ", ".join(f"{verdicts.count(v)} {v}" for v in dict.fromkeys(verdicts))
    # Links to the pages beside this one: over several runs, and of studies.
    over = [(words, reports / name / "report.html") for name, words in _OVER.items()]
    studies = sorted(reports.glob("*/study-*/report.html"))
    over += [(f"study of {f.parents[1].name}: {f.parent.name.removeprefix('study-')}", f)
             for f in studies]  # fmt: skip
    rows = tuple(
        (TableCell(words, link=f"../{file.relative_to(reports).as_posix()}"),)
        for words, file in over if file.is_file()
    )  # fmt: skip
    tables = [_table(found)]
    if rows:
        title = "Pages over several runs, and of studies"
        tables.append(NumberTable("", title, ("page",), rows))
    # The largest share of a limit, run by run, of what ran more than once.
    series = []
    for one in found:
        points = [(i + 1.0, s) for i, run in enumerate(one.runs) if (s := share(run)) is not None]
        if len(points) > 1:
            x, y = np.array(points).T
            series.append(Series(one.folder, x, y))
    trend = Chart("trend", "Largest |E| over its limit, run by run", "run, the oldest is 1",
                  "largest |E| / limit", tuple(series), (("limit", 1.0),))  # fmt: skip
    charts = (trend,) if series else ()
    exhibit = Exhibit("runs", "Stored runs", (), tuple(tables), charts)
    told = ("overview", "All stored runs", reports.resolve().name,
            f"{len(found)} stored run{'s' if len(found) != 1 else ''}: {counted}.")  # fmt: skip
    members = [
        {"folder": s.folder, "created": s.runs[-1].created, "verdict": s.verdict,
         "largest_share_of_limit": share(s.runs[-1]), "changed": s.changed}
        for s in found
    ]  # fmt: skip
    document = {"page": FOLDER, "runs": members}
    return write_loose(told, (exhibit,), document, reports / FOLDER, "Stored")


def _table(found: Sequence[StoredRun]) -> NumberTable:
    rows = tuple(
        (
            TableCell(s.folder, emphasis="strong", link=f"../{s.folder}/report.html"),
            TableCell(s.verdict, emphasis=WORDS.get(s.verdict.partition(" (")[0], "")),
            s.runs[-1].verdict.partition("; evidence: ")[2],
            share(s.runs[-1]),
            s.runs[-1].created[:16].replace("T", " "),
            s.changed,
        )
        for s in found
    )
    heads = ("run", "verdict", "evidence", "largest |E| / limit", "made, UTC",
             "changed since the run before")  # fmt: skip
    return NumberTable(
        "runs", "The last run of every folder", heads, rows,
        "Evidence: checks on data that neither calibrated nor made the model. A share of the limit "
        "(of those checks) above 1 fails for its value alone; the verdict counts 2 u_val, too. "
        "Bias and scatter over all of them: validate summary.",
        below="changed since the run before",
    )  # fmt: skip
